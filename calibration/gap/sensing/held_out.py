"""Whether a sensing effect lowers the disagreement of the sensors on flights that it was not found from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from calibration.gap.record import FlightRecord
from calibration.gap.sensing.correction import align, best_values
from calibration.gap.sensing.flight_estimates import FlightSensing, pool_flights
from calibration.gap.sensing.mismatch import SPAN_S, acceleration_mismatch, turn_mismatch
from onboard.arrays import FloatArray


@dataclass(frozen=True)
class Metric:
    """What an effect is judged by: a function that gives a sum of squares and how many there are."""

    squares: Callable[[FlightRecord], tuple[float, int]]
    meaning: str
    unit: str


_TURN = Metric(turn_mismatch, f"tracked turn less gyro turn over {SPAN_S:g} s, rms", "rad")
METRICS = {
    "pose_delay": _TURN,
    "pose_rotation": _TURN,
    "gyro_bias": _TURN,
    "pose_offset": Metric(acceleration_mismatch, "tracked less felt acceleration over 80 ms, rms", "m/s2"),
}
"""By effect."""


@dataclass(frozen=True)
class HeldOut:
    """Errors on flights whose shape the applied values are not from.

    Attributes:
        before, after: rms without and with the effect taken out.
        improvement_ci95: of 1 - after / before.
    """

    before: float
    after: float
    improvement_ci95: tuple[float, float]


def held_out_errors(
    name: str, records: Sequence[FlightRecord], flights: Sequence[FlightSensing]
) -> HeldOut | None:
    """Errors of the effect `name`; None when there are not two flights to hold out.

    What a flight does not share with the others is taken out before and after, as are the other effects.
    After, the mean over the flights of other shapes is taken out too.

    Args:
        name: of the effect.
        records, flights: the flights and their estimates, in one order.
    """
    shapes = [record.shape for record in records]
    pooled = pool_flights(flights)
    common = np.array([p.mean for p in pooled[name]])
    squares = []
    for record, flight in zip(records, flights, strict=True):
        others = pool_flights([f for f, s in zip(flights, shapes, strict=True) if s != record.shape])
        if name not in others or name not in flight.values:
            continue
        values = best_values(flight, pooled)
        own = values[name] - common
        mean = np.array([p.mean for p in others[name]])
        errors = [
            METRICS[name].squares(align(record, flight, {**values, name: value}))
            for value in (own, own + mean)
        ]
        if all(count > 0 for _, count in errors):
            squares.append([total / count for total, count in errors])
    return _errors(np.array(squares)) if len(squares) > 1 else None


def _errors(squares: FloatArray) -> HeldOut:
    """From mean squares before and after, shape (n, 2); the interval is a jackknife over flights."""
    flights = squares.shape[0]
    total = squares.sum(axis=0)
    gain = 1.0 - float(np.sqrt(total[1] / total[0]))
    without = total - squares
    gains = 1.0 - np.sqrt(without[:, 1] / without[:, 0])
    error = float(np.sqrt((flights - 1) / flights * np.sum((gains - gains.mean()) ** 2)))
    reach = float(student.ppf(0.975, flights - 1)) * error
    rms = np.sqrt(total / flights)
    return HeldOut(float(rms[0]), float(rms[1]), (gain - reach, gain + reach))
