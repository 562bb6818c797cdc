"""Sets of flights in the MuJoCo room, everything about them drawn at random: lab, vehicle, what is hidden.

An answer has the shape of `hidden_effects`'s: `verdict`, `effects` (name, parameters in SI), `unlisted`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from onboard.vehicle import EFFECTS, Vehicle
from tests.truth import paths, pilots
from tests.truth.airframe import Airframe, draw_airframe, nominal
from tests.truth.lost import check_kept
from tests.truth.mujoco_room import STEP, Circumstances, Hidden, faces_of, fly

SIZES = {"weak": (0.4, 0.6), "medium": (0.8, 1.3), "strong": (1.6, 2.4)}
"""Least and most of a size, in what an ordinary vehicle may show (`typical` of the effect's parameters)."""
CLASSES = ((0.027, 0.042), (0.15, 0.6), (1.0, 4.0))
"""kg: least and most of a Crazyflie's, a palm's and a kilogram class."""
RATES = (50, 100, 200, 500)
WIND = (1.0, 2.5)
"""m/s of wind per unit of its size: rooms with a fan, since a typical draught would not show."""
FLIGHTS = (4, 6, 8, 12, 16)
"""Of a set."""
HEADER = "t,x,y,z,qx,qy,qz,qw,gx,gy,gz,ax,ay,az,m1,m2,m3,m4,vbat"

Effects = dict[str, dict[str, float]]
"""Parameters by key, of each effect by name."""
Unlisted = dict[str, Any] | None
"""What was hidden that has no name, if anything."""


@dataclass(frozen=True)
class DrawnSet:
    """Logs, the vehicle file of their owner, and what is hidden."""

    files: list[Path]
    vehicle: Vehicle
    answer: dict[str, Any]


def draw_set(seed: int, folder: Path) -> DrawnSet:
    """Draw, fly and write the logs of a set into `folder`.

    Raises:
        VehicleLost: in none of its flights the pilot can keep the vehicle.
    """
    rng = np.random.default_rng([seed, 23])
    frame = draw_airframe(rng, *CLASSES[rng.integers(len(CLASSES))])
    vehicle = nominal(frame, "mujoco-room")
    lab = draw_circumstances(rng, frame)
    size = str(rng.choice(list(SIZES)))
    hidden, effects, unlisted = hide_something(size, frame, lab, rng)
    flights = int(rng.choice(FLIGHTS))
    seconds = float(rng.uniform(15.0, 40.0)) + lab.rest
    folder.mkdir(parents=True, exist_ok=True)
    files, attitudes = [], []
    for number in range(flights):
        kind = paths.KINDS[number % len(paths.KINDS)]
        extent = 1.0 if frame.mass < 0.1 else 2.0 if frame.mass < 0.8 else 3.0
        goals = paths.draw_path(rng, kind, STEP, seconds, lab.rest, extent)
        log = fly(frame, hidden, lab, goals, np.random.default_rng([seed, 29, number]))
        files.append(folder / f"{kind}-{number + 1}.csv")
        write_log(files[-1], log)
        attitudes.append(log[:, 4:8])
    check_kept(attitudes)
    return DrawnSet(files, vehicle, answer_of(size, flights, frame, lab, effects, unlisted))


def answer_of(
    size: str, flights: int, frame: Airframe, lab: Circumstances, effects: Effects, unlisted: Unlisted
) -> dict[str, Any]:
    """What a judge needs to know of a set, as a JSON object."""
    return {
        "size": size, "flights": flights, "hertz": round(1.0 / (lab.per_line * STEP)),
        "kilograms": round(frame.mass, 3), "accelerometer": lab.accelerometer, "voltage": lab.voltage,
        "verdict": "unexplained_gap" if unlisted else "effects_found" if effects else "no_gap",
        "effects": [{"name": name, "parameters": values} for name, values in effects.items()],
        "unlisted": unlisted,
    }  # fmt: skip


def draw_circumstances(rng: np.random.Generator, frame: Airframe) -> Circumstances:
    """What a lab chose."""
    per_line = round(1.0 / STEP / rng.choice(RATES))
    small = frame.mass < 0.1
    voltage = bool(rng.random() < 0.7)
    return Circumstances(
        integrator=str(rng.choice(("RK4", "implicitfast", "Euler"))),
        pilot=int(rng.choice((pilots.CASCADED, pilots.GEOMETRIC))),
        ticks=int(rng.choice((2, 4))),
        per_line=per_line,
        phase=int(rng.integers(per_line)),
        speed_law=bool(rng.integers(2)),
        compensated=bool(rng.integers(2)),
        battery_lag=float(rng.choice((0.0, 0.2))),
        accelerometer=bool(rng.random() < 0.7),
        voltage=voltage,
        rest=3.0 if rng.random() < 0.6 else 0.0,
        gust=float(rng.uniform(0.5, 1.5)),
        pose_noise=float(rng.uniform(1e-4, 5e-4)) * (1.0 if small else 2.0),
        angle_noise=float(rng.uniform(5e-4, 2e-3)),
    )


def hide_something(
    size: str,
    frame: Airframe,
    lab: Circumstances,
    rng: np.random.Generator,
    known: Sequence[str] | None = None,
) -> tuple[Hidden, Effects, Unlisted]:
    """Nothing, one effect, two that nobody takes for one another, or something that has no name.

    `known` are the effects that a program can hide, all of `EFFECTS_HERE` where it is None.
    """
    kind = rng.random()
    if kind >= 0.85:
        return _unlisted(size, frame, rng)
    hidden, effects = Hidden(), Effects()
    names = [name for name in known or EFFECTS_HERE if _shows(name, lab)]
    for _ in range(0 if kind < 0.2 else 1 if kind < 0.65 else 2):
        name = str(rng.choice(names))
        hidden, new = hide(hidden, name, size, frame, rng)
        effects |= new
        near = {name, *EFFECTS[name].confused_with, *(effects if name == "wind" else ())}
        names = [other for other in names if other not in near]
    return hidden, effects, None


def hide(
    hidden: Hidden, name: str, size: str, frame: Airframe, rng: np.random.Generator
) -> tuple[Hidden, Effects]:
    """`hidden` with one more effect of a size of `SIZES`, and its parameters (a wind brings a drag)."""
    hidden, values = EFFECTS_HERE[name](hidden, _Drawing(name, size, frame, nominal(frame, name), rng))
    effects = {name: values}
    if name == "wind":
        effects["linear_drag"] = dict.fromkeys("xyz", hidden.linear_drag)
    return hidden, effects


def _shows(name: str, lab: Circumstances) -> bool:
    """Whether a log of this lab can tell (docs/gap_data.md, What a flight must hold)."""
    if name in ("thrust_scale", "mass_error", "battery_sag"):
        return lab.voltage
    return lab.accelerometer or name != "pose_offset"


@dataclass(frozen=True)
class _Drawing:
    """Draws the sizes of an effect, in what an ordinary vehicle of this size may show."""

    name: str
    size: str
    frame: Airframe
    vehicle: Vehicle
    rng: np.random.Generator

    def times(self) -> float:
        """How many times the typical size."""
        return float(self.rng.uniform(*SIZES[self.size]))

    def typical(self, key: str) -> float:
        """Distance of the typical value from where the effect does nothing, positive."""
        rules = EFFECTS[self.name].parameters[key].for_size(self.vehicle.size)
        return abs(rules.typical - (rules.neutral or 0.0))

    def sign(self) -> float:
        """One or the other."""
        return float(self.rng.choice((-1.0, 1.0)))

    def direction(self) -> np.ndarray:
        """Horizontal, of unit length."""
        angle = self.rng.uniform(-math.pi, math.pi)
        return np.array([math.cos(angle), math.sin(angle), 0.0])

    def shares(self, count: int) -> np.ndarray:
        """Shares of a size, the largest of them 1 or -1."""
        shares = self.rng.uniform(-1.0, 1.0, count)
        return np.asarray(shares / np.abs(shares).max())


Hide = Callable[[Hidden, _Drawing], tuple[Hidden, dict[str, float]]]


def _number(key: str, attribute: str, base: float, both_ways: bool) -> Hide:
    def hide(hidden: Hidden, drawing: _Drawing) -> tuple[Hidden, dict[str, float]]:
        off = drawing.times() * drawing.typical(key) * (drawing.sign() if both_ways else 1.0)
        return replace(hidden, **{attribute: base + off}), {key: base + off}

    return hide


def _vector(keys: tuple[str, ...], attribute: str, base: float = 0.0, positive: bool = False) -> Hide:
    """Random shares of one size along each key."""

    def hide(hidden: Hidden, drawing: _Drawing) -> tuple[Hidden, dict[str, float]]:
        shares = drawing.shares(len(keys))
        values = base + drawing.times() * drawing.typical(keys[0]) * (np.abs(shares) if positive else shares)
        return replace(hidden, **{attribute: tuple(values)}), dict(zip(keys, values.tolist(), strict=True))

    return hide


def _imbalance(hidden: Hidden, drawing: _Drawing) -> tuple[Hidden, dict[str, float]]:
    shares = drawing.rng.standard_normal(4)
    shares -= shares.mean()
    values = 1.0 + drawing.times() * drawing.typical("m1") * shares / np.abs(shares).max()
    return replace(hidden, motors=tuple(values)), dict(
        zip(("m1", "m2", "m3", "m4"), values.tolist(), strict=True)
    )


def _inertia(hidden: Hidden, drawing: _Drawing) -> tuple[Hidden, dict[str, float]]:
    """Of a body that can be: no moment is more than the other two together."""
    frame = drawing.frame
    while True:
        changed, values = _vector(("xx", "yy", "zz"), "inertia")(hidden, drawing)
        moments = np.array([frame.ix, frame.iy, frame.iz]) * (1.0 + np.array(changed.inertia))
        if 2.0 * moments.max() < moments.sum():
            return changed, values


def _area(hidden: Hidden, drawing: _Drawing) -> tuple[Hidden, dict[str, float]]:
    area = drawing.times() * drawing.typical("area_x")
    hidden = replace(hidden, area=area)
    faces = area * faces_of(drawing.frame, hidden)
    return hidden, dict(zip(("area_x", "area_y", "area_z"), faces.tolist(), strict=True))


def _linear(hidden: Hidden, drawing: _Drawing) -> tuple[Hidden, dict[str, float]]:
    value = drawing.times() * drawing.typical("x")
    return replace(hidden, linear_drag=value), dict.fromkeys("xyz", value)


def _wind(hidden: Hidden, drawing: _Drawing) -> tuple[Hidden, dict[str, float]]:
    """With a drag, without which no wind shows."""
    drag = drawing.rng.uniform(1.0, 2.0) * replace(drawing, name="linear_drag").typical("x")
    values = drawing.times() * drawing.rng.uniform(*WIND) * drawing.direction()
    hidden = replace(hidden, linear_drag=float(drag), wind=tuple(values))
    return hidden, dict(zip("xyz", values.tolist(), strict=True))


EFFECTS_HERE: dict[str, Hide] = {
    "thrust_scale": _number("scale", "thrust_scale", 1.0, both_ways=True),
    "motor_imbalance": _imbalance,
    "motor_lag": _number("scale", "lag_scale", 1.0, both_ways=False),
    "motor_lag_asymmetry": _number("ratio", "lag_ratio", 1.0, both_ways=False),
    "command_delay": _number("delay", "delay", 0.0, both_ways=False),
    "battery_sag": _number("resistance", "resistance", 0.0, both_ways=False),
    "mass_error": _number("relative", "mass", 0.0, both_ways=True),
    "inertia_error": _inertia,
    "com_offset": _vector(("x", "y", "z"), "centre"),
    "thrust_tilt": _vector(("x", "y"), "lean"),
    "linear_drag": _linear,
    "body_drag": _area,
    "wind": _wind,
    "velocity_moment": _vector(("roll", "pitch"), "velocity_moment"),
    "rate_damping": _vector(("x", "y", "z"), "rate_damping", positive=True),
    "pose_delay": _number("delay", "pose_delay", 0.0, both_ways=False),
    "pose_rotation": _vector(("x", "y", "z"), "pose_turn"),
    "pose_offset": _vector(("x", "y", "z"), "pose_offset"),
    "gyro_bias": _vector(("x", "y", "z"), "gyro_bias"),
}
"""What this program can hide, by the name of the effect."""


def _unlisted(size: str, frame: Airframe, rng: np.random.Generator) -> tuple[Hidden, Effects, Unlisted]:
    """A side wind in a slab of the room, or a part that is out of balance."""
    times = float(rng.uniform(*SIZES[size]) * rng.choice((-1.0, 1.0)))
    if rng.integers(2):
        low = float(rng.uniform(0.05, 0.2))
        slab = (0.35 * times, low, low + float(rng.uniform(0.4, 0.8)))
        where = {"channel": "force_y", "regressor": "x", "range_m": slab[1:], "acceleration_m_s2": slab[0]}
        return Hidden(slab=slab), {}, where
    axis = int(rng.integers(2))
    strength = 6.0 * times * (0.03 / frame.mass) ** 0.4
    hertz = float(rng.uniform(3.0, 8.0))
    turning = [0.0, 0.0, hertz]
    turning[axis] = strength
    where = {"channel": "torque_" + "xy"[axis], "regressor": "time", "frequency_hz": hertz}
    return Hidden(line=tuple(turning)), {}, {**where, "acceleration_rad_s2": strength}


def write_log(path: Path, log: np.ndarray) -> None:
    """A CSV of the `table` format with the columns that this lab measures."""
    measured = ~np.isnan(log).all(axis=0)
    names = [name for name, has in zip(HEADER.split(","), measured, strict=True) if has]
    np.savetxt(path, log[:, measured], "%.7g", ",", header=",".join(names), comments="")
