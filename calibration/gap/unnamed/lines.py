"""Lines of constant frequency in the spectra of force and torque residuals: something that turns or swings.

The periodogram of each flight over a smooth background is exponentially distributed without a line, and the
sum over flights follows a gamma distribution, whatever the phases are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import gammaincc

from calibration.gap.data.channels import BY_NAME, ResidualChannel
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import CHANNELS, Signals
from calibration.gap.unnamed.blocks import grouped_mean
from onboard.arrays import BoolArray, FloatArray

WIDEST = 0.3
"""Hz at half of the peak: a controller's own resonance is broader."""

_LOWEST, _HIGHEST = 0.8, 0.9
"""Hz, below which manoeuvres live; share of the Nyquist frequency, above which filters do."""

_SHORTEST, _FILLED = 8.0, 0.5
"""s of flight that resolve a narrow line; share of it that must be valid."""

_PER_OCTAVE, _OCTAVES, _LEAST_WIDTH = 96, 0.5, 1.0
"""Of the running median: bins per octave, its width, and its least width in Hz."""

_LEVEL = 0.005
_APART = 0.5
"""Hz: nearer peaks belong to one line."""


@dataclass(frozen=True)
class SpectralLine:
    """A sinusoid in one channel, on all flights at one frequency.

    Attributes:
        channel: body force or torque.
        frequency: Hz.
        amplitude: in the channel's unit, root mean square over flights.
        share: of the channel's variance.
        p: chance of such a peak at any frequency of any channel.
    """

    channel: ResidualChannel
    frequency: float
    amplitude: float
    share: float
    p: float


@dataclass(frozen=True)
class _Flight:
    """One flight of one channel, ready for Fourier sums: times (s), windowed values, and the window."""

    t: FloatArray
    values: FloatArray
    window: FloatArray
    shape: str

    def transform(self, frequencies: FloatArray) -> FloatArray:
        """Fourier sums (complex) at some frequencies (Hz): a exp(i phi) of a sinusoid of amplitude a."""
        turns = np.exp(-2j * np.pi * frequencies[:, None] * self.t)
        return np.asarray(2.0 * (turns @ self.values) / self.window.sum())


def find_lines(signals: Signals, records: Sequence[FlightRecord], residual: FloatArray) -> list[SpectralLine]:
    """Lines that are beyond chance, strongest share first.

    Args:
        signals: of the flights.
        records: the flights, in the same order.
        residual: signals less everything that is explained, shape (n, 7), 0 where not valid.
    """
    searched = [index for index, name in enumerate(CHANNELS) if name != "voltage"]
    found = []
    for index in searched:
        flights = _flights(signals, records, residual[:, index], signals.valid[:, index])
        if flights:
            variance = float(np.mean(residual[signals.valid[:, index], index] ** 2))
            found += _lines(flights, BY_NAME[CHANNELS[index]], signals.dt, variance, len(searched))
    return sorted(found, key=lambda line: -line.share)


def _flights(
    signals: Signals, records: Sequence[FlightRecord], values: FloatArray, valid: BoolArray
) -> list[_Flight]:
    if not valid.any():
        return []
    means = grouped_mean(values[valid], signals.part[valid], signals.part_bounds.size - 1)
    centred = np.where(valid, values - means[signals.part], 0.0)
    found = []
    for index, record in enumerate(records):
        rows = signals.rows(index)
        known = np.flatnonzero(valid[rows])
        if known.size < max(_SHORTEST / signals.dt, 2):
            continue
        span = slice(rows.start + int(known[0]), rows.start + int(known[-1]) + 1)
        count = span.stop - span.start
        if known.size >= _FILLED * count:
            window = np.hanning(count) * valid[span]
            t = signals.dt * np.arange(span.start - rows.start, span.stop - rows.start)
            found.append(_Flight(t, centred[span] * window, window, record.shape))
    return found


def _lines(
    flights: list[_Flight], channel: ResidualChannel, dt: float, variance: float, channels: int
) -> list[SpectralLine]:
    grid, ratios, backgrounds = _spectra(flights, dt)
    longest = max(flight.t.size for flight in flights) * dt
    tests = channels * (grid[-1] - grid[0]) * longest
    p = np.minimum(tests * _chance(ratios, [flight.shape for flight in flights]), 1.0)
    mean, found = ratios.mean(axis=0), []
    left = p < _LEVEL
    while left.any():
        peak = int(np.argmax(np.where(left, mean, 0.0)))
        left &= np.abs(grid - grid[peak]) > _APART
        if _width(grid, mean, peak) < WIDEST:
            frequency = _refined(flights, backgrounds[:, peak], grid[peak], 1.0 / longest)
            amplitude = _amplitude(flights, backgrounds[:, peak], frequency)
            share = min(0.5 * amplitude**2 / variance, 1.0)
            if channel.kind == "torque":  # a mean over each interval shows less than there is
                amplitude /= float(np.sinc(frequency * dt))
            found.append(SpectralLine(channel, frequency, amplitude, share, float(p[peak])))
    return found


def _spectra(flights: list[_Flight], dt: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Frequencies (Hz); periodograms over their background, and that, shape (flights, frequencies)."""
    size = 2 ** int(np.ceil(np.log2(2 * max(flight.t.size for flight in flights))))
    grid = np.arange(size // 2 + 1) / (size * dt)
    used = (grid >= _LOWEST) & (grid <= 0.5 * _HIGHEST / dt)
    power = np.stack([np.abs(np.fft.rfft(f.values, size)) ** 2 / (f.window**2).sum() for f in flights])
    background = np.stack([_background(grid, one) for one in power])
    return grid[used], power[:, used] / background[:, used], background[:, used]


def _background(grid: FloatArray, power: FloatArray) -> FloatArray:
    """Running median over half an octave, or 1 Hz where that is more; exponential values have mean / ln 2."""
    wide = median_filter(power, max(3, round(_LEAST_WIDTH / grid[1])), mode="reflect")
    octaves = np.arange(np.log2(grid[1]), np.log2(grid[-1]), 1.0 / _PER_OCTAVE)
    sampled = np.interp(2.0**octaves, grid, power)
    smooth = median_filter(sampled, round(_OCTAVES * _PER_OCTAVE), mode="nearest")
    broad = np.interp(np.log2(np.maximum(grid, grid[1])), octaves, smooth)
    turn = _LEAST_WIDTH / (2.0 ** (0.5 * _OCTAVES) - 2.0 ** (-0.5 * _OCTAVES))
    level = np.where(grid < turn, wide, broad) / np.log(2.0)
    return np.asarray(np.maximum(level, 1e-300))


def _chance(ratios: FloatArray, shapes: list[str]) -> FloatArray:
    """Chance of such a sum of exponential variables at one frequency, shape (frequencies,).

    A manoeuvre repeats itself and makes lines too: without the shape that shows most, the sum has to stand
    out as well.
    """
    p = gammaincc(ratios.shape[0], ratios.sum(axis=0))
    kinds = sorted(set(shapes))
    if len(kinds) < 3:
        return np.asarray(p)
    member = np.array([[shape == kind for shape in shapes] for kind in kinds], dtype=float)
    per_shape = member @ ratios
    most = per_shape.argmax(axis=0)
    rest = ratios.sum(axis=0) - per_shape.max(axis=0)
    return np.maximum(p, gammaincc(ratios.shape[0] - member.sum(axis=1)[most], rest))


def _width(grid: FloatArray, mean: FloatArray, peak: int) -> float:
    """Width (Hz) of a peak at half of its height over the background."""
    low = mean < 1.0 + 0.5 * (mean[peak] - 1.0)
    before, after = np.flatnonzero(low[:peak]), np.flatnonzero(low[peak:])
    first = int(before[-1]) if before.size else 0
    last = peak + int(after[0]) if after.size else grid.size - 1
    return float(grid[last] - grid[first])


def _refined(flights: list[_Flight], background: FloatArray, near: float, width: float) -> float:
    """Frequency (Hz) at which the sum over flights is largest, within `width` of `near`."""
    for _ in range(3):
        tried = near + width * np.linspace(-1.0, 1.0, 21)
        total = sum(
            np.abs(flight.transform(tried)) ** 2 * flight.window.sum() ** 2 / (flight.window**2).sum() / level
            for flight, level in zip(flights, background, strict=True)
        )
        near, width = float(tried[np.argmax(total)]), 0.15 * width
    return near


def _amplitude(flights: list[_Flight], background: FloatArray, frequency: float) -> float:
    """Root mean square over flights of the amplitude, less what the noise adds."""
    squares = [
        float(np.abs(flight.transform(np.array([frequency]))[0]) ** 2)
        - 4.0 * level * float((flight.window**2).sum() / flight.window.sum() ** 2)
        for flight, level in zip(flights, background, strict=True)
    ]
    return float(np.sqrt(max(np.mean(squares), 0.0)))
