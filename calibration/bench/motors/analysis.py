"""From recordings to the result, in one call: the same for a run just made and for files of long ago."""

from collections.abc import Sequence

import numpy as np

from calibration.bench.motors.checks import (
    check_clock,
    check_commands,
    check_direction,
    check_directions,
    check_edges,
    check_heat,
    check_speed,
)
from calibration.bench.motors.clock import RESONATOR_SIGMA, ClockFit
from calibration.bench.motors.direction import DirectionFit, fit_direction
from calibration.bench.motors.errors import TachometerError
from calibration.bench.motors.fit import fit_law
from calibration.bench.motors.law import THRUST_FIRST_ORDER
from calibration.bench.motors.propellers import PropellerMap
from calibration.bench.motors.records import (
    CommandRecord,
    EdgeRecord,
    SpeedTrace,
    WindowRecord,
    trace_of_windows,
)
from calibration.bench.motors.revolutions import mark_passages, speed_trace
from calibration.bench.motors.settling import time_to_share
from calibration.bench.motors.steps import Direction, SpeedStep, find_steps
from calibration.bench.motors.tachometer_result import StepSummary, TachometerResult, standard_steps
from calibration.measurement import Finding, Severity

_FEWEST_EDGES = 50
_MILLIS_SIGMA = 1e-4
"""Relative: a legacy log's stamps are the host's, or whole milliseconds."""


def analyse(
    records: Sequence[EdgeRecord | WindowRecord],
    propeller: PropellerMap,
    hover_thrust: float,
    marks: int = 2,
    clock: ClockFit | None = None,
    expected_speed: float | None = None,
    commands: CommandRecord | None = None,
    overflow: int = 0,
    reach: float | None = None,
) -> TachometerResult:
    """Fit the speed law to all steps of all recordings of one motor.

    Args:
        records: of one motor with one propeller.
        propeller: its map.
        hover_thrust: N per motor, where local time constants are given.
        marks: marks per revolution (blades); a window recording brings its own.
        clock: comparison of the instrument's clock with the host's; edges are corrected by it.
        expected_speed: rad/s that somebody expects at the highest command, if known.
        commands: on the instrument's clock; checks the directions.
        overflow: edges that the instrument dropped.
        reach: rad/s that the vehicle file gives at the highest command and voltage, if known.

    Raises:
        TachometerError: no steps at all, or too few samples.
    """
    findings: list[Finding] = []
    traces: list[SpeedTrace] = []
    for record in records:
        found, seen = _traces(record, marks, clock, overflow)
        traces += found
        findings += seen
    if any(isinstance(record, EdgeRecord) for record in records):
        findings += check_clock(clock)
    steps = [step for trace in traces for step in find_steps(trace)]
    if not steps:
        names = ", ".join(record.name for record in records)
        raise TachometerError(
            f"{names}: no step was found; record a staircase of at least six steps up and down"
        )
    highest = max(max(step.before, step.after) for step in steps)
    findings += check_speed(steps[0].trace.name, highest, expected_speed, reach)
    for trace in traces:
        findings += check_heat(trace)
    if commands is not None:
        findings += check_commands(steps, commands)
    sigma = _clock_sigma(records, clock)
    up, seen_up = _direction([step for step in steps if step.direction is Direction.UP], sigma, marks)
    down, seen_down = _direction([step for step in steps if step.direction is Direction.DOWN], sigma, marks)
    findings += [*seen_up, *seen_down, *check_directions(up, down, 0.8 * highest)]
    return TachometerResult(
        up=up,
        down=down,
        propeller=propeller,
        hover_thrust=hover_thrust,
        standard=standard_steps(up, down, propeller),
        steps=_summaries(up, down),
        clock=clock,
        findings=tuple(dict.fromkeys(findings)),
    )


def _traces(
    record: EdgeRecord | WindowRecord, marks: int, clock: ClockFit | None, overflow: int
) -> tuple[list[SpeedTrace], list[Finding]]:
    if isinstance(record, WindowRecord):
        text = (
            f"{record.name}: speeds averaged over {1e3 * record.window:.0f} ms by the instrument, one mark "
            f"more or less is {2.0 * np.pi / (record.marks * record.window):.0f} rad/s"
        )
        return [trace_of_windows(record)], [Finding("window_averaged", Severity.WARNING, text)]
    scaled = record if clock is None else record.scaled(clock.scale.value)
    parts = [mark_passages(part) for part in scaled.parts() if part.times.size >= _FEWEST_EDGES]
    if not parts:
        raise TachometerError(f"{record.name}: {record.times.size} edges; a recording of steps has thousands")
    findings = check_edges(record, parts, marks, overflow)
    return [speed_trace(part, marks, record.name) for part in parts], findings


def _clock_sigma(records: Sequence[EdgeRecord | WindowRecord], clock: ClockFit | None) -> float:
    if clock is not None:
        return clock.scale.sigma
    return RESONATOR_SIGMA if any(isinstance(one, EdgeRecord) for one in records) else _MILLIS_SIGMA


def _direction(
    steps: Sequence[SpeedStep], clock_sigma: float, marks: int
) -> tuple[DirectionFit | None, list[Finding]]:
    if not steps:
        return None, []
    fit = fit_direction(steps, clock_sigma)
    return fit, check_direction(fit, marks)


def _summaries(up: DirectionFit | None, down: DirectionFit | None) -> tuple[StepSummary, ...]:
    rows: list[StepSummary] = []
    for fit in (up, down):
        if fit is None:
            continue
        for index, step in enumerate(fit.steps):
            start, end = float(fit.fit.before[index]), float(fit.fit.after[index])
            residuals = fit.fit.residuals[fit.fit.step_of == index]
            rows.append(
                StepSummary(
                    name=step.trace.name,
                    begin=float(fit.fit.begins[index]),
                    start=start,
                    end=end,
                    time_63=time_to_share(start, end, fit.a.value, fit.b.value),
                    thrust_constant=fit_law(THRUST_FIRST_ORDER, [step]).values[0],
                    rms=float(np.sqrt(np.mean(residuals**2))),
                )
            )
    return tuple(sorted(rows, key=lambda row: (row.name, row.begin)))
