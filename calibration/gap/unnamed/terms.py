"""Terms without a name: a force where the vehicle is in some range, a polynomial, a curve, a sinusoid.

They stand beside the named effects in the regression, as columns of the signals, so that no name is taken for
something that a plain range or a line explains better.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from calibration.gap.data.channels import ResidualChannel
from calibration.gap.data.signals import CHANNELS as SIGNALS
from calibration.gap.data.signals import FORCE, Signals
from calibration.gap.estimate.refine import UnnamedTerm
from calibration.gap.unnamed.regressors import Regressor
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class IntervalTerm(UnnamedTerm):
    """A constant while a regressor is between `low` and `high` (None: open); one column."""

    quantity: Regressor
    low: float | None
    high: float | None

    def formula(self, values: FloatArray, vehicle: Vehicle) -> str:
        """As "0.21 N along world y where 0.31 m < x < 1.02 m"."""
        where = self.quantity.condition(self.low, self.high)
        return f"{_number(values[0] * _scale(self.channel, vehicle))} {_unit(self.channel)} where {where}"


@dataclass(frozen=True, eq=False)
class PolynomialTerm(UnnamedTerm):
    """Powers 1, 2 ... of a regressor about `centre`; one column each, times the power of the unit."""

    quantity: Regressor
    centre: float

    def formula(self, values: FloatArray, vehicle: Vehicle) -> str:
        """As "-0.012 u N along body x, u = forward speed in m/s"."""
        scale = _scale(self.channel, vehicle)
        powers = ["u", *(f"u^{power}" for power in range(2, len(values) + 1))]
        summed = " + ".join(f"{_number(v * scale)} {u}" for v, u in zip(values, powers, strict=True))
        unit = f" in {self.quantity.unit}" if self.quantity.unit else ""
        about = f" less {self.centre:.3g}" if self.centre else ""
        return f"({summed}) {_unit(self.channel)}, u = {self.quantity.symbol}{about}{unit}"


@dataclass(frozen=True, eq=False)
class CurveTerm(UnnamedTerm):
    """Straight between `knots` of a regressor, shape (k,), and constant beyond; 0 at that of index `zero`.
    A column for the value at each of the others.

    A level of its own would be a scale of thrust or a bias by another name.
    """

    quantity: Regressor
    knots: FloatArray
    zero: int

    def at_knots(self, values: FloatArray) -> FloatArray:
        """Values at all knots, shape (k, ...), from those of the columns, shape (k - 1, ...)."""
        return np.insert(values, self.zero, 0.0, axis=0)

    def formula(self, values: FloatArray, vehicle: Vehicle) -> str:
        """As "0.01 to 0.21 N along world y, a curve of y (largest at 0.31 m)"."""
        forces = self.at_knots(values) * _scale(self.channel, vehicle)
        low, high = forces.min(), forces.max()
        at = self.knots[np.argmax(np.abs(forces))]
        where = f"a curve of {self.quantity.symbol} (largest at {at:.3g} {self.quantity.unit}".rstrip()
        return f"{_number(low)} to {_number(high)} {_unit(self.channel)}, {where})"


@dataclass(frozen=True, eq=False)
class LineTerm(UnnamedTerm):
    """A sinusoid of `frequency` (Hz), with a phase and an amplitude of its own in each flight.

    The columns are a sine and a cosine per flight, in the order of the flights.
    """

    frequency: float

    def formula(self, values: FloatArray, vehicle: Vehicle) -> str:
        """As "4.7e-05 N m about body x at 5.02 Hz": root mean square of the flights' amplitudes."""
        squares = np.square(values).reshape(-1, 2).sum(axis=1)
        amplitude = float(np.sqrt(squares.mean())) * _scale(self.channel, vehicle)
        return f"{_number(amplitude)} {_unit(self.channel)} at {self.frequency:.3g} Hz"


def interval_term(
    channel: ResidualChannel, quantity: Regressor, ends: tuple[float | None, float | None], turns: FloatArray
) -> IntervalTerm:
    """A term that acts inside an interval.

    Args:
        channel: where.
        quantity: along the flights.
        ends: low and high end; None: open.
        turns: body to world, shape (n, 3, 3).
    """
    column = as_signals(channel, inside(quantity.values, *ends), turns)
    return IntervalTerm(channel, quantity.name, (column,), quantity, *ends)


def polynomial_term(
    channel: ResidualChannel, quantity: Regressor, centre: float, degree: int, turns: FloatArray
) -> PolynomialTerm:
    """A term with the powers 1 .. `degree` of a regressor about `centre`."""
    shapes = powers(quantity.values, centre, degree)
    columns = tuple(as_signals(channel, shape, turns) for shape in shapes.T)
    return PolynomialTerm(channel, quantity.name, columns, quantity, centre)


def curve_term(
    channel: ResidualChannel, quantity: Regressor, knots: FloatArray, zero: int, turns: FloatArray
) -> CurveTerm:
    """A curve through values at `knots` of a regressor, and 0 at that of index `zero`."""
    shapes = np.delete(hats(quantity.values, knots).T, zero, axis=0)
    columns = tuple(as_signals(channel, shape, turns) for shape in shapes)
    return CurveTerm(channel, quantity.name, columns, quantity, knots, zero)


def line_term(channel: ResidualChannel, frequency: float, signals: Signals) -> LineTerm:
    """A sinusoid in each flight; torques are means over the interval that begins at the sample."""
    index = SIGNALS.index(channel.signal)
    columns = []
    for flight in range(signals.flights):
        rows = signals.rows(flight)
        if not signals.valid[rows, index].any():
            continue
        t = signals.dt * np.arange(rows.stop - rows.start)
        factor = 1.0
        if channel.kind == "torque":
            t, factor = t + 0.5 * signals.dt, float(np.sinc(frequency * signals.dt))
        for wave in (np.sin, np.cos):
            column = np.zeros((signals.part.size, len(SIGNALS)))
            column[rows, index] = factor * wave(2.0 * np.pi * frequency * t)
            columns.append(column)
    return LineTerm(channel, "time", tuple(columns), frequency)


def inside(values: FloatArray, low: float | None, high: float | None) -> FloatArray:
    """1 where a value is between the ends, shape (n,); 0 where it is not known."""
    above = np.isfinite(values) if low is None else values > low
    return np.where(above & (True if high is None else values < high), 1.0, 0.0)


def powers(values: FloatArray, centre: float, degree: int) -> FloatArray:
    """Powers 1 .. `degree`, shape (n, degree); 0 where the value is not known."""
    about = np.where(np.isfinite(values), values - centre, 0.0)
    return np.asarray(about[:, None] ** np.arange(1, degree + 1))


def hats(values: FloatArray, knots: FloatArray) -> FloatArray:
    """Linear interpolation from `knots`, shape (k,), and constant beyond, as columns, shape (n, k); 0 where
    the value is not known."""
    known = np.isfinite(values)
    at = np.clip(np.where(known, values, knots[0]), knots[0], knots[-1])
    return np.asarray(
        BSpline.design_matrix(at, np.r_[knots[0], knots, knots[-1]], 1).toarray() * known[:, None]
    )


def as_signals(channel: ResidualChannel, shape: FloatArray, turns: FloatArray) -> FloatArray:
    """Signals, shape (n, 7), of something that acts in a channel with `shape`, shape (n,)."""
    column = np.zeros((shape.size, len(SIGNALS)))
    if channel.frame == "world":
        column[:, FORCE] = turns[:, channel.axis] * shape[:, None]
    elif channel.kind == "torque":  # a mean over the interval that begins at the sample
        column[:-1, SIGNALS.index(channel.signal)] = 0.5 * (shape[1:] + shape[:-1])
    else:
        column[:, SIGNALS.index(channel.signal)] = shape
    return column


def _scale(channel: ResidualChannel, vehicle: Vehicle) -> float:
    body = vehicle.body
    if channel.kind == "force":
        return body.mass.value
    if channel.kind == "torque":
        return (body.inertia_xx, body.inertia_yy, body.inertia_zz)[channel.axis].value
    return 1.0


def _unit(channel: ResidualChannel) -> str:
    return f"{ {'force': 'N', 'torque': 'N m', 'voltage': 'V'}[channel.kind] } {channel.words}"


def _number(value: float) -> str:
    return f"{value:.3g}"
