"""The time of a simulated lab that keeps its own: read, waited for, and held until all work is done.

A lab that is served with ``--pace lockstep`` or ``--pace FACTOR`` names the address of its clock in the URIs
of its drones and its mocap streams (``?time=HOST:PORT``). Who flies there takes part in its turns.
"""

from onboard.lab_time.address import TimeAddress, open_timebase, time_address
from onboard.lab_time.lab_time import LabTime, LabTimeError

__all__ = ["LabTime", "LabTimeError", "TimeAddress", "open_timebase", "time_address"]
