"""Where the pendulum fit starts: principal axis, strongest line, damped sine."""

import math
from dataclasses import dataclass

import numpy as np

from calibration.bench.inertia.errors import UnusableSwingError
from calibration.bench.inertia.swing import Swing
from onboard.arrays import FloatArray

LOWEST_HZ = 0.15
HIGHEST_HZ = 5.0
_SPECTRUM_SAMPLES = 800  # or up to twice as many, for the search of the line
_PER_RECIPROCAL = 5.0  # frequencies searched per reciprocal of the span


@dataclass(frozen=True, slots=True)
class PrincipalAxis:
    """The axis about which a recording turns.

    Attributes:
        direction: unit vector, body frame; its largest component is positive.
        rate: rad/s, (n,), the gyro along it without its mean.
        cross: second singular value over the first: how much turns about other axes.
    """

    direction: FloatArray
    rate: FloatArray
    cross: float


@dataclass(frozen=True, slots=True)
class DampedSine:
    """``rate = e^(-decay t) (cosine cos wt + sine sin wt) + offset``; 1/s and rad/s.

    Attributes:
        frequency: Hz.
    """

    frequency: float
    decay: float
    cosine: float
    sine: float
    offset: float

    @property
    def amplitude(self) -> float:
        """At the start, rad/s."""
        return math.hypot(self.cosine, self.sine)

    def rate(self, time: FloatArray) -> FloatArray:
        """rad/s at `time` (s)."""
        turn = math.tau * self.frequency * time
        wave = self.cosine * np.cos(turn) + self.sine * np.sin(turn)
        return np.asarray(np.exp(-self.decay * time) * wave + self.offset)


def principal_axis(swing: Swing) -> PrincipalAxis:
    """The direction in which the gyro varies most (first principal component).

    Raises:
        UnusableSwingError: the gyro does not vary.
    """
    centred = swing.gyro - swing.gyro.mean(axis=0)
    scatter = centred.T @ centred
    values, vectors = np.linalg.eigh(scatter)
    if not values[2] > 0.0:
        raise UnusableSwingError(f"{swing.source}: the gyro does not change; is the log block running?")
    direction = vectors[:, 2] * np.sign(vectors[np.argmax(np.abs(vectors[:, 2])), 2])
    return PrincipalAxis(
        direction, centred @ direction, math.sqrt(max(float(values[1]), 0.0) / float(values[2]))
    )


def strongest_line(time: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Frequency (Hz) and amplitude of the strongest line (Lomb-Scargle, for any spacing of `time`).

    Searched from :data:`LOWEST_HZ`, or one and a half cycles, to :data:`HIGHEST_HZ` or what the spacing
    resolves; five frequencies per reciprocal of the span, then the parabola through the top. At every
    frequency cosine and sine are fitted by least squares, which is Lomb's periodogram (Lomb 1976).
    """
    span = float(time[-1] - time[0])
    t, y = _thinned(time, values)
    low = max(LOWEST_HZ, 1.5 / span)
    high = min(HIGHEST_HZ, 0.4 / float(np.median(np.diff(t))))
    if high <= low or not np.any(y):
        return low, 0.0
    grid = np.linspace(low, high, max(8, math.ceil(_PER_RECIPROCAL * span * (high - low))))
    turns = np.empty((len(grid), len(t)), dtype=np.complex128)
    turns[0] = np.exp(1j * math.tau * grid[0] * (t - t[0]))
    turns[1:] = np.exp(1j * math.tau * (grid[1] - grid[0]) * (t - t[0]))
    wave = np.multiply.accumulate(turns, axis=0)  # far quicker than as many exponentials
    product = wave @ y
    double = np.sum(wave**2, axis=1)
    cc, ss, cs = 0.5 * (len(t) + double.real), 0.5 * (len(t) - double.real), 0.5 * double.imag
    determinant = np.maximum(cc * ss - cs**2, 1e-12 * len(t) ** 2)
    yc, ys = product.real, product.imag
    power = (ss * yc**2 - 2.0 * cs * yc * ys + cc * ys**2) / determinant
    k = int(np.clip(np.argmax(power), 1, len(grid) - 2))
    below, top, above = power[k - 1 : k + 2]
    bend = below - 2.0 * top + above
    shift = float(np.clip(0.5 * (below - above) / bend, -0.5, 0.5)) if bend < 0.0 else 0.0
    frequency = float(grid[k] + shift * (grid[1] - grid[0]))
    return frequency, math.sqrt(max(2.0 * float(top), 0.0) / len(t))


def _thinned(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Means of groups of neighbours, at most so many that the search stays quick; without the mean."""
    size = max(1, len(time) // _SPECTRUM_SAMPLES)
    groups = len(time) // size
    t = time[: groups * size].reshape(groups, size).mean(axis=1)
    y = values[: groups * size].reshape(groups, size).mean(axis=1)
    return t, y - y.mean()


def damped_sine(time: FloatArray, values: FloatArray, frequency: float) -> DampedSine:
    """Least squares from `frequency` (Hz); amplitudes are linear: only frequency and decay are searched."""
    from scipy.optimize import least_squares

    span = float(time[-1])

    def parts(p: FloatArray) -> tuple[FloatArray, FloatArray]:
        turn = math.tau * p[0] * time
        fade = np.exp(-p[1] * time)
        columns = np.column_stack([fade * np.cos(turn), fade * np.sin(turn), np.ones_like(time)])
        return columns, np.linalg.lstsq(columns, values, rcond=None)[0]

    def residual(p: FloatArray) -> FloatArray:
        columns, weights = parts(p)
        return np.asarray(columns @ weights - values)

    reach = 0.7 / span
    found = least_squares(
        residual,
        [frequency, 0.2 / span],
        bounds=([frequency - reach, -3.0 / span], [frequency + reach, 40.0 / span]),
        x_scale=[1.0 / span, 1.0 / span],
        max_nfev=40,
    )
    weights = parts(found.x)[1]
    return DampedSine(float(found.x[0]), float(found.x[1]), *(float(w) for w in weights))
