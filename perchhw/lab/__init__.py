"""The lab file in use: where it is found, what it gives to a flight; hardware never flies without one."""

from perchhw.lab.find import clock_of, drones_of, find_lab, read_lab
from perchhw.lab.flying import correction_of, flies_by_own_law, in_record, limits_of
from perchhw.lab.hardware import LabRequired, on_this_machine, require_lab
from perchhw.lab.setup import DeskSetup, FlightSetup, SetupError, desk_setup, flight_setup

__all__ = [
    "DeskSetup",
    "FlightSetup",
    "LabRequired",
    "SetupError",
    "clock_of",
    "correction_of",
    "desk_setup",
    "drones_of",
    "find_lab",
    "flies_by_own_law",
    "flight_setup",
    "in_record",
    "limits_of",
    "on_this_machine",
    "read_lab",
    "require_lab",
]
