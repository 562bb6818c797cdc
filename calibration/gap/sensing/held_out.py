"""Whether a sensing effect lowers the disagreement of the sensors on flights that it was not found from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from calibration.gap.record import FlightRecord
from calibration.gap.sensing.correction import without_effect
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
    name: str,
    records: Sequence[FlightRecord],
    flights: Sequence[FlightSensing],
    before: Sequence[tuple[str, FloatArray]],
) -> HeldOut | None:
    """Errors of the effect `name`; None when there are not two flights to hold out.

    Flights of each shape are corrected by the mean over the flights of the others.

    Args:
        name: of the effect.
        records, flights: the flights and their estimates, in one order.
        before: effects named already, with their values; they are taken out first.
    """
    shapes = [record.shape for record in records]
    sums = []
    for shape in dict.fromkeys(shapes):
        others = [f for f, s in zip(flights, shapes, strict=True) if s != shape]
        means = pool_flights(others).get(name)
        if means is None:
            continue
        values = np.array([p.mean for p in means])
        for record in (r for r in records if r.shape == shape):
            for other, known in before:
                record = without_effect(record, other, known)
            first, count = METRICS[name].squares(record)
            second, count_after = METRICS[name].squares(without_effect(record, name, values))
            if min(count, count_after) > 0:
                sums.append((first / count, second / count_after))
    return _errors(np.array(sums)) if len(sums) > 1 else None


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
