"""What can be wrong with one recording: thresholds, and the words for them (limits of the bench notes)."""

import math
from collections.abc import Iterator

import numpy as np

from calibration.bench.inertia.swing import Swing
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.measurement import Finding, Severity
from onboard.arrays import BoolArray, FloatArray

CYCLES_REJECT, CYCLES_WARN = 8.0, 15.0
AMPLITUDE_REJECT, AMPLITUDE_WARN = math.radians(2.0), math.radians(20.0)
GAP_WARN = 0.25  # of a period
LOSS_WARN, LOSS_REJECT = 0.05, 0.20
GYRO_FULL_SCALE = math.radians(2000.0)
FULL_SCALE_MARGIN = 0.02
EQUAL_EXTREMES = 3
SWING_WARN, SWING_REJECT = 0.03, 0.10
CROSS_WARN = 0.15
OFF_AXIS_REJECT = math.radians(10.0)
DAMPING_LOW, DAMPING_HIGH = 0.0005, 0.03
ESTIMATORS_WARN = 0.003
RESIDUAL_WARN = 0.05
BEATING_NEAR = 0.15  # of the torsion's frequency: a second one this near cannot be told from it by eye
BEATING_WARN = 0.05  # rise of the smoothed amplitude, as a share of the largest
_BEATING_SIGMAS = 4.0
_NOISE_SIGMAS = 3.0


def check_fit(swing: Swing, fit: SwingFit) -> list[Finding]:
    """All findings of one recording, in the order of the checks."""
    return [
        Finding(code, severity, f"{swing.source}: {text}")
        for check in (_length, _amplitude, _sampling, _clipping, _other_motion, _axis, _damping, _agreement)
        for code, severity, text in check(swing, fit)
    ]


_Found = Iterator[tuple[str, Severity, str]]


def _length(swing: Swing, fit: SwingFit) -> _Found:
    if fit.cycles < CYCLES_REJECT:
        text = f"{fit.cycles:.1f} cycles, at least {CYCLES_REJECT:g} needed; record 20 or more"
        yield "few_cycles", Severity.REJECT, text
    elif fit.cycles < CYCLES_WARN:
        text = f"{fit.cycles:.1f} cycles, better {CYCLES_WARN:g} or more; record 20"
        yield "few_cycles", Severity.WARNING, text


def _amplitude(swing: Swing, fit: SwingFit) -> _Found:
    degrees = math.degrees(fit.start_amplitude)
    if fit.start_amplitude > AMPLITUDE_WARN:
        text = (
            f"starts at {degrees:.1f} deg, better below {math.degrees(AMPLITUDE_WARN):.0f}; twist by 5 to 12"
        )
        yield "large_amplitude", Severity.WARNING, text
    if fit.start_amplitude < AMPLITUDE_REJECT:
        least = math.degrees(AMPLITUDE_REJECT)
        text = f"starts at {degrees:.2f} deg, at least {least:.0f} needed; twist by 5 to 12"
        yield "small_amplitude", Severity.REJECT, text
    nearness = abs(fit.swing_frequency * fit.period.value - 1.0)
    if fit.second_mode and nearness < BEATING_NEAR:
        text = (
            f"two motions beat: {1.0 / fit.period.value:.3f} and {fit.swing_frequency:.3f} Hz, "
            f"{nearness:.0%} apart (limit {BEATING_NEAR:.0%}); choose another string distance"
        )
        yield "beating", Severity.WARNING, text
        return
    amplitude, sigma = fit.envelope.amplitude, fit.envelope.sigma
    if len(amplitude) < 5:
        return
    smooth = np.convolve(amplitude, np.full(3, 1.0 / 3.0), mode="valid")
    rise = smooth - np.minimum.accumulate(smooth)
    worst = int(np.argmax(rise))
    noise = _BEATING_SIGMAS * float(np.median(sigma)) / math.sqrt(3.0)
    if rise[worst] > max(BEATING_WARN * float(np.max(smooth)), noise):
        share = rise[worst] / float(np.max(smooth))
        text = (
            f"the amplitude grows by {share:.0%} until {fit.envelope.time[worst + 1]:.1f} s (limit "
            f"{BEATING_WARN:.0%}): it was touched, or two motions beat; damp the swing, release again"
        )
        yield "beating", Severity.WARNING, text


def _sampling(swing: Swing, fit: SwingFit) -> _Found:
    if fit.clock == "host":
        text = "stamped by the host on arrival (3 to 10 ms of jitter); log the drone's own time"
        yield "host_time", Severity.WARNING, text
    if fit.largest_gap > GAP_WARN * fit.period.value:
        text = (
            f"a gap of {fit.largest_gap:.2f} s, {fit.largest_gap / fit.period.value:.2f} of a period (limit "
            f"{GAP_WARN:g}); bring the radio nearer"
        )
        yield "gap", Severity.WARNING, text
    if fit.loss is not None and fit.loss > LOSS_WARN:
        severity = Severity.REJECT if fit.loss > LOSS_REJECT else Severity.WARNING
        limits = f"limits {LOSS_WARN:.0%}, {LOSS_REJECT:.0%}"
        text = f"{fit.loss:.1%} of the samples lost ({limits}); bring the radio nearer"
        yield "loss", severity, text


def _clipping(swing: Swing, fit: SwingFit) -> _Found:
    channel = int(np.argmax(np.abs(fit.axis)))
    values = swing.gyro[:, channel]
    largest = float(np.max(np.abs(values)))
    if largest >= (1.0 - FULL_SCALE_MARGIN) * GYRO_FULL_SCALE:
        text = (
            f"the gyro reached {largest:.1f} rad/s, within {FULL_SCALE_MARGIN:.0%} of its range "
            f"({GYRO_FULL_SCALE:.1f}); twist less"
        )
        yield "clipping", Severity.REJECT, text
        return
    for extreme in (float(np.max(values)), float(np.min(values))):
        samples, seconds = _longest_run(swing.time, values == extreme)
        if samples >= EQUAL_EXTREMES and seconds > _flat_top(values, fit):
            text = (
                f"{samples} equal samples at the extreme {extreme:.3f} rad/s (limit {EQUAL_EXTREMES}): "
                "the values are clipped; check scale and type of the log variables"
            )
            yield "clipping", Severity.REJECT, text
            return


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


def _other_motion(swing: Swing, fit: SwingFit) -> _Found:
    if fit.swing_share > SWING_WARN:
        severity = Severity.REJECT if fit.swing_share > SWING_REJECT else Severity.WARNING
        yield (
            "swing",
            severity,
            f"still swinging: a second motion of {fit.swing_share:.1%} at {fit.swing_frequency:.2f} Hz "
            f"(limits {SWING_WARN:.0%}, {SWING_REJECT:.0%}); damp it with a finger at the suspension",
        )
    if fit.cross > CROSS_WARN:
        text = f"other axes turn by {fit.cross:.2f} of the main one (limit {CROSS_WARN:g}); let it settle"
        yield "cross_axis", Severity.WARNING, text


def _axis(swing: Swing, fit: SwingFit) -> _Found:
    if fit.off_axis is not None and fit.off_axis > OFF_AXIS_REJECT:
        seen = ", ".join(f"{part:.2f}" for part in fit.axis)
        text = (
            f"it turns about ({seen}), {math.degrees(fit.off_axis):.0f} deg from the axis that was named "
            f"(limit {math.degrees(OFF_AXIS_REJECT):.0f}); hang the other axis or name this one"
        )
        yield "wrong_axis", Severity.REJECT, text


def _damping(swing: Swing, fit: SwingFit) -> _Found:
    if fit.damping_ratio > DAMPING_HIGH:
        text = f"damping {fit.damping_ratio:.3f} (limit {DAMPING_HIGH:g}): it touches something, or a draught"
        yield "damping_high", Severity.WARNING, text
    if fit.damping_ratio < DAMPING_LOW:
        text = (
            f"damping {fit.damping_ratio:.5f} (at least {DAMPING_LOW:g} in any room): frozen or replayed "
            "data? Check that the log is live"
        )
        yield "damping_low", Severity.WARNING, text


def _agreement(swing: Swing, fit: SwingFit) -> _Found:
    if fit.residual_share > RESIDUAL_WARN:
        limit = f"limit {RESIDUAL_WARN:.0%}"
        text = f"the fit leaves {fit.residual_share:.1%} of the amplitude ({limit}); look at the plot"
        yield "residual", Severity.WARNING, text
    if fit.crossing_period is None:
        return
    difference = abs(fit.crossing_period / fit.period.value - 1.0)
    if difference > ESTIMATORS_WARN:
        text = (
            f"zero crossings give {fit.crossing_period:.4f} s, the fit {fit.period.value:.4f} s: "
            f"{difference:.2%} apart (limit {ESTIMATORS_WARN:.1%}); record again"
        )
        yield "estimators_disagree", Severity.WARNING, text
