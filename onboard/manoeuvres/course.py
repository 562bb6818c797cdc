"""What a test flight is asked to do, sample by sample, and how such courses are put together.

A course is a full-state reference: position, velocity, acceleration and heading at 100 Hz. Velocity and
position belong to the acceleration, so that a controller with feed-forward follows steps of acceleration as
steps of thrust and attitude.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from onboard.arrays import FloatArray, Vector
from onboard.errors import InputError, OnboardError
from onboard.room import RoomGeometry

RATE = 100
"""Samples of a course a second."""

WALL_MARGIN = 0.15
"""m that must remain to the side walls."""

LOWEST = 0.1
"""m, lowest height of a course: the legs stay clear of the floor."""

NEAREST_CEILING = 0.03
"""m from the body's origin to the ceiling: the propellers stay clear of it."""


class CourseError(OnboardError, InputError):
    """A course that cannot be flown, and why."""


class CourseDoesNotFit(CourseError):
    """A course that another room could hold."""


@dataclass(frozen=True, kw_only=True)
class Course:
    """A reference at 100 Hz that begins and ends at rest, at the same place and heading.

    Attributes:
        t: s from 0, shape (n,).
        position, velocity, acceleration: m, m/s, m/s2, world frame, shape (n, 3).
        yaw, yaw_rate: rad, rad/s, shape (n,).
    """

    t: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    yaw: FloatArray
    yaw_rate: FloatArray

    @property
    def duration(self) -> float:
        """s."""
        return float(self.t[-1])

    @property
    def start(self) -> Vector:
        """Where it begins, m."""
        x, y, z = self.position[0]
        return float(x), float(y), float(z)

    def setpoint(self, index: int) -> tuple[Vector, Vector, Vector, float, float]:
        """Position, velocity, acceleration, yaw and yaw rate of one sample."""
        (x, y, z), (vx, vy, vz), (ax, ay, az) = (
            row[index].tolist() for row in (self.position, self.velocity, self.acceleration)
        )
        return (x, y, z), (vx, vy, vz), (ax, ay, az), float(self.yaw[index]), float(self.yaw_rate[index])

    def index_at(self, t: float) -> int:
        """The sample in force at `t` s after the start; the first before it, the last after the end."""
        return min(max(int(t * RATE), 0), self.t.size - 1)

    def check_room(self, room: RoomGeometry) -> None:
        """See that the course stays inside a room.

        Raises:
            CourseDoesNotFit: it does not; the message says where and by how much.
        """
        limits = (
            ("x", 0, room.x_min + WALL_MARGIN, room.x_max - WALL_MARGIN),
            ("y", 1, room.y_min + WALL_MARGIN, room.y_max - WALL_MARGIN),
            ("z", 2, LOWEST, room.ceiling_z - NEAREST_CEILING),
        )
        for name, axis, low, high in limits:
            least, most = float(self.position[:, axis].min()), float(self.position[:, axis].max())
            if least < low - 1e-6 or most > high + 1e-6:
                raise CourseDoesNotFit(
                    f"the course spans {name} = {least:.2f} to {most:.2f} m, the room allows {low:.2f} to "
                    f"{high:.2f} m: make it smaller or move its centre"
                )


class CourseBuilder:
    """Puts a course together piece by piece, each beginning where the last ended.

    Args:
        start: m, world.
    """

    def __init__(self, start: Vector) -> None:
        self._accelerations: list[FloatArray] = []
        self._positions: list[FloatArray] = []
        self._velocities: list[FloatArray] = []
        self._yaws: list[FloatArray] = []
        self._start = self._place = np.array(start, dtype=np.float64)
        self._yaw = 0.0

    def hold(self, seconds: float) -> Self:
        """Hover on the spot."""
        return self._append(np.zeros((_samples(seconds), 3)))

    def go(self, place: Sequence[float] | FloatArray, seconds: float) -> Self:
        """Move to a place (m) at rest: the polynomial of least jerk."""
        s = _phase(seconds)[:, None]
        way = np.asarray(place, dtype=np.float64) - self._place
        return self._append(way * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5))

    def push(self, *pieces: tuple[Vector, float]) -> Self:
        """Constant accelerations (m/s2), each for its time (s); they must end at rest.

        Raises:
            CourseError: they do not.
        """
        steps = [np.tile(np.array(push), (_samples(seconds), 1)) for push, seconds in pieces]
        acceleration = np.concatenate(steps)
        velocity = np.cumsum(acceleration, axis=0) / RATE
        if np.linalg.norm(velocity[-1]) > 1e-9:
            raise CourseError(f"the accelerations {pieces} do not end at rest")
        before = velocity - acceleration / RATE
        way = np.cumsum(before / RATE + 0.5 * acceleration / RATE**2, axis=0)
        return self._append(way, velocity, acceleration)

    def follow(self, way: Callable[[FloatArray], FloatArray], seconds: float) -> Self:
        """A displacement (m, shape (n, 3)) as a function of time (s, shape (n,)); zero and at rest at 0.

        It must end at rest.
        """
        return self._append(way(_phase(seconds) * seconds))

    def turn(self, angle: float, seconds: float) -> Self:
        """Turn by an angle (rad) on the spot."""
        s = _phase(seconds)
        return self._append(
            np.zeros((s.size, 3)), yaw=self._yaw + angle * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
        )

    def _append(
        self,
        way: FloatArray,
        velocity: FloatArray | None = None,
        acceleration: FloatArray | None = None,
        yaw: FloatArray | None = None,
    ) -> Self:
        """Add a piece: displacements from the present place, with their derivatives unless given."""
        if velocity is None or acceleration is None:
            padded = np.concatenate((np.zeros((1, 3)), way, way[-1:]))
            velocity = (padded[2:] - padded[:-2]) * (0.5 * RATE)
            acceleration = (padded[2:] - 2.0 * padded[1:-1] + padded[:-2]) * RATE**2
        self._positions.append(self._place + way)
        self._velocities.append(velocity)
        self._accelerations.append(acceleration)
        self._yaws.append(np.full(len(way), self._yaw) if yaw is None else yaw)
        self._place = self._place + way[-1]
        self._yaw = float(self._yaws[-1][-1])
        return self

    def build(self) -> Course:
        """The course: one second of rest, the pieces, the way back to the start, one second of rest."""
        distance = float(np.linalg.norm(self._place - self._start))
        if distance > 1e-3:
            self.go(self._start, max(1.5, distance / 0.4))
        if abs(self._yaw) > 1e-6:
            self.turn(-self._yaw, max(1.0, abs(self._yaw)))
        self.hold(1.0)
        rest = np.zeros((RATE, 3))
        yaw = np.concatenate((np.zeros(RATE), *self._yaws))
        position = np.concatenate((self._start + rest, *self._positions))
        return Course(
            t=np.arange(len(yaw)) / RATE,
            position=position,
            velocity=np.concatenate((rest, *self._velocities)),
            acceleration=np.concatenate((rest, *self._accelerations)),
            yaw=yaw,
            yaw_rate=np.gradient(yaw) * RATE,
        )


def _samples(seconds: float) -> int:
    return max(1, round(seconds * RATE))


def _phase(seconds: float) -> FloatArray:
    """Share of the time that has passed at the end of each sample."""
    count = _samples(seconds)
    return np.arange(1, count + 1) / count
