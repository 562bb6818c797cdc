"""From one recording to the period at zero amplitude, with everything the checks and the report need."""

import math
from dataclasses import replace

import numpy as np

from calibration.bench.inertia.checks import check_fit
from calibration.bench.inertia.crossings import crossing_period, crossing_times
from calibration.bench.inertia.envelope import Envelope, local_amplitude
from calibration.bench.inertia.errors import UnusableSwingError
from calibration.bench.inertia.nls import LeastSquaresFit, add_second_mode, fit_law
from calibration.bench.inertia.start import (
    DampedSine,
    PrincipalAxis,
    damped_sine,
    principal_axis,
    strongest_line,
)
from calibration.bench.inertia.swing import Swing, in_order
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.measurement import Estimate
from onboard.arrays import FloatArray, Vector

SECOND_MODE_LINE = 0.03
"""Share of the main amplitude from which a line in the residual asks for a second mode."""

_FEWEST_SAMPLES = 40
_FEWEST_CYCLES = 2.5
_LONGEST_S = 300.0  # twenty cycles take at most 70 s
_RATES = (1e-3, 1e3)  # rad/s, largest of a recording: below is noise, above is no gyro


def fit_swing(swing: Swing) -> SwingFit:
    """Fit one recording and check it.

    The pendulum law is fitted to the rate about the principal axis; a second, free damped sine is added when
    the residual has a line above :data:`SECOND_MODE_LINE` and BIC prefers it.

    Raises:
        UnusableSwingError: too few samples or cycles for any fit, or nothing that turns.
    """
    ordered, findings = in_order(swing)
    axis, time, sine = _start(ordered)
    single = fit_law(time, axis.rate, sine)
    span = float(time[-1])
    if not (single.pendulum.cycles(span) >= _FEWEST_CYCLES and single.pendulum.amplitude(time[-1:])[0] > 0.0):
        raise UnusableSwingError(
            f"{swing.source}: no pendulum swing of {_FEWEST_CYCLES:g} cycles or more in {span:.1f} s; "
            "release the drone 5 to 12 deg off and record 20 cycles"
        )
    law = _with_second_mode(time, axis.rate, single)
    fit = _describe(ordered, axis, time, sine, law)
    return replace(fit, findings=(*findings, *check_fit(ordered, fit)))


def _start(swing: Swing) -> tuple[PrincipalAxis, FloatArray, DampedSine]:
    """Axis, time from the first sample, and the damped sine to start from."""
    if len(swing) < _FEWEST_SAMPLES:
        raise UnusableSwingError(
            f"{swing.source}: {len(swing)} samples, at least {_FEWEST_SAMPLES} needed; record 20 cycles"
        )
    time = swing.time - swing.time[0]
    if time[-1] > _LONGEST_S:
        raise UnusableSwingError(
            f"{swing.source}: {time[-1]:.0f} s, at most {_LONGEST_S:.0f}; cut or record it again"
        )
    largest = float(np.max(np.abs(swing.gyro - swing.gyro[0])))
    if not _RATES[0] <= largest <= _RATES[1]:
        raise UnusableSwingError(
            f"{swing.source}: rates within {largest:.3g} rad/s are no swing; check the log"
        )
    axis = principal_axis(swing)
    frequency, amplitude = strongest_line(time, axis.rate)
    if not amplitude > 0.0:
        raise UnusableSwingError(
            f"{swing.source}: no oscillation in {time[-1]:.2f} s at this sampling; record 20 cycles at 100 Hz"
        )
    return axis, time, damped_sine(time, axis.rate, frequency)


def _with_second_mode(time: FloatArray, rate: FloatArray, single: LeastSquaresFit) -> LeastSquaresFit:
    if _line(time, single)[1] <= SECOND_MODE_LINE:
        return single
    double = add_second_mode(time, rate, single)
    return double if double.bic < single.bic else single


def _line(time: FloatArray, law: LeastSquaresFit) -> tuple[float, float]:
    """Frequency (Hz) of the strongest other line, and its amplitude as a share of the torsion's.

    At the release where the second mode was fitted, on average where it was not.
    """
    if law.second is not None:
        release = law.pendulum.omega * float(law.pendulum.amplitude(time[:1])[0])
        return law.second.frequency, law.second.amplitude / release
    torsion = math.sqrt(2.0) * float(np.sqrt(np.mean(law.pendulum.rate(time) ** 2)))
    frequency, amplitude = strongest_line(time, law.residual)
    return frequency, amplitude / torsion


def _describe(
    swing: Swing, axis: PrincipalAxis, time: FloatArray, sine: DampedSine, law: LeastSquaresFit
) -> SwingFit:
    """The fit in figures, without its findings."""
    span = float(time[-1])
    period = math.tau / law.pendulum.omega
    torsion = axis.rate - law.offset
    if law.second is not None:
        torsion = torsion - law.second.rate(time)
    envelope = local_amplitude(time, torsion, period)
    ends = law.pendulum.amplitude(np.array([0.0, span]))
    frequency, share = _line(time, law)
    size = math.sqrt(2.0) * float(np.sqrt(np.mean(law.pendulum.rate(time) ** 2)))
    return SwingFit(
        source=swing.source,
        clock=swing.clock,
        axis=(float(axis.direction[0]), float(axis.direction[1]), float(axis.direction[2])),
        off_axis=None if swing.axis is None else angle_between(axis.direction, swing.axis),
        cross=axis.cross,
        period=Estimate(period, "s", law.period_sigma, dof=len(time) - 6.0),
        crossing_period=_crossings(time, torsion, envelope, period),
        sine_period=1.0 / sine.frequency,
        start_amplitude=float(ends[0]),
        end_amplitude=float(ends[1]),
        cycles=law.pendulum.cycles(span),
        largest_gap=float(np.max(np.diff(time))),
        loss=lost_share(time) if swing.clock == "drone" else None,
        damping_ratio=law.pendulum.damping_ratio(span),
        swing_share=share,
        swing_frequency=frequency,
        second_mode=law.second is not None,
        residual_share=float(np.sqrt(np.mean(law.residual**2))) / size,
        mean_square_amplitude=_mean_square_amplitude(law.pendulum.amplitude(time), time),
        time=time,
        rate=axis.rate,
        fitted=axis.rate - law.residual,
        envelope=envelope,
    )


def _crossings(time: FloatArray, torsion: FloatArray, envelope: Envelope, period: float) -> float | None:
    """s: the period from zero crossings, taken to zero amplitude by the series of the pendulum."""
    if not len(envelope.time):
        return None
    mean = crossing_period(crossing_times(time, torsion, envelope.at(time), period), period)
    if mean is None:
        return None
    angle = envelope.amplitude * period / math.tau
    return mean / float(np.mean(1.0 + angle**2 / 16.0 + 11.0 * angle**4 / 3072.0))


def _mean_square_amplitude(amplitude: FloatArray, time: FloatArray) -> float:
    """rad2: slope of the integral of A^2, fitted over time as the phase is, with weights A^2."""
    gathered = np.concatenate(
        [[0.0], np.cumsum(0.5 * (amplitude[1:] ** 2 + amplitude[:-1] ** 2) * np.diff(time))]
    )
    return float(np.polyfit(time, gathered, 1, w=amplitude)[0])


def lost_share(time: FloatArray) -> float:
    """Share of samples missing from a regular log whose usual spacing its shorter steps show."""
    steps = np.diff(time)
    short = float(np.quantile(steps, 0.2))
    usual = float(np.mean(steps[(steps > 0.5 * short) & (steps < 1.5 * short)]))
    return max(0.0, 1.0 - len(time) / (round(float(time[-1] - time[0]) / usual) + 1))


def angle_between(first: FloatArray, second: Vector) -> float:
    """rad between two axes, whichever way they point."""
    other = np.asarray(second, dtype=np.float64)
    cosine = abs(float(first @ other)) / float(np.linalg.norm(first) * np.linalg.norm(other))
    return math.acos(min(cosine, 1.0))
