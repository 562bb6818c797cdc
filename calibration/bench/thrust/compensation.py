"""Battery compensation: what a sagging battery still gives, and whether a recorded discharge held it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calibration.bench.thrust.choose import FULL_DUTY
from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.pwm import applied_duty
from calibration.measurement import Finding, Severity
from onboard.arrays import BoolArray, FloatArray
from onboard.battery import thrust_from_voltage
from onboard.csv_file import read_csv, write_csv
from onboard.gravity import GRAM_FORCE
from onboard.thrust_map import ThrustMap

REPORTED_VOLTAGES = (3.2, 3.5, 3.8)
"""V of the battery under load."""
VERIFY_HEADER = ("t_s", "battery_v", "asked_gf", "command", "scale_g", "motors")

_SETTLED_AFTER = 0.5
"""s after a new set point: the firmware low-passes the supply's voltage with 0.1 s."""
_RELATIVE_LIMIT, _ABSOLUTE_LIMIT_GF = 0.03, 0.15
_LEAST_READINGS, _LEAST_FALL_V = 8, 0.2
"""Of what is judged: a few readings hold by luck, and any map at one voltage. By 0.2 V less a thrust that
nothing compensates falls by a tenth, three times the limit."""
_SAME = 1e-6


def achievable(thrust_map: ThrustMap, battery: float) -> float:
    """Most thrust (N) of one motor at a battery of that voltage (V): at a duty of 255/256."""
    return thrust_from_voltage(thrust_map, FULL_DUTY * battery)


@dataclass(frozen=True, slots=True)
class Discharge:
    """A recorded run with compensation on while the battery empties.

    Attributes:
        time: (n,) s.
        battery: (n,) V.
        requested, measured: (n,) N of one motor.
        command: (n,) 0..65535.
    """

    time: FloatArray
    battery: FloatArray
    requested: FloatArray
    measured: FloatArray
    command: FloatArray


@dataclass(frozen=True, slots=True)
class Verification:
    """Whether the thrust stayed what was asked for.

    Attributes:
        judged: (n,) settled readings that were not saturated.
        saturated: (n,) readings where the battery could not give more.
        worst_relative: largest error over the thrust asked for, where judged.
        worst_gf: largest error, gf, where judged.
        worst_share: largest error over its limit (3 % or 0.15 gf, whichever is larger).
        saturated_below: V of the battery at and below which readings were saturated; None if none was.
        findings: what does not pass, and saturation.
    """

    judged: BoolArray
    saturated: BoolArray
    worst_relative: float
    worst_gf: float
    worst_share: float
    saturated_below: float | None
    findings: tuple[Finding, ...]

    @property
    def passed(self) -> bool:
        """Whether all judged readings lie within 3 % or 0.15 gf, and are enough to tell."""
        return all(finding.severity is Severity.NOTE for finding in self.findings)

    def json_shape(self) -> dict[str, Any]:
        """Figures for reports."""
        return {
            "passed": self.passed,
            "readings": int(self.judged.sum()),
            "saturated_readings": int(self.saturated.sum()),
            "saturated_below_v": self.saturated_below,
            "worst_relative": self.worst_relative,
            "worst_gf": self.worst_gf,
            "findings": self.findings,
        }


def read_discharge(path: Path) -> Discharge:
    """A recorded discharge: columns of `VERIFY_HEADER`, the scale's reading already without drift.

    Raises:
        ThrustTableError: not readable, other columns, no readings, a cell that is no number, or a time that
            goes back: from when a thrust was asked for, and so which readings count, is not known then.
    """
    table = read_csv(path, ThrustTableError, comment="#")
    if table.header != VERIFY_HEADER:
        raise ThrustTableError(
            f"{path}: header {','.join(table.header)!r}; expected {','.join(VERIFY_HEADER)!r}"
        )
    values = {name: table.finite(name) for name in VERIFY_HEADER}
    if not table.rows:
        raise ThrustTableError(f"{path}: no readings below the header; record the discharge again")
    if np.any(values["motors"] < 1.0):
        raise ThrustTableError(f"{path}: column 'motors': at least one motor turns")
    for back in np.flatnonzero(np.diff(values["t_s"]) < 0.0)[:1]:
        what = "time goes back; judge recordings that began anew one by one, or let their times go on"
        raise table.problem(table.rows[back + 1], "t_s", what)
    return Discharge(
        time=values["t_s"],
        battery=values["battery_v"],
        requested=values["asked_gf"] * GRAM_FORCE,
        measured=values["scale_g"] / values["motors"] * GRAM_FORCE,
        command=values["command"],
    )


def write_discharge(path: Path, discharge: Discharge, motors: int) -> None:
    """Write a discharge as :func:`read_discharge` reads it; `motors` turned."""
    columns = (discharge.time, discharge.battery, discharge.requested, discharge.command, discharge.measured)
    rows = (
        (
            f"{time:.3f}",
            f"{battery:.4f}",
            f"{requested / GRAM_FORCE:.4f}",
            f"{command:.0f}",
            f"{motors * measured / GRAM_FORCE:.4f}",
            str(motors),
        )
        for time, battery, requested, command, measured in zip(*columns, strict=True)
    )
    write_csv(path, VERIFY_HEADER, rows)


def verify(discharge: Discharge) -> Verification:
    """Judge every settled reading of a discharge.

    Raises:
        ThrustTableError: no reading is settled and unsaturated.
    """
    saturated = applied_duty(discharge.command) >= FULL_DUTY - _SAME
    settled = _settled(discharge)
    judged = settled & ~saturated & (discharge.requested > 0.0)
    if not np.any(judged):
        raise ThrustTableError(
            "no settled reading without saturation: start with a full battery and less thrust"
        )
    error = np.abs(discharge.measured - discharge.requested)[judged]
    requested = discharge.requested[judged]
    limit = np.maximum(_RELATIVE_LIMIT * requested, _ABSOLUTE_LIMIT_GF * GRAM_FORCE)
    worst_share = float(np.max(error / limit))
    findings: list[Finding] = []
    if worst_share > 1.0:
        at = int(np.argmax(error / limit))
        text = (
            f"thrust is off by {error[at] / GRAM_FORCE:.2f} gf at {discharge.battery[judged][at]:.2f} V "
            f"(limit {limit[at] / GRAM_FORCE:.2f} gf): repeat the map, check the board's voltage "
            "with a multimeter"
        )
        findings.append(Finding("compensation_off", Severity.WARNING, text))
    battery = discharge.battery[judged]
    if battery.size < _LEAST_READINGS or np.ptp(battery) < _LEAST_FALL_V:
        text = (
            f"{battery.size} settled readings without saturation from {np.max(battery):.2f} to "
            f"{np.min(battery):.2f} V do not tell whether the thrust stays while the voltage falls: "
            f"record at least {_LEAST_READINGS} of them over {_LEAST_FALL_V:g} V, from a full battery on"
        )
        findings.append(Finding("short_discharge", Severity.WARNING, text))
    below = None
    if np.any(saturated):
        below = float(np.max(discharge.battery[saturated]))
        text = (
            f"saturated at and below {below:.2f} V for "
            f"{np.min(discharge.requested[saturated]) / GRAM_FORCE:.1f} gf: the "
            "battery cannot give more; compensation ends here"
        )
        findings.append(Finding("saturated", Severity.NOTE, text))
    return Verification(
        judged=judged,
        saturated=saturated,
        worst_relative=float(np.max(error / requested)),
        worst_gf=float(np.max(error)) / GRAM_FORCE,
        worst_share=worst_share,
        saturated_below=below,
        findings=tuple(findings),
    )


def _settled(discharge: Discharge) -> BoolArray:
    """Readings at least half a second after the thrust asked for last changed."""
    change = np.abs(np.diff(discharge.requested, prepend=discharge.requested[:1])) > _SAME
    since = np.where(change, discharge.time, -np.inf)
    since[0] = discharge.time[0]
    return np.asarray(discharge.time - np.maximum.accumulate(since) >= _SETTLED_AFTER, dtype=np.bool_)
