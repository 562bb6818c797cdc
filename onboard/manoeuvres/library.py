"""The library of test flights: each excites some effects and leaves others alone.

Parameters are SI. ``x``, ``y`` and ``height`` place a flight in the room and belong to all of them.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray, Vector
from onboard.manoeuvres.course import Course, CourseBuilder, CourseDoesNotFit, CourseError
from onboard.room import RoomGeometry

Values = Mapping[str, float]
_LAP_ACCELERATION = 4.0
"""m/s2, largest of a straight lap: a tilt of 22 deg."""

X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class Rule:
    """A parameter of a flight: its usual value, its bounds, what it is."""

    usual: float
    low: float
    high: float
    meaning: str


PLACE = {
    "x": Rule(-2.5, -50.0, 50.0, "m, centre of the flight"),
    "y": Rule(0.0, -50.0, 50.0, "m, centre of the flight"),
    "height": Rule(1.1, 0.1, 20.0, "m, of the centre above the floor"),
}


@dataclass(frozen=True)
class Manoeuvre:
    """A kind of test flight.

    Attributes:
        kind: name in a campaign file.
        parameters: its own, beside those of its place.
        fly: adds the flight to a course that begins at its centre.
    """

    kind: str
    parameters: Mapping[str, Rule]
    fly: Callable[[CourseBuilder, Values, RoomGeometry], object]

    @property
    def rules(self) -> dict[str, Rule]:
        """All parameters."""
        return {**PLACE, **self.parameters}

    def values(self, chosen: Values) -> dict[str, float]:
        """Every parameter, those that are not chosen at their usual value.

        Raises:
            CourseError: unknown, or out of bounds.
        """
        values = {name: rule.usual for name, rule in self.rules.items()}
        for name, value in chosen.items():
            if name not in values:
                raise CourseError(f"{self.kind}: {name} is unknown; known are {', '.join(values)}")
            rule = self.rules[name]
            if not rule.low <= value <= rule.high:
                raise CourseError(
                    f"{self.kind}: {name} = {value:g} ({rule.meaning}) must be {rule.low:g} to {rule.high:g}"
                )
            values[name] = float(value)
        return values

    def course(self, chosen: Values, room: RoomGeometry) -> Course:
        """The course in a room.

        Raises:
            CourseDoesNotFit: it does not fit the room.
            CourseError: a parameter cannot be used.
        """
        values = self.values(chosen)
        builder = CourseBuilder((values["x"], values["y"], values["height"]))
        self.fly(builder, values, room)
        course = builder.build()
        try:
            course.check_room(room)
        except CourseDoesNotFit as error:
            raise CourseDoesNotFit(f"{self.kind}: {error}") from error
        return course


def _scaled(direction: Vector, size: float) -> Vector:
    return direction[0] * size, direction[1] * size, direction[2] * size


def _repeats(values: Values) -> range:
    return range(round(values["repeats"]))


def _thrust_steps(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    for _ in _repeats(v):
        for size in (0.5 * v["acceleration"], v["acceleration"]):
            up, down = (0.0, 0.0, size), (0.0, 0.0, -size)
            b.push((up, 0.2), (down, 0.2)).hold(0.4).push((down, 0.2), (up, 0.2)).hold(0.4)


def _throttle_chops(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    # Long and gentle up, short and hard down, so that the thrust falls and comes back at once.
    chop, gentle = v["acceleration"], v["acceleration"] / 3.0
    for _ in _repeats(v):
        b.push(((0.0, 0.0, gentle), 0.3), ((0.0, 0.0, -chop), 0.2), ((0.0, 0.0, gentle), 0.3)).hold(0.4)
        b.push(((0.0, 0.0, -gentle), 0.3), ((0.0, 0.0, chop), 0.2), ((0.0, 0.0, -gentle), 0.3)).hold(0.4)


def _vertical_steps(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    x, y, z = v["x"], v["y"], v["height"]
    seconds = 1.875 * v["rise"] / v["speed"]  # the polynomial's peak is 1.875 of its mean
    for _ in _repeats(v):
        for side in (0.5, -0.5, 0.5, 0.0):
            b.go((x, y, z + side * v["rise"]), seconds).hold(0.6)


def _doublets(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    if v["seconds"] > 0.0:
        b.hold(v["seconds"])
    for _ in _repeats(v):
        for axis in (X, Y):
            for size in (0.5 * v["acceleration"], v["acceleration"]):
                for sign in (1.0, -1.0):
                    there, back = _scaled(axis, sign * size), _scaled(axis, -sign * size)
                    b.push((there, 0.15), (back, 0.3), (there, 0.15)).hold(0.5)


def _chirp(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    low, high, seconds = v["lowest"], v["highest"], v["duration"]
    for axis in (X, Y):

        def way(t: FloatArray, axis: Vector = axis) -> FloatArray:
            rate = math.log(high / low) / seconds
            phase = 2.0 * np.pi * low * (np.exp(rate * t) - 1.0) / rate
            frequency = low * np.exp(rate * t)
            amplitude = 1.0 / (1.0 / v["reach"] + (2.0 * np.pi * frequency) ** 2 / v["acceleration"])
            ends = np.clip(np.minimum(t, seconds - t) / 0.5, 0.0, 1.0)
            smooth = ends**3 * (10.0 - 15.0 * ends + 6.0 * ends**2)
            return np.asarray((smooth * amplitude * np.sin(phase))[:, None] * np.array(axis))

        b.follow(way, seconds).hold(0.5)


def _circles(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    radius, speed = v["radius"], v["speed"]
    lap = 2.0 * np.pi * radius / speed
    ramp = 2.0
    for _ in _repeats(v):
        for sense in (1.0, -1.0):

            def way(t: FloatArray, sense: float = sense) -> FloatArray:
                total = 2.0 * lap + ramp
                angle = 2.0 * np.pi * _trapezoid(t, ramp, total) / lap
                grown = radius * _smooth(np.clip(np.minimum(t, total - t) / ramp, 0.0, 1.0))
                return np.asarray(
                    np.stack((grown * np.cos(angle), sense * grown * np.sin(angle), np.zeros_like(t)), axis=1)
                )

            b.follow(way, 2.0 * lap + ramp).hold(0.5)


def _trapezoid(t: FloatArray, ramp: float, total: float) -> FloatArray:
    """Distance at unit speed with linear ramps of `ramp` s at both ends of `total` s."""
    start = np.minimum(t, ramp)
    end = np.maximum(t - (total - ramp), 0.0)
    return np.asarray(start**2 / (2.0 * ramp) + np.maximum(t - ramp, 0.0) - end**2 / (2.0 * ramp))


def _smooth(s: FloatArray) -> FloatArray:
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def _straight_laps(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    x, y, z = v["x"], v["y"], v["height"]
    half, speed = 0.5 * v["length"], v["speed"]
    for _ in _repeats(v):
        for axis, reach in ((X, half), (Y, min(half, 0.4 * (room.y_max - room.y_min) - 0.15))):
            there = (x + axis[0] * reach, y + axis[1] * reach, z)
            back = (x - axis[0] * reach, y - axis[1] * reach, z)
            # Of the polynomial: peak speed 1.875 of the mean, peak acceleration 5.77 of length / time^2.
            seconds = max(1.875 * 2.0 * reach / speed, math.sqrt(5.77 * 2.0 * reach / _LAP_ACCELERATION))
            b.go(there, 0.7 * seconds).go(back, seconds).go(there, seconds).go((x, y, z), 0.7 * seconds)


def _near_ceiling(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    for distance in (4.0 * v["distance"], 2.0 * v["distance"], v["distance"]):
        b.go((v["x"], v["y"], room.ceiling_z - distance), 2.5).hold(v["seconds"])
    b.go((v["x"], v["y"], v["height"]), 2.5).hold(v["seconds"])


def _near_floor(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    for height in (4.0 * v["lowest"], 2.0 * v["lowest"], v["lowest"]):
        b.go((v["x"], v["y"], height), 2.5).hold(v["seconds"])
    b.go((v["x"], v["y"], v["height"]), 2.5).hold(v["seconds"])


def _discharge(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    b.hold(v["seconds"])


def _yaw_half_turn(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    for _ in _repeats(v):
        b.hold(v["seconds"]).turn(np.pi, 2.0).hold(v["seconds"]).turn(-np.pi, 2.0)


def _yaw_steps(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    for _ in _repeats(v):
        for sign in (1.0, -1.0, -1.0, 1.0):
            b.turn(sign * v["angle"], 0.35).hold(0.6)


def _yaw_with_doublets(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    # Rolls and pitches while the rotors of one sense are faster than those of the other.
    for _ in _repeats(v):
        for axis in (X, Y):
            there, back = _scaled(axis, v["acceleration"]), _scaled(axis, -v["acceleration"])
            b.turn(v["angle"], 0.35).push((there, 0.15), (back, 0.3), (there, 0.15))
            b.turn(-v["angle"], 0.35).push((back, 0.15), (there, 0.3), (back, 0.15)).hold(0.4)


def _tour(b: CourseBuilder, v: Values, room: RoomGeometry) -> None:
    x, y, z = v["x"], v["y"], v["height"]
    out, side, rise = 0.5 * v["length"], 0.5 * v["width"], 0.5 * v["rise"]
    for dx, dy, dz in ((1, 1, 1), (1, -1, 1), (1, -1, -1), (-1, -1, -1), (-1, 1, -1), (-1, 1, 1), (0, 0, 0)):
        b.go((x + dx * out, y + dy * side, z + dz * rise), 3.0).hold(v["seconds"])


def _count(usual: float) -> Rule:
    return Rule(usual, 1.0, 50.0, "how often")


MANOEUVRES: dict[str, Manoeuvre] = {
    m.kind: m
    for m in (
        Manoeuvre(
            "thrust_steps",
            {"acceleration": Rule(2.5, 0.5, 8.0, "m/s2, larger step"), "repeats": _count(4)},
            _thrust_steps,
        ),
        Manoeuvre(
            "throttle_chops",
            {"acceleration": Rule(4.5, 2.0, 8.0, "m/s2, of the chop"), "repeats": _count(5)},
            _throttle_chops,
        ),
        Manoeuvre(
            "vertical_steps",
            {
                "rise": Rule(1.2, 0.2, 10.0, "m, between the heights"),
                "speed": Rule(1.4, 0.2, 3.0, "m/s, fastest"),
                "repeats": _count(3),
            },
            _vertical_steps,
        ),
        Manoeuvre(
            "attitude_doublets",
            {
                "acceleration": Rule(3.0, 1.0, 9.0, "m/s2, sideways"),
                "repeats": _count(3),
                "seconds": Rule(0.0, 0.0, 600.0, "s, of hover before"),
            },
            _doublets,
        ),
        Manoeuvre(
            "chirp",
            {
                "lowest": Rule(0.4, 0.1, 2.0, "Hz, at the start"),
                "highest": Rule(3.0, 1.0, 6.0, "Hz, at the end"),
                "acceleration": Rule(4.0, 0.5, 8.0, "m/s2, largest"),
                "reach": Rule(0.4, 0.05, 5.0, "m, largest displacement"),
                "duration": Rule(12.0, 4.0, 60.0, "s, of each axis"),
            },
            _chirp,
        ),
        Manoeuvre(
            "circles",
            {
                "radius": Rule(0.6, 0.2, 20.0, "m"),
                "speed": Rule(1.5, 0.2, 5.0, "m/s"),
                "repeats": _count(2),
            },
            _circles,
        ),
        Manoeuvre(
            "straight_laps",
            {
                "length": Rule(3.0, 0.5, 50.0, "m, of the run along x"),
                "speed": Rule(2.5, 0.3, 6.0, "m/s, fastest"),
                "repeats": _count(3),
            },
            _straight_laps,
        ),
        Manoeuvre(
            "near_ceiling",
            {
                "distance": Rule(0.05, 0.03, 0.4, "m, body origin to ceiling"),
                "seconds": Rule(4.0, 1.0, 60.0, "s, of each hover"),
            },
            _near_ceiling,
        ),
        Manoeuvre(
            "near_floor",
            {
                "lowest": Rule(0.11, 0.1, 0.5, "m, body origin above the floor"),
                "seconds": Rule(4.0, 1.0, 60.0, "s, of each hover"),
            },
            _near_floor,
        ),
        Manoeuvre(
            "long_discharge",
            {"seconds": Rule(150.0, 5.0, 600.0, "s")},
            _discharge,
        ),
        Manoeuvre(
            "yaw_half_turn",
            {"seconds": Rule(4.0, 1.0, 60.0, "s, of each hover"), "repeats": _count(2)},
            _yaw_half_turn,
        ),
        Manoeuvre(
            "yaw_steps",
            {"angle": Rule(0.9, 0.1, 1.5, "rad, of a step"), "repeats": _count(4)},
            _yaw_steps,
        ),
        Manoeuvre(
            "yaw_steps_with_doublets",
            {
                "angle": Rule(0.5, 0.1, 1.5, "rad, of a step"),
                "acceleration": Rule(2.0, 0.5, 9.0, "m/s2, sideways"),
                "repeats": _count(4),
            },
            _yaw_with_doublets,
        ),
        Manoeuvre(
            "tour",
            {
                "length": Rule(4.0, 0.2, 50.0, "m, along x"),
                "width": Rule(1.2, 0.2, 50.0, "m, along y"),
                "rise": Rule(1.2, 0.1, 10.0, "m"),
                "seconds": Rule(2.0, 0.5, 60.0, "s, of each hover"),
            },
            _tour,
        ),
    )
}
"""Every kind of test flight, by name."""
HOVER = "long_discharge"
"""The kind that stays in one place for some seconds."""


def manoeuvre(kind: str) -> Manoeuvre:
    """The manoeuvre of that name.

    Raises:
        CourseError: there is none.
    """
    if kind not in MANOEUVRES:
        raise CourseError(f"{kind!r} is not a kind of test flight; known: {', '.join(MANOEUVRES)}")
    return MANOEUVRES[kind]
