"""Record how one motor follows steps of its command: edges on the tachometer's clock, commands, voltage."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.bench.instruments.motor_stand import MotorStand
from calibration.bench.instruments.set_points import pwm
from calibration.bench.instruments.tachometer import Tachometer, TachometerBatch
from calibration.bench.motors.clock import RESONATOR_SIGMA, ClockFit, fit_clock
from calibration.bench.motors.records import CommandRecord, EdgeRecord
from calibration.measurement import Estimate
from onboard.arrays import FloatArray

REST, LOW, MIDDLE, HIGH, FULL = 0, 77, 128, 192, 240
"""PWM steps of 255: none, 30, 50, 75 and 94 % of the voltage."""

_ROUNDS = ((MIDDLE, FULL, MIDDLE, REST), (HIGH, LOW, FULL, REST), (FULL, LOW, HIGH, REST))
"""From rest to rest; together six steps up and six down, those of the bench notes among them."""

DWELL_S = 1.5
REST_S = 3.0
"""A rotor that coasts to rest takes longer (bench notes 1.2)."""
STILL_S = 0.5
"""Of the tachometer's time without an edge: the rotor stands, or turns slower than once a second."""
_LOOK_S = 0.1

Level = int
Progress = Callable[[TachometerBatch, int, int], None]


@dataclass(frozen=True)
class MotorRecording:
    """One motor's staircase.

    Attributes:
        edges: with running counts that start again wherever edges were lost on the line.
        commands: on the tachometer's clock.
        clock: seconds of the drone's crystal in one of the tachometer's resonator.
        voltage: V at the board, of each level as (PWM step, mean).
        lost: lines that the tachometer's link lost.
        overflow: edges that the tachometer itself lost.
    """

    edges: EdgeRecord
    commands: CommandRecord
    clock: ClockFit
    voltage: tuple[tuple[int, float], ...]
    lost: int
    overflow: int


def staircase(rng: np.random.Generator, repeats: int) -> list[Level]:
    """PWM steps in random order of rounds, each repeat with every round once; begins and ends at rest."""
    levels: list[Level] = []
    for _ in range(repeats):
        for index in rng.permutation(len(_ROUNDS)):
            levels += _ROUNDS[int(index)]
    return levels


def duration(levels: Sequence[Level]) -> float:
    """s that a staircase takes."""
    return sum(REST_S if level == REST else DWELL_S for level in levels)


def record_staircase(
    stand: MotorStand, tachometer: Tachometer, motor: int, levels: Sequence[Level], progress: Progress
) -> MotorRecording:
    """Drive one motor through `levels`; the stand must be unlocked. The motor is stopped afterwards.

    Raises:
        InstrumentError, LinkError, MotorsRefused: the motors were stopped because of it.
    """
    batches: list[TachometerBatch] = []
    drone_times: list[FloatArray] = []
    drone_receipts: list[FloatArray] = []
    marks: list[tuple[float, int]] = []
    voltage: list[tuple[int, float]] = []
    tachometer.start()
    for number, level in enumerate(levels):
        stand.spin({motor: pwm(level)})
        begin = tachometer.mark(f"c{number}").time
        marks.append((begin, level))
        volts: list[FloatArray] = []
        now = begin
        while now < begin + (REST_S if level == REST else DWELL_S):
            batch = tachometer.take(_LOOK_S)
            batches.append(batch)
            now = _latest(batch, now)
            samples = stand.take(_LOOK_S)
            drone_times.append(samples.times)
            drone_receipts.append(samples.receipts)
            volts.append(samples.values["pm.vbat"])
            progress(batch, number, len(levels))
        voltage.append((level, float(np.mean(np.concatenate(volts)))))
    stand.stop("the staircase has ended")
    report = tachometer.report
    return MotorRecording(
        edges=counted(batches),
        commands=CommandRecord(
            np.array([time for time, _ in marks]), np.array([float(pwm(level)) for _, level in marks])
        ),
        clock=_clock(batches, np.concatenate(drone_times), np.concatenate(drone_receipts)),
        voltage=tuple(voltage),
        lost=report.link.lost,
        overflow=report.overflow,
    )


def wait_for_standstill(tachometer: Tachometer) -> None:
    """Return when no mark has passed for :data:`STILL_S`: nobody reaches into a rotor that coasts.

    Raises:
        InstrumentLost: the tachometer is silent, so that nobody knows.
    """
    last = now = 0.0
    while now < last + STILL_S:
        batch = tachometer.take(_LOOK_S)
        if batch.edges.size or last == 0.0:
            last = max(_latest(batch, now), last)
        now = _latest(batch, now)


def counted(batches: Sequence[TachometerBatch]) -> EdgeRecord:
    """Edges with their running count; it starts again after a loss, so that no speed spans the hole."""
    times: list[FloatArray] = []
    counts: list[np.ndarray] = []
    count = 0
    for batch in batches:
        if batch.lost_lines:
            count = 0
        times.append(batch.edges)
        counts.append(np.arange(count, count + batch.edges.size, dtype=np.int64))
        count += batch.edges.size
    return EdgeRecord(np.concatenate(times), np.concatenate(counts))


def _latest(batch: TachometerBatch, now: float) -> float:
    return max([now, *batch.beat_times[-1:], *batch.edges[-1:]])


def _clock(
    batches: Sequence[TachometerBatch], drone_times: FloatArray, drone_receipts: FloatArray
) -> ClockFit:
    """The resonator against the drone's crystal, the host's clock between them drops out.

    The crystal is as good as the host's (tens of ppm), and the comparison holds wherever the host's
    time is not that of the bench.
    """
    beats = np.concatenate([batch.beat_times for batch in batches])
    receipts = np.concatenate([batch.beat_receipts for batch in batches])
    resonator, crystal = fit_clock(beats, receipts), fit_clock(drone_times, drone_receipts)
    scale = resonator.scale.value / crystal.scale.value
    sigma = scale * float(
        np.hypot(resonator.scale.sigma / resonator.scale.value, crystal.scale.sigma / crystal.scale.value)
    )
    # A resonator is known to be right within half a per cent: a comparison that is worse adds little to that.
    weight = RESONATOR_SIGMA**2 / (RESONATOR_SIGMA**2 + sigma**2)
    scale = 1.0 + weight * (scale - 1.0)
    dof = min(resonator.scale.dof, crystal.scale.dof)
    sigma *= float(np.sqrt(weight))
    return ClockFit(Estimate(scale, "1", sigma, dof), min(resonator.span, crystal.span))
