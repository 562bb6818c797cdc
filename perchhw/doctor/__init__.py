"""Is everything here that a flight needs? Measured, held against what is wanted, explained, with the remedy.

:mod:`perchhw.doctor.measure` takes the readings; the checks are tables of small functions from readings to a
:class:`Finding`: :mod:`perchhw.doctor.host_checks`, :mod:`perchhw.doctor.drone_checks` and
:mod:`perchhw.doctor.mocap_checks`. Nothing is armed, set or sent to the drone but questions.
"""

from perchhw.doctor.examine import examine
from perchhw.doctor.finding import CheckVerdict, Finding
from perchhw.doctor.measure import take_readings

__all__ = ["Finding", "CheckVerdict", "examine", "take_readings"]
