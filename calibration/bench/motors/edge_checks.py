"""What can be wrong with edges: each finding names its figure, its limit and what to do."""

from collections.abc import Sequence

import numpy as np

from calibration.bench.motors.clock import ENOUGH, ClockFit
from calibration.bench.motors.mark_pattern import MarkPattern, mark_pattern
from calibration.bench.motors.records import EdgeRecord
from calibration.bench.motors.revolutions import MarkPassages
from calibration.measurement import Finding, Severity
from onboard.arrays import FloatArray

BAD_EDGE_SHARE = 0.02
UNEVEN_LIMIT = 0.10
SPEED_RANGE = (1500.0, 3200.0)
"""rad/s that the fastest step of a 7x16 mm motor reaches (bench notes 1.2)."""
EXPECTED_TOLERANCE = 0.30
_MAINS = (100.0, 120.0)
"""Hz at which lamps flicker on 50 and 60 Hz mains."""
_MAINS_TOLERANCE = 0.003
_MAINS_BLOCK = 50


def check_edges(
    record: EdgeRecord, parts: Sequence[MarkPassages], marks: int, overflow: int = 0
) -> list[Finding]:
    """Findings about one recording of edges.

    Args:
        record: as it came.
        parts: its parts, repaired.
        marks: marks per revolution, as the operator says.
        overflow: edges the instrument dropped because its buffer was full.
    """
    findings: list[Finding] = []
    if len(parts) > 1:
        text = f"{record.name}: the instrument's clock or count went back {len(parts) - 1} times (a reset): "
        findings.append(
            Finding("clock_reset", Severity.WARNING, text + "check its cable; steps cut by it are lost")
        )
    total = sum(part.times.size + part.missed for part in parts)
    findings += _shares(record, parts, total)
    lost = sum(part.lost for part in parts)
    if lost:
        text = (
            f"{record.name}: {lost} of {total + lost} edges were lost on the line; their number "
            "is known and used"
        )
        severity = Severity.WARNING if lost > BAD_EDGE_SHARE * total else Severity.NOTE
        findings.append(Finding("lost_edges", severity, text))
    if overflow:
        text = (
            f"{record.name}: the instrument dropped {overflow} edges: its buffer was full; use a faster line"
        )
        findings.append(Finding("overflow", Severity.WARNING, text))
    longest = max(parts, key=lambda part: part.times.size, default=None)
    if longest is not None and longest.times.size > 2:
        findings += _check_pattern(record.name, mark_pattern(longest), marks)
        findings += _check_mains(record.name, longest.times, marks)
    return findings


def _shares(record: EdgeRecord, parts: Sequence[MarkPassages], total: int) -> list[Finding]:
    findings: list[Finding] = []
    for code, count, advice in (
        ("missed_edges", sum(part.missed for part in parts), "move the sensor closer, or whiten the mark"),
        ("doubled_edges", sum(part.doubled for part in parts), "shade the sensor, or raise its threshold"),
    ):
        share = count / max(total, 1)
        if share > BAD_EDGE_SHARE:
            text = (
                f"{record.name}: {share:.1%} {code.replace('_', ' ')} (limit {BAD_EDGE_SHARE:.0%}): {advice}"
            )
            findings.append(Finding(code, Severity.WARNING, text))
    return findings


def _check_pattern(name: str, pattern: MarkPattern, marks: int) -> list[Finding]:
    findings: list[Finding] = []
    if pattern.period is not None and marks % pattern.period:
        text = (
            f"{name}: the intervals repeat after {pattern.period} marks, but {marks} per "
            "revolution were given: "
            f"count the blades; with {pattern.period} all speeds are "
            f"{marks / pattern.period:.3g} times as high"
        )
        findings.append(Finding("blade_count", Severity.REJECT, text))
    if pattern.period is not None and pattern.unevenness > UNEVEN_LIMIT:
        text = (
            f"{name}: intervals differ by {pattern.unevenness:.0%} from mark to mark (limit "
            f"{UNEVEN_LIMIT:.0%}): "
            "whole revolutions cancel it; paint the marks alike to be safe"
        )
        findings.append(Finding("uneven_marks", Severity.NOTE, text))
    return findings


def _check_mains(name: str, times: FloatArray, marks: int) -> list[Finding]:
    """Lamps make edges at exactly 100 or 120 Hz; a motor's rate is never that steady by chance."""
    if times.size <= 3 * _MAINS_BLOCK:
        return []
    rate = _MAINS_BLOCK / (times[_MAINS_BLOCK:] - times[:-_MAINS_BLOCK])[::_MAINS_BLOCK]
    for mains in _MAINS:
        locked = np.abs(rate / mains - 1.0) < _MAINS_TOLERANCE
        if np.any(locked[1:] & locked[:-1]):
            speed = 2.0 * np.pi * mains / marks
            text = (
                f"{name}: edges at {mains:.0f} Hz ({speed:.0f} rad/s) that do not move: the "
                "sensor sees lamps; "
                "shade it or switch them off"
            )
            return [Finding("mains_flicker", Severity.REJECT, text)]
    return []


def check_speed(name: str, highest: float, expected: float | None) -> list[Finding]:
    """Whether the highest speed (rad/s) is one that the motor can have.

    Args:
        name: of the recording.
        highest: rad/s, settled.
        expected: rad/s by the vehicle file at the highest command and the supply's voltage, if known.
    """
    if expected is not None and abs(highest / expected - 1.0) > EXPECTED_TOLERANCE:
        ratio = highest / expected
        text = (
            f"{name}: {highest:.0f} rad/s where {expected:.0f} are expected ({ratio:.2f} times; limit "
            f"+-{EXPECTED_TOLERANCE:.0%}): a wrong number of blades, another propeller, or a "
            "supply that is off"
        )
        return [Finding("blade_count", Severity.REJECT, text)]
    if expected is None and not SPEED_RANGE[0] <= highest <= SPEED_RANGE[1]:
        text = (
            f"{name}: the highest speed is {highest:.0f} rad/s; 7x16 motors reach {SPEED_RANGE[0]:.0f} to "
            f"{SPEED_RANGE[1]:.0f} at full command: check the number of blades, or say what to expect"
        )
        return [Finding("speed_range", Severity.WARNING, text)]
    return []


def check_clock(clock: ClockFit | None) -> list[Finding]:
    """Whether the instrument's clock was compared with the host's for long enough."""
    if clock is None:
        text = "the instrument's clock was not compared with the host's: times may be off by 0.5 %"
        return [Finding("clock_unchecked", Severity.NOTE, text)]
    if clock.span < ENOUGH:
        text = f"clocks were compared for {clock.span:.0f} s only (60 s give 0.01 %): record longer"
        return [Finding("clock_short", Severity.NOTE, text)]
    return []
