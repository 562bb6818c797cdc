"""What can be wrong with edges, with steps of the speed, and with the fits of both directions."""

from collections.abc import Iterator, Sequence

import numpy as np

from calibration.bench.check_table import NOTED, REJECTED, WARNED, Check, above, below, findings_of
from calibration.bench.motors.clock import ENOUGH, ClockFit
from calibration.bench.motors.cluster_covariance import FEWEST_STEPS
from calibration.bench.motors.direction import DirectionFit, is_low_resolution
from calibration.bench.motors.mark_pattern import mark_pattern
from calibration.bench.motors.records import CommandRecord, EdgeRecord, SpeedTrace
from calibration.bench.motors.revolutions import MarkPassages
from calibration.bench.motors.steps import Direction, SpeedStep, speeds_on_grid
from calibration.measurement import Finding
from onboard.arrays import FloatArray

BAD_EDGE_SHARE = 0.02
SPEED_RANGE = (1500.0, 3200.0)
"""rad/s that the fastest step of a 7x16 mm motor reaches (bench notes 1.2)."""
REACH_MARGIN = 1.1
"""Faster than the vehicle file says by more is worth a look: 10 % in speed are 21 % in thrust."""
HOT_SHARE = 0.8
_MAINS = (100.0, 120.0)
"""Hz at which lamps flicker on 50 and 60 Hz mains."""
_MAINS_TOLERANCE = 0.003
_MAINS_BLOCK = 50
_SIGNIFICANT = 3.5
_COMMAND_REACH = 0.3
"""s between a command and the step it causes."""


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
    total = sum(part.times.size + part.missed for part in parts)
    lost = sum(part.lost for part in parts)
    few = lost <= BAD_EDGE_SHARE * total
    shares = above(warning=BAD_EDGE_SHARE)
    table = [
        Check(
            "clock_reset",
            len(parts) - 1,
            WARNED,
            "the instrument's clock or count went back {} times (a reset)",
            "check its cable; steps cut by it are lost",
        ),
        Check(
            "missed_edges",
            sum(part.missed for part in parts) / max(total, 1),
            shares,
            "{:.1%} missed edges (limit {:.0%})",
            "move the sensor closer, or whiten the mark",
        ),
        Check(
            "doubled_edges",
            sum(part.doubled for part in parts) / max(total, 1),
            shares,
            "{:.1%} doubled edges (limit {:.0%})",
            "shade the sensor, or raise its threshold",
        ),
        Check(
            "lost_edges",
            lost,
            NOTED if few else WARNED,
            f"{{}} of {total + lost} edges were lost on the line",
            "their number is known and used",
        ),
        Check(
            "overflow",
            overflow,
            WARNED,
            "the instrument dropped {} edges: its buffer was full",
            "use a faster line",
        ),
    ]
    longest = max(parts, key=lambda part: part.times.size, default=None)
    if longest is not None and longest.times.size > 2:
        table += [*_pattern(longest, marks), _mains(longest.times, marks)]
    return findings_of(record.name, table)


def _pattern(passages: MarkPassages, marks: int) -> Iterator[Check]:
    """Whether the marks of a revolution are as many as was said, and alike."""
    pattern = mark_pattern(passages)
    if pattern.period is None:
        return
    yield Check(
        "blade_count",
        marks % pattern.period,
        REJECTED,
        f"the intervals repeat after {pattern.period} marks, but {marks} per revolution were given",
        f"count the blades; with {pattern.period} all speeds are {marks / pattern.period:.3g} times as high",
    )
    yield Check(
        "uneven_marks",
        pattern.unevenness,
        above(note=0.10),
        "intervals differ by {:.0%} from mark to mark (limit {:.0%})",
        "whole revolutions cancel it; paint the marks alike to be safe",
    )


def _mains(times: FloatArray, marks: int) -> Check:
    """Lamps make edges at exactly 100 or 120 Hz; a motor's rate is never that steady by chance."""
    seen = 0.0
    if times.size > 3 * _MAINS_BLOCK:
        rate = _MAINS_BLOCK / (times[_MAINS_BLOCK:] - times[:-_MAINS_BLOCK])[::_MAINS_BLOCK]
        for mains in _MAINS:
            locked = np.abs(rate / mains - 1.0) < _MAINS_TOLERANCE
            if np.any(locked[1:] & locked[:-1]):
                seen = mains
    speed = 2.0 * np.pi * seen / marks
    meaning = f"edges at {{:.0f}} Hz ({speed:.0f} rad/s) that do not move: the sensor sees lamps"
    return Check("mains_flicker", seen, REJECTED, meaning, "shade it or switch them off")


def check_speed(
    name: str, highest: float, expected: float | None, reach: float | None = None
) -> list[Finding]:
    """Whether the highest speed (rad/s) is one that the motor can have.

    Args:
        name: of the recording.
        highest: rad/s, settled.
        expected: rad/s that somebody expects of it, if known.
        reach: rad/s that the vehicle file gives at the highest command and voltage, if known: its thrust map
            goes on beyond the thrusts that were measured for it, so it is no more than an upper end.
    """
    if expected is not None:
        off = Check(
            "blade_count",
            abs(highest / expected - 1.0),
            above(reject=0.30),
            f"{highest:.0f} rad/s where {expected:.0f} are expected, {{:.0%}} off (limit {{:.0%}})",
            "a wrong number of blades, another propeller, or a supply that is off",
        )
        return findings_of(name, [off])
    low, high = SPEED_RANGE
    usual = f"; 7x16 motors reach {low:.0f} to {high:.0f} at full command"
    if reach is not None and REACH_MARGIN * reach > high:
        high = REACH_MARGIN * reach
        usual = f"{usual}, and by the vehicle file up to {reach:.0f} at this voltage"
    advice = "check the number of blades, or say what to expect"
    table = (
        Check(
            "speed_range", highest, above(warning=high), f"the highest speed is {{:.0f}} rad/s{usual}", advice
        ),
        Check(
            "speed_range", highest, below(warning=low), f"the highest speed is {{:.0f}} rad/s{usual}", advice
        ),
    )
    return findings_of(name, table)


def check_clock(clock: ClockFit | None) -> list[Finding]:
    """Whether the instrument's clock was compared with the host's for long enough."""
    table = (
        Check(
            "clock_unchecked",
            clock is None,
            NOTED,
            "the instrument's clock was not compared with the host's",
            "times may be off by 0.5 %",
        ),
        Check(
            "clock_short",
            None if clock is None else clock.span,
            below(note=ENOUGH),
            "clocks were compared for {:.0f} s only ({:.0f} s give 0.01 %)",
            "record longer",
        ),
    )
    return findings_of("", table)


def check_direction(fit: DirectionFit, marks: int) -> list[Finding]:
    """Findings about the steps of one direction, by the fit that was made of them."""
    a, b = fit.a.value, fit.b.value
    coarse = next((step.trace for step in fit.steps if is_low_resolution(step, a, b)), None)
    resolution = Check(
        "low_resolution",
        None if coarse is None else 1e3 * coarse.resolution,
        WARNED,
        "low resolution: averages over {:.0f} ms, more than a third of the time constant: times are within "
        "8 % at best and no claim",
        "use an instrument that stamps every edge",
    )
    repeats = Check(
        "few_steps",
        len(fit.steps),
        below(warning=FEWEST_STEPS),
        f"{{}} steps {fit.direction.value} (at least {{}} are asked for): how much repeats differ is not"
        " known",
        "the intervals rest on the residuals",
    )
    return [
        *findings_of(coarse.name if coarse else "", [resolution]),
        *(
            finding
            for index, step in enumerate(fit.steps)
            for finding in _check_step(fit, index, step, marks)
        ),
        *findings_of("", [repeats]),
    ]


def _check_step(fit: DirectionFit, index: int, step: SpeedStep, marks: int) -> list[Finding]:
    law = fit.fit
    inside = slice(step.first, step.last)
    middle = 0.5 * (step.trace.start + step.trace.end)[inside]
    speed = step.trace.speed[inside]
    before, after = float(law.before[index]), float(law.after[index])
    settled = 0.95
    done = (speed**2 - before**2) / (after**2 - before**2)
    transient = (middle > law.begins[index]) & (done < settled)
    length = (step.trace.end - step.trace.start)[inside]
    drift, sigma = _drift(law.residuals[law.step_of == index], middle, speed)
    table = (
        Check(
            "few_edges",
            float(np.sum((speed * length)[transient])) * marks / (2.0 * np.pi),
            below(warning=8.0),
            "{:.0f} edges while the speed changes (at least {:.0f})",
            "record larger steps",
        ),
        Check(
            "not_settled",
            float(np.mean(done[-max(1, done.size // 10) :])),
            below(warning=settled),
            "only {:.0%} of the thrust step was done when it ended ({:.0%} asked)",
            "hold it longer",
        ),
        Check(
            "drifting",
            abs(drift) if abs(drift) > _SIGNIFICANT * sigma else None,
            above(warning=0.01),
            "the settled speed drifts by {:.1%} a second (limit {:.0%})",
            "warm up, use a supply",
        ),
    )
    return findings_of(f"{step.trace.name}, step at {step.onset:.2f} s", table)


def _drift(residuals: FloatArray, middle: FloatArray, speed: FloatArray) -> tuple[float, float]:
    """Relative slope (1/s) of the speed in the last quarter of a step, and its uncertainty.

    The smaller one of what was measured and of what the law leaves of it: a rotor that still settles has the
    first alone, one that settles otherwise than the law (first-order thrust) the second alone.
    """
    late = middle > 0.25 * middle[0] + 0.75 * middle[-1]
    level = float(np.mean(speed[late]))
    if late.sum() < 5 or level < 0.2 * float(np.max(speed)):
        return 0.0, 0.0
    slopes = [_slope(middle[late], values[late]) for values in (speed, -residuals)]
    slope, sigma = min(slopes, key=lambda one: abs(one[0]))
    return slope / level, sigma / level


def _slope(t: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Slope of a line through the values, and its standard uncertainty."""
    t = t - t.mean()
    spread = float(np.sum(t**2))
    slope = float(t @ values) / spread
    rest = values - values.mean() - slope * t
    return slope, float(np.sqrt(rest @ rest / max(rest.size - 2, 1) / spread))


def check_directions(up: DirectionFit | None, down: DirectionFit | None, speed: float) -> list[Finding]:
    """Whether both directions are there, and the driven one is the faster.

    Args:
        up, down: fits.
        speed: rad/s at which they are compared.
    """
    if up is None or down is None:
        missing = "up" if up is None else "down"
        advice = "record steps of at least 4 % of the highest speed, 1.5 s each"
        return findings_of("", [Check("no_steps", True, WARNED, f"no step {missing} was found", advice)])
    rising, falling = up.local(speed).value, down.local(speed).value
    swapped = Check(
        "directions_swapped",
        rising / falling,
        above(warning=1.2),
        f"the motor rises more slowly ({rising:.3f} s) than it coasts down ({falling:.3f} s): up and "
        "down may be swapped",
        "check the order of the commands",
    )
    return findings_of("", [swapped])


def check_commands(steps: Sequence[SpeedStep], commands: CommandRecord) -> list[Finding]:
    """Whether the speed follows the commands: the same direction, soon after."""
    changes = np.diff(commands.commands, prepend=commands.commands[:1])
    for step in steps:
        near = np.flatnonzero((np.abs(commands.times - step.onset) < _COMMAND_REACH) & (changes != 0.0))
        if near.size and not np.any((changes[near] > 0.0) == (step.direction is Direction.UP)):
            meaning = f"the speed goes {step.direction.value} when the command goes the other way"
            advice = "up and down are swapped, or the clocks do not belong together"
            against = Check("directions_swapped", True, REJECTED, meaning, advice)
            return findings_of(f"{step.trace.name}, step at {step.onset:.2f} s", [against])
    return []


def check_heat(trace: SpeedTrace) -> list[Finding]:
    """Whether a motor ran too long near its highest speed."""
    spacing = 0.1
    speeds, _ = speeds_on_grid(trace, spacing)
    fast = speeds > HOT_SHARE * float(np.max(trace.speed))
    changes = np.flatnonzero(np.diff(np.concatenate([[False], fast, [False]]).astype(int)))
    longest = max(
        (int(stop - begin) for begin, stop in zip(changes[::2], changes[1::2], strict=True)), default=0
    )
    hot = Check(
        "hot_motor",
        longest * spacing,
        above(warning=10.0),
        f"{{:.0f}} s above {HOT_SHARE:.0%} of the highest speed (limit {{:.0f}} s)",
        "let the motor cool before the next run",
    )
    return findings_of(trace.name, [hot])
