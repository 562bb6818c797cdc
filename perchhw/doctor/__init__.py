"""Is everything here that a flight needs? Measured, held against what is wanted, explained, with the remedy.

:mod:`perchhw.doctor.measure` takes the readings; the checks are tables of small functions from readings to a
:class:`CheckResult`: :mod:`perchhw.doctor.host_checks`, :mod:`perchhw.doctor.drone_checks` and
:mod:`perchhw.doctor.mocap_checks`. Nothing is armed, set or sent to the drone but questions.
"""

from perchhw.doctor.check_result import CheckResult, CheckVerdict
from perchhw.doctor.examine import examine
from perchhw.doctor.measure import take_readings

__all__ = ["CheckResult", "CheckVerdict", "examine", "take_readings"]
