"""Whether a sensing effect lowers the disagreement of the sensors on flights that it was not found from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.found_effect import Improvement
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import conjugates, integrate_rate, matrices, products, rotation_vectors
from calibration.gap.data.smoothing import Smoothing
from calibration.gap.sensors.correction import align, best_values
from calibration.gap.sensors.flight_estimates import FlightSensing, pool_flights
from calibration.measurement import drawn_again
from onboard.gravity import GRAVITY

SPAN_S = 0.5
"""Turns are compared over this time."""


def turn_mismatch(record: FlightRecord) -> tuple[float, int]:
    """Sum of squares (rad^2) and number of the differences between tracked and gyro turns over 0.5 s."""
    steps = round(SPAN_S / record.dt)
    gyro = integrate_rate(record.rate, record.dt)
    felt = products(conjugates(gyro[:-steps]), gyro[steps:])
    seen = products(conjugates(record.attitude[:-steps]), record.attitude[steps:])
    error = rotation_vectors(products(conjugates(felt), seen))
    good = record.flying & record.pose_known & record.inertial_known
    lost = np.concatenate([[0], np.cumsum(~good)])
    rows = lost[steps + 1 :] == lost[: -steps - 1]
    return float(np.sum(error[rows] ** 2)), int(np.count_nonzero(rows))


def acceleration_mismatch(record: FlightRecord) -> tuple[float, int]:
    """Sum of squares (m^2/s^4) and number of the differences between tracked and felt acceleration.

    Both over about 80 ms; less the bias of the accelerometer that fits the flight best.
    """
    if record.specific_force is None:
        return 0.0, 0
    smoothing = Smoothing(record.dt)
    rows = smoothing.reach(record.flying & record.pose_known & record.inertial_known)
    frames = matrices(record.attitude)
    felt = np.einsum("nij,nj->ni", frames, record.specific_force)
    error = smoothing.second_derivative(record.position) - smoothing.mean(felt)
    error[:, 2] += GRAVITY
    columns = smoothing.mean(frames)[rows].reshape(-1, 3)
    target = error[rows].ravel()
    if target.size < 3:
        return 0.0, 0
    bias = np.linalg.lstsq(columns, target, rcond=None)[0]
    return float(np.sum((target - columns @ bias) ** 2)), int(np.count_nonzero(rows))


@dataclass(frozen=True)
class Metric:
    """What an effect is judged by: a function that gives a sum of squares and how many there are."""

    squares: Callable[[FlightRecord], tuple[float, int]]
    meaning: str
    unit: str


_DRAWS, _SEED = 2000, 1

_TURN = Metric(turn_mismatch, f"tracked turn less gyro turn over {SPAN_S:g} s, rms", "rad")
METRICS = {
    "pose_delay": _TURN,
    "pose_rotation": _TURN,
    "gyro_bias": _TURN,
    "pose_offset": Metric(acceleration_mismatch, "tracked less felt acceleration over 80 ms, rms", "m/s2"),
}
"""By effect."""


def held_out_improvement(
    name: str, records: Sequence[FlightRecord], flights: Sequence[FlightSensing]
) -> Improvement | None:
    """What the effect `name` does for flights whose shape the applied values are not from.

    None when there are not two to hold out.

    What a flight does not share with the others is taken out before and after, as are the other effects.
    After, the mean over the flights of other shapes is taken out too.
    """
    shapes = [record.shape for record in records]
    pooled = pool_flights(flights)
    common = np.array([p.mean for p in pooled[name]])
    squares = []
    for record, flight in zip(records, flights, strict=True):
        others = pool_flights([f for f, s in zip(flights, shapes, strict=True) if s != record.shape])
        if name not in others or name not in flight.estimates:
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
    if len(squares) < 2:
        return None
    return Improvement.over(
        drawn_again(len(squares), _DRAWS, np.random.default_rng(_SEED)),
        lambda drawn: np.sqrt(np.array(squares)[drawn].mean(axis=-2)),
        f"{METRICS[name].meaning}, {METRICS[name].unit}",
    )
