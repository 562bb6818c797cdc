"""Channels that hold something else than they should: another unit, another range, another frame or order."""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from calibration.flights.flight import Flight, UnusableFlightError
from calibration.gap.data.phases import AIRBORNE_PWM
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import conjugates, matrices, products, rotation_vectors
from calibration.gap.data.samples import Samples
from calibration.gap.data.signals import window_means
from onboard.arrays import FloatArray
from onboard.battery import FULL_RATIO

_WINDOW_S = 0.1
_TURNING = 0.15
"""rad/s rms of the tracked body; below, nothing is said about its gyro."""

_DEGREES = np.degrees(1.0)
_LIKE = (0.7, 1.4)
"""Share of an expected factor within which one is recognised."""

_HALF = 0.5
_MOST_VOLTS = 100.0
MOST_SPEED = 30.0
"""m/s, median in flight: faster than any room."""

_IN_G = (0.5, 2.5)
"""Specific force in flight, median, that is one of g's and none of m/s2."""

_GRAVITY_FELT = 5.0
"""m/s2: half of what an accelerometer shows in hover."""

_UPSIDE_DOWN = -0.5
"""Cosine of the tilt at the beginning of a log, below which the vehicle would lie on its back."""


class _Range(NamedTuple):
    """A range of motor commands that is in use elsewhere.

    Attributes:
        least: what the largest command of a flight exceeds.
        lowest: what the smallest one that turns a motor exceeds.
    """

    words: str
    most: float
    least: float
    lowest: float = 0.0


_RANGES = (
    _Range("shares of full power (0 to 1)", 1.0, 0.1),
    _Range("percent", 100.0, 10.0),
    _Range("bytes (0 to 255)", 255.0, 100.0),
    _Range("pulse widths (1000 to 2000 us)", 2100.0, 1000.0, lowest=900.0),
    _Range("DShot values (48 to 2047)", 2047.0, 255.0),
    _Range("numbers of 12 bits (0 to 4095)", 4095.0, 2100.0),
)


class ConventionError(UnusableFlightError):
    """A channel is in another unit, frame or order than it should be."""


def check_range(flight: Flight, motors: Samples) -> None:
    """Refuse commands none of which would carry a vehicle.

    Raises:
        UnusableFlightError: none would; the message says what the commands may be instead.
    """
    most = float(motors.values.max())
    if most > AIRBORNE_PWM:
        return
    turning = motors.values[motors.values > 0.0]
    lowest = float(turning.min()) if turning.size else 0.0
    other = next((r.words for r in _RANGES if r.least < most <= r.most and lowest >= r.lowest), None)
    hint = f": they look like {other}; convert them to 0 to {FULL_RATIO:.0f}" if other else ""
    raise UnusableFlightError(
        flight.source,
        f"never flies: the motors hardly run, no command is above {most:.4g} of {FULL_RATIO:.0f}{hint}",
    )


def check_upright(flight: Flight, attitude: FloatArray) -> None:
    """Refuse a flight whose vehicle, by the `attitude` (n, 4), lies on its back from the beginning.

    Raises:
        ConventionError: it does; the message says what to look at.
    """
    x, y = attitude[0, 0], attitude[0, 1]
    if 1.0 - 2.0 * (x**2 + y**2) < _UPSIDE_DOWN:
        raise ConventionError(
            flight.source,
            "the vehicle lies on its back when the log begins: columns qx, qy, qz, qw are a rotation from "
            "body to world with the scalar last; is yours in qx, or the rotation the other way round?",
        )


def check_plausible(flight: Flight, record: FlightRecord) -> None:
    """Refuse a flight whose gyro, accelerometer, position or voltage are in another unit or frame.

    Raises:
        ConventionError: they are; the message says what to convert.
    """
    for words in _conventions(record):
        raise ConventionError(flight.source, words)


def _conventions(record: FlightRecord) -> Iterator[str]:
    """What is in another unit or frame, and what to convert."""
    if record.voltage is not None and float(np.nanmedian(record.voltage)) > _MOST_VOLTS:
        volts = float(np.nanmedian(record.voltage))
        yield f"battery voltage of {volts:.0f} V: it seems to be in mV; divide it by 1000"
    speed = float(np.median(np.linalg.norm(record.velocity[record.flying], axis=1)))
    if speed > MOST_SPEED:
        yield f"flies at {speed:.0f} m/s: positions seem to be in mm or cm; bring them to m"
    if record.specific_force is not None:
        yield from _of_accelerometer(record.specific_force[record.flying])
    body, world, gyro = _rates(record)
    power = float(np.mean(np.sum(body**2, axis=1))) if body.size else 0.0
    if power < _TURNING**2:
        return
    factor = float(np.mean(np.sum(body * gyro, axis=1))) / power
    if _LIKE[0] < factor / _DEGREES < _LIKE[1]:
        yield (
            f"the gyro shows {factor:.0f} times the rate of the tracked body: it seems to be in deg/s; "
            "convert it to rad/s"
        )
    missed, alike = (float(np.mean(np.sum((gyro - rate) ** 2, axis=1))) for rate in (body, world))
    if alike < _HALF**2 * missed and missed > _HALF**2 * _TURNING**2:
        yield "the gyro follows the rate in the world frame, not in the body's: turn it into the body frame"
    yield from _of_axes(body, gyro)


def _of_axes(body: FloatArray, gyro: FloatArray) -> Iterator[str]:
    """Whether the axes of a `gyro`, shape (n, 3), are others than those of the tracked `body`."""
    missed = {
        (order, signs): float(np.mean(np.sum((gyro - body[:, order] * signs) ** 2, axis=1)))
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    }
    own = missed[(0, 1, 2), (1.0, 1.0, 1.0)]
    order, signs = min(missed, key=lambda axes: missed[axes])
    if missed[order, signs] < _HALF**2 * own and own > _HALF**2 * _TURNING**2:
        columns = ", ".join(
            f"g{name} is about {'-' if sign < 0.0 else ''}{'xyz'[axis]}"
            for name, axis, sign in zip("xyz", order, signs, strict=True)
        )
        yield (
            f"the gyro's axes are not those of the tracked body: {columns}. Name and sign the columns of "
            "gyro and accelerometer by the body's axes, or turn the tracked frame, whichever is wrong"
        )


def _of_accelerometer(force: FloatArray) -> Iterator[str]:
    """Whether the `force` in flight, shape (n, 3), is no specific force in m/s2."""
    felt, upward = float(np.nanmedian(np.linalg.norm(force, axis=1))), float(np.nanmedian(force[:, 2]))
    if abs(upward) < _IN_G[0] and felt < _GRAVITY_FELT:
        yield (
            f"the accelerometer shows {upward:.1f} m/s2 along z in flight: gravity seems to be taken out; "
            "what is needed is the specific force, 9.81 along z in hover"
        )
    elif upward < -_GRAVITY_FELT:
        yield (
            f"the accelerometer shows {upward:.1f} m/s2 along z in flight: its z seems to point down "
            "(forward, right, down); change the signs of y and z of accelerometer and gyro"
        )
    elif abs(upward) < _GRAVITY_FELT < felt:
        yield (
            f"the accelerometer shows {upward:.1f} of {felt:.1f} m/s2 along z in flight: its axes are not "
            "those of the body; name ax, ay, az by the body's axes (z up along the thrust)"
        )
    elif _IN_G[0] < felt < _IN_G[1]:
        yield f"the accelerometer shows {felt:.1f} in flight: it seems to be in g; multiply it by 9.81"


def _rates(record: FlightRecord) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rates (rad/s) of the tracked attitude in body and world frame, and of the gyro, means over 0.1 s."""
    turns = rotation_vectors(products(conjugates(record.attitude[:-1]), record.attitude[1:])) / record.dt
    world = np.einsum("nij,nj->ni", matrices(record.attitude[:-1]), turns)
    known = record.flying & record.pose_known & record.inertial_known
    together = np.hstack([turns, world, 0.5 * (record.rate[1:] + record.rate[:-1])])
    together[~(known[1:] & known[:-1])] = np.nan
    means = window_means(together, max(1, round(_WINDOW_S / record.dt)))
    means = means[np.isfinite(means).all(axis=1)]
    return means[:, :3], means[:, 3:6], means[:, 6:]
