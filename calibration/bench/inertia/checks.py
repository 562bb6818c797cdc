"""What can be wrong with a swing, with several of them, and with the inertia that they give (bench notes)."""

import math
from collections.abc import Sequence

import numpy as np

from calibration.bench.check_table import REJECTED, WARNED, Check, above, below, findings_of
from calibration.bench.inertia.swing import Swing
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.measurement import Finding
from onboard.arrays import BoolArray, FloatArray

AMPLITUDE_LEAST, AMPLITUDE_MOST = math.radians(2.0), math.radians(20.0)
GYRO_FULL_SCALE = math.radians(2000.0)
FULL_SCALE_MARGIN = 0.02
EQUAL_EXTREMES = 3
BEATING_NEAR = 0.15  # of the torsion's frequency: a second one this near cannot be told from it by eye
BEATING_RISE = 0.05  # rise of the smoothed amplitude, as a share of the largest
_BEATING_SIGMAS = 4.0
_NOISE_SIGMAS = 3.0
GYRATION = (12.0, 60.0)  # mm, of a small drone
PRESET_RATIO = 2.0


def check_fit(swing: Swing, fit: SwingFit) -> list[Finding]:
    """All findings of one recording."""
    start, period = math.degrees(fit.start_amplitude), fit.period.value
    crossing = fit.crossing_period
    apart = None if crossing is None else abs(crossing / period - 1.0)
    off_axis = None if fit.off_axis is None else math.degrees(fit.off_axis)
    table = (
        Check(
            "few_cycles",
            fit.cycles,
            below(reject=8.0, warning=15.0),
            "{:.1f} cycles (at least {:g})",
            "record 20 or more",
        ),
        Check(
            "large_amplitude",
            start,
            above(warning=math.degrees(AMPLITUDE_MOST)),
            "starts at {:.1f} deg (limit {:.0f})",
            "twist by 5 to 12",
        ),
        Check(
            "small_amplitude",
            start,
            below(reject=math.degrees(AMPLITUDE_LEAST)),
            "starts at {:.2f} deg (at least {:.0f})",
            "twist by 5 to 12",
        ),
        _beating(fit),
        Check(
            "host_time",
            fit.clock == "host",
            WARNED,
            "stamped by the host on arrival (3 to 10 ms of jitter)",
            "log the drone's own time",
        ),
        Check(
            "gap",
            fit.largest_gap / period,
            above(warning=0.25),
            "a gap of {:.2f} of a period (limit {:g})",
            "bring the radio nearer",
        ),
        Check(
            "loss",
            fit.loss,
            above(reject=0.20, warning=0.05),
            "{:.1%} of the samples lost (limit {:.0%})",
            "bring the radio nearer",
        ),
        _clipping(swing, fit),
        Check(
            "swing",
            fit.swing_share,
            above(reject=0.10, warning=0.03),
            f"still swinging: a second motion at {fit.swing_frequency:.2f} Hz of {{:.1%}} (limit {{:.0%}})",
            "damp it with a finger at the suspension",
        ),
        Check(
            "cross_axis",
            fit.cross,
            above(warning=0.15),
            "other axes turn by {:.2f} of the main one (limit {:g})",
            "let it settle",
        ),
        Check(
            "wrong_axis",
            off_axis,
            above(reject=10.0),
            f"it turns about ({', '.join(f'{part:.2f}' for part in fit.axis)}), "
            "{:.0f} deg from the axis that was named (limit {:.0f})",
            "hang the other axis or name this one",
        ),
        Check(
            "damping_high",
            fit.damping_ratio,
            above(warning=0.03),
            "damping {:.3f} (limit {:g})",
            "it touches something, or a draught: move it",
        ),
        Check(
            "damping_low",
            fit.damping_ratio,
            below(warning=0.0005),
            "damping {:.5f} (at least {:g} in any room)",
            "frozen or replayed data? Check that the log is live",
        ),
        Check(
            "residual",
            fit.residual_share,
            above(warning=0.05),
            "the fit leaves {:.1%} of the amplitude (limit {:.0%})",
            "look at the plot",
        ),
        Check(
            "estimators_disagree",
            apart,
            above(warning=0.003),
            "zero crossings and the fit give periods that are {:.2%} apart (limit {:.1%})",
            "record again",
        ),
    )
    return findings_of(swing.source, table)


def _beating(fit: SwingFit) -> Check:
    """Two motions that beat: seen as a second line, or as an amplitude that grows."""
    nearness = abs(fit.swing_frequency * fit.period.value - 1.0)
    if fit.second_mode and nearness < BEATING_NEAR:
        return Check(
            "beating",
            nearness,
            below(warning=BEATING_NEAR),
            f"two motions beat: {1.0 / fit.period.value:.3f} and {fit.swing_frequency:.3f} Hz, "
            "{:.0%} apart (limit {:.0%})",
            "choose another string distance",
        )
    amplitude, sigma = fit.envelope.amplitude, fit.envelope.sigma
    rise, limit = 0.0, BEATING_RISE
    if len(amplitude) >= 5:
        smooth = np.convolve(amplitude, np.full(3, 1.0 / 3.0), mode="valid")
        largest = float(np.max(smooth))
        noise = _BEATING_SIGMAS * float(np.median(sigma)) / math.sqrt(3.0)
        rise = float(np.max(smooth - np.minimum.accumulate(smooth))) / largest
        limit = max(limit, noise / largest)
    return Check(
        "beating",
        rise,
        above(warning=limit),
        "the amplitude grows by {:.0%} (limit {:.0%}): it was touched, or two motions beat",
        "damp the swing, release again",
    )


def _clipping(swing: Swing, fit: SwingFit) -> Check:
    """Values at the end of the gyro's range, or a top that is flatter than a wave's."""
    values = swing.gyro[:, int(np.argmax(np.abs(fit.axis)))]
    largest = float(np.max(np.abs(values)))
    full = (1.0 - FULL_SCALE_MARGIN) * GYRO_FULL_SCALE
    if largest >= full:
        meaning = f"the gyro reached {largest:.1f} rad/s of its range of {GYRO_FULL_SCALE:.1f}"
        return Check("clipping", True, REJECTED, meaning, "twist less")
    longest = 0
    for extreme in (float(np.max(values)), float(np.min(values))):
        samples, seconds = _longest_run(swing.time, values == extreme)
        if seconds > _flat_top(values, fit):
            longest = max(longest, samples)
    return Check(
        "clipping",
        longest,
        above(reject=EQUAL_EXTREMES - 1),
        "{} equal samples at the extreme (limit {}): the values are clipped",
        "check scale and type of the log variables",
    )


def _longest_run(time: FloatArray, chosen: BoolArray) -> tuple[int, float]:
    """Number of samples and seconds of the longest run of `chosen`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(np.int8), [0]])))
    first, last = edges[0::2], edges[1::2] - 1
    if not first.size:
        return 0, 0.0
    k = int(np.argmax(last - first))
    return int(last[k] - first[k] + 1), float(time[last[k]] - time[first[k]])


def _flat_top(values: FloatArray, fit: SwingFit) -> float:
    """s for which the top of the wave stays within what resolution and noise of `values` tell apart."""
    levels = np.unique(values)
    resolution = float(np.min(np.diff(levels))) if len(levels) > 1 else 0.0
    bend = np.abs(np.diff(values, 2))
    noise = float(np.median(bend)) / (0.6745 * math.sqrt(6.0))  # of a normal: neighbours but for the noise
    largest = max(fit.start_amplitude * math.tau / fit.period.value, 1e-12)
    indistinct = resolution + _NOISE_SIGMAS * noise
    return 2.0 * math.sqrt(2.0 * indistinct / largest) * fit.period.value / math.tau


def check_trials(fits: Sequence[SwingFit], spread: float, fewest: int) -> list[Finding]:
    """Number of trials, their spread (relative), and whether rejected ones count."""
    rejected = [fit.source for fit in fits if fit.rejected]
    table = (
        Check(
            "few_trials",
            len(fits),
            below(warning=fewest),
            "{} trial(s), {} needed for a 95 % interval: none is claimed",
            "record more",
        ),
        Check(
            "spread",
            spread,
            above(warning=0.003),
            "the trials' periods differ by {:.2%} (standard deviation, limit {:.1%})",
            "look for loose strings or a draught, and hang the drone again",
        ),
        Check(
            "rejected_counts",
            len(rejected),
            WARNED,
            "{} rejected trial(s) count because the operator said so",
            ", ".join(rejected),
        ),
    )
    return findings_of("", table)


def check_inertia(inertia: float, mass: float, expected: float | None) -> list[Finding]:
    """Radius of gyration for `mass` (kg), and the ratio to what was `expected` (kg m2)."""
    gyration = 1e3 * math.sqrt(inertia / mass)
    usual = f"({GYRATION[0]:.0f} to {GYRATION[1]:.0f} is usual)"
    radius = f"{inertia:.3g} kg m2 of {1e3 * mass:.1f} g is a radius of gyration of {{:.1f}} mm {usual}"
    ratio = None if expected is None else inertia / expected
    preset = f"{inertia:.3g} kg m2 is {{:.2f}} of what was expected (limit a factor of {PRESET_RATIO:g})"
    table = (
        Check("gyration", gyration, above(warning=GYRATION[1]), radius, "check lengths, mass and units"),
        Check("gyration", gyration, below(warning=GYRATION[0]), radius, "check lengths, mass and units"),
        Check("preset", ratio, above(warning=PRESET_RATIO), preset, "right axis, right preset, right units?"),
        Check(
            "preset",
            ratio,
            below(warning=1.0 / PRESET_RATIO),
            preset,
            "right axis, right preset, right units?",
        ),
    )
    return findings_of("", table)
