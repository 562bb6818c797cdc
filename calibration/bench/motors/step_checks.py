"""What can be wrong with steps of the speed: each finding names its figure, its limit and what to do."""

from collections.abc import Sequence

import numpy as np

from calibration.bench.motors.cluster_covariance import FEWEST_STEPS
from calibration.bench.motors.direction import DirectionFit, is_low_resolution
from calibration.bench.motors.records import CommandRecord, SpeedTrace
from calibration.bench.motors.steps import Direction, Step, speeds_on_grid
from calibration.measurement import Finding, Severity
from onboard.arrays import FloatArray

FEWEST_EDGES = 8
SETTLED = 0.95
DRIFT_LIMIT = 0.01
"""1/s."""
HOT_SHARE, HOT_TIME = 0.8, 10.0
_SIGNIFICANT = 3.5
_COMMAND_REACH = 0.3
"""s between a command and the step it causes."""


def check_direction(fit: DirectionFit, marks: int) -> list[Finding]:
    """Findings about the steps of one direction, by the fit that was made of them."""
    findings: list[Finding] = []
    a, b = fit.a.value, fit.b.value
    coarse = [step for step in fit.steps if is_low_resolution(step, a, b)]
    if coarse:
        window = 1e3 * coarse[0].trace.resolution
        text = (
            f"low resolution: {coarse[0].trace.name} averages over {window:.0f} ms, more than a "
            "third of the time "
            "constant: times are within 8 % at best and no claim; use an instrument that stamps every edge"
        )
        findings.append(Finding("low_resolution", Severity.WARNING, text))
    for index, step in enumerate(fit.steps):
        findings += _check_step(fit, index, step, marks)
    if len(fit.steps) < FEWEST_STEPS:
        text = (
            f"{len(fit.steps)} steps {fit.direction.value} (at least {FEWEST_STEPS} are asked for): how much "
            "repeats differ is not known; the intervals rest on the residuals"
        )
        findings.append(Finding("few_steps", Severity.WARNING, text))
    return findings


def _check_step(fit: DirectionFit, index: int, step: Step, marks: int) -> list[Finding]:
    place = f"{step.trace.name}, step at {step.onset:.2f} s"
    law = fit.fit
    inside = slice(step.first, step.last)
    middle = 0.5 * (step.trace.start + step.trace.end)[inside]
    speed = step.trace.speed[inside]
    before, after = float(law.before[index]), float(law.after[index])
    findings: list[Finding] = []
    done = (speed**2 - before**2) / (after**2 - before**2)
    transient = (middle > law.begins[index]) & (done < SETTLED)
    length = (step.trace.end - step.trace.start)[inside]
    edges = float(np.sum((speed * length)[transient])) * marks / (2.0 * np.pi)
    if edges < FEWEST_EDGES:
        text = (
            f"{place}: {edges:.0f} edges while the speed changes (at least {FEWEST_EDGES}): "
            "record larger steps"
        )
        findings.append(Finding("few_edges", Severity.WARNING, text))
    last = float(np.mean(done[-max(1, done.size // 10) :]))
    if last < SETTLED:
        text = (
            f"{place}: only {last:.0%} of the thrust step was done when it ended (95 % asked): hold it longer"
        )
        findings.append(Finding("not_settled", Severity.WARNING, text))
    drift, sigma = _drift(law.residuals[law.step_of == index], middle, speed)
    if abs(drift) > DRIFT_LIMIT and abs(drift) > _SIGNIFICANT * sigma:
        text = (
            f"{place}: the settled speed drifts by {drift:+.1%} a second (limit 1 %): warm up, use a supply"
        )
        findings.append(Finding("drifting", Severity.WARNING, text))
    return findings


def _drift(residuals: FloatArray, middle: FloatArray, speed: FloatArray) -> tuple[float, float]:
    """Relative slope (1/s) of what the law leaves in the later half of a step, and its uncertainty."""
    late = middle > 0.5 * (middle[0] + middle[-1])
    level = float(np.mean(speed[late]))
    if late.sum() < 5 or level < 0.2 * float(np.max(speed)):
        return 0.0, 0.0
    t = middle[late] - middle[late].mean()
    spread = float(np.sum(t**2))
    slope = -float(t @ residuals[late]) / spread
    rest = -residuals[late] - np.mean(-residuals[late]) - slope * t
    return slope / level, float(np.sqrt(rest @ rest / max(rest.size - 2, 1) / spread)) / level


def check_directions(up: DirectionFit | None, down: DirectionFit | None, speed: float) -> list[Finding]:
    """Whether both directions are there, and the driven one is the faster.

    Args:
        up, down: fits.
        speed: rad/s at which they are compared.
    """
    for name, fit in (("up", up), ("down", down)):
        if fit is None:
            text = f"no step {name} was found: record steps of at least 4 % of the highest speed, 1.5 s each"
            return [Finding("no_steps", Severity.WARNING, text)]
    if up is None or down is None or up.local(speed).value <= 1.2 * down.local(speed).value:
        return []
    text = (
        f"the motor rises more slowly ({up.local(speed).value:.3f} s) than it coasts down "
        f"({down.local(speed).value:.3f} s): up and down may be swapped; check the order of the commands"
    )
    return [Finding("directions_swapped", Severity.WARNING, text)]


def check_commands(steps: Sequence[Step], commands: CommandRecord) -> list[Finding]:
    """Whether the speed follows the commands: the same direction, soon after."""
    changes = np.diff(commands.commands, prepend=commands.commands[:1])
    for step in steps:
        near = np.flatnonzero((np.abs(commands.times - step.onset) < _COMMAND_REACH) & (changes != 0.0))
        if near.size and not np.any((changes[near] > 0.0) == (step.direction is Direction.UP)):
            text = (
                f"{step.trace.name}, step at {step.onset:.2f} s: the speed goes "
                f"{step.direction.value} when the "
                "command goes the other way: up and down are swapped, or the clocks do not belong together"
            )
            return [Finding("directions_swapped", Severity.REJECT, text)]
    return []


def check_heat(trace: SpeedTrace) -> list[Finding]:
    """Whether a motor ran too long near its highest speed."""
    speeds, ends = speeds_on_grid(trace, 0.1)
    fast = speeds > HOT_SHARE * float(np.max(trace.speed))
    changes = np.flatnonzero(np.diff(np.concatenate([[False], fast, [False]]).astype(int)))
    longest = max(
        (int(stop - begin) for begin, stop in zip(changes[::2], changes[1::2], strict=True)), default=0
    )
    if longest * 0.1 <= HOT_TIME:
        return []
    text = (
        f"{trace.name}: {longest * 0.1:.0f} s above {HOT_SHARE:.0%} of the highest speed (limit "
        f"{HOT_TIME:.0f} s): "
        f"let the motor cool before the next run (recording ends at {ends[-1]:.0f} s)"
    )
    return [Finding("hot_motor", Severity.WARNING, text)]
