"""Cases: which effects are hidden, and what a finder that is right says of them (the sealed answer)."""

import math
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tests.truth.hidden_effects.effects import SIZES, apply, draw
from tests.truth.hidden_effects.flight import hidden_flight
from tests.truth.hidden_effects.layout import GRAVITY
from tests.truth.hidden_effects.log_file import SAMPLE_PERIOD
from tests.truth.hidden_effects.rotors import settled_thrusts
from tests.truth.hidden_effects.shapes import AGILE, ALOFT, HOME

SCHEMA = "perchhw.gap_truth/1"

SINGLE = (
    "thrust_scale",
    "mass_error",
    "battery_sag",
    "motor_warming",
    "motor_lag",
    "motor_lag_asymmetry",
    "command_delay",
    "rotor_drag",
    "body_drag",
    "inflow_thrust_loss",
    "translational_lift",
    "velocity_moment",
    "rate_damping",
    "rotor_gyroscopic",
    "rotor_acceleration_torque",
    "inertia_error",
    "com_offset",
    "motor_imbalance",
    "motor_saturation",
    "thrust_curve",
    "ceiling_effect",
    "ground_effect",
    "thrust_tilt",
    "pose_delay",
    "pose_rotation",
    "pose_offset",
    "gyro_bias",
    "tether",
)
"""Cases of one effect, by its name."""
SEVERAL = {"two": 2, "three": 3}
MIXED = (
    "thrust_scale",
    "battery_sag",
    "motor_lag",
    "rotor_drag",
    "velocity_moment",
    "inertia_error",
    "com_offset",
    "ground_effect",
    "pose_rotation",
    "gyro_bias",
)
"""Effects that `two` and `three` choose from: no two of them are alike."""
CASES = ("none", *SINGLE, "wind", *SEVERAL, "unlisted_force_region", "unlisted_torque_line")

ALIKE: dict[str, tuple[str, ...]] = {
    "thrust_scale": ("mass_error",),
    "mass_error": ("thrust_scale",),
    "command_delay": ("motor_lag",),
    "motor_lag": ("command_delay",),
    "motor_lag_asymmetry": ("motor_lag", "command_delay"),
    "com_offset": ("motor_imbalance",),
    "motor_imbalance": ("com_offset",),
    "rotor_drag": ("body_drag",),
    "body_drag": ("rotor_drag",),
    "thrust_tilt": ("com_offset", "pose_rotation"),
    "rate_damping": ("inflow_thrust_loss",),
    "tether": ("unexplained",),
}
"""Names that a report may give as ambiguous with the true one; exactly alike are only scale and mass."""

_CLIPPED = (0.01, 0.05, 0.15)
_REGION, _LINE = (0.1, 0.3, 0.8), (2.0, 6.0, 15.0)
_WIND_DRAG = 1e-6


@dataclass
class Hidden:
    """The true vehicle of a case, and its answer."""

    vehicle: np.ndarray
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    unlisted: dict[str, Any] | None = None

    def add(self, name: str, values: dict[str, float]) -> None:
        """Give the vehicle an effect."""
        apply(self.vehicle, name, values)
        self.effects[name] = values

    def answer(self, **circumstances: Any) -> dict[str, Any]:
        """The document for the sealed file."""
        verdict = "unexplained_gap" if self.unlisted else "effects_found" if self.effects else "no_gap"
        effects = [
            {
                "name": name,
                "parameters": values,
                "acceptable_ambiguous": list(ALIKE.get(name, ())),
                **_derived(name, values, self.vehicle),
            }
            for name, values in self.effects.items()
        ]
        return {
            "schema": SCHEMA,
            **circumstances,
            "verdict": verdict,
            "effects": effects,
            "unlisted": self.unlisted,
        }


def hide(case: str, size: str, seed: int, vehicle: np.ndarray) -> Hidden:
    """Change the nominal `vehicle` as the case says; `size` is one of `SIZES`.

    Raises:
        ValueError: no such case or size.
    """
    if case not in CASES or size not in SIZES:
        raise ValueError(f"unknown case {case!r} or size {size!r}; cases: {', '.join(CASES)}; sizes: {SIZES}")
    rng = np.random.default_rng([seed, zlib.crc32(case.encode()), SIZES.index(size)])
    hidden = Hidden(vehicle.copy())
    if case in SEVERAL:
        for name in rng.choice(MIXED, SEVERAL[case], replace=False).tolist():
            hidden.add(name, draw(name, size, rng))
    elif case == "wind":
        hidden.add("rotor_drag", {"coefficient": float(_WIND_DRAG * rng.uniform(0.85, 1.15))})
        hidden.add("wind", draw("wind", size, rng))
    elif case == "motor_saturation":
        share = float(_CLIPPED[SIZES.index(size)] * rng.uniform(0.85, 1.15))
        hidden.add(case, {"thrust_limit": _limit_that_clips(hidden.vehicle, share, seed)})
    elif case == "unlisted_force_region":
        _region(hidden, _REGION[SIZES.index(size)], rng)
    elif case == "unlisted_torque_line":
        _line(hidden, _LINE[SIZES.index(size)], rng)
    elif case != "none":
        hidden.add(case, draw(case, size, rng))
    return hidden


def _limit_that_clips(vehicle: np.ndarray, share: float, seed: int) -> float:
    """Thrust (N) that a `share` of the motor commands of agile flights exceeds, flown with that limit."""
    p = vehicle.copy()
    # With a limit the controller asks for more: the limit is above what free flights would say.
    low = float(np.quantile(_agile_commands(p, seed), 1.0 - share))
    high = 1.06 * low
    for _ in range(3):
        limit = 0.5 * (low + high)
        p["thrust_limit"] = limit
        clipped = np.mean(_agile_commands(p, seed) > limit)
        low, high = (low, limit) if clipped < share else (limit, high)
    return 0.5 * (low + high)


def _agile_commands(p: np.ndarray, seed: int) -> np.ndarray:
    """Thrusts (N) that the motors are told during the manoeuvres of agile flights."""
    told = []
    for number, shape in enumerate(AGILE):
        flight = hidden_flight(p, shape, shape, seed, number)
        aloft = flight.log[round(ALOFT / SAMPLE_PERIOD) : round(HOME / SAMPLE_PERIOD), 13:18]
        told.append(settled_thrusts(flight.parameters, aloft).ravel())
    return np.concatenate(told)


def _region(hidden: Hidden, strength: float, rng: np.random.Generator) -> None:
    """A side wind, say, in a slab of the room."""
    p = hidden.vehicle
    low = float(rng.uniform(0.05, 0.25))
    high = low + float(rng.uniform(0.35, 0.5))
    push = float(rng.choice((-1.0, 1.0)) * strength * rng.uniform(0.85, 1.15))
    p["region"], p["region_force"][1] = (low, high), push * p["filed_mass"]
    hidden.unlisted = {
        "channel": "force_y",
        "frame": "world",
        "regressor": "x",
        "range_m": [low, high],
        "acceleration_m_s2": push,
    }


def _line(hidden: Hidden, strength: float, rng: np.random.Generator) -> None:
    """An unbalanced part that turns, say."""
    p = hidden.vehicle
    axis = int(rng.integers(2))
    hertz, size = float(rng.uniform(3.0, 8.0)), float(strength * rng.uniform(0.85, 1.15))
    p["line_hertz"], p["line_torque"][axis] = hertz, size * p["filed_inertia"][axis]
    hidden.unlisted = {
        "channel": "torque_" + "xy"[axis],
        "frame": "body",
        "regressor": "time",
        "frequency_hz": hertz,
        "acceleration_rad_s2": size,
    }


def _derived(name: str, values: dict[str, float], p: np.ndarray) -> dict[str, Any]:
    """What the data can tell of an effect whose parameters share their work."""
    if name == "ceiling_effect":
        gap = 0.05
        gamma = 0.5 + 0.5 * math.sqrt(1 + (p["rotor_radius"] / values["opening"] / gap) ** 2 / 8)
        b = values["inflow"] / gamma
        root = (math.sqrt(b * b + 4 * (1 + values["inflow"])) - b) / 2
        return {"derived": {"thrust_gain_at_50_mm": root * root}}
    if name == "wind":
        drag = 4 * p["rotor_drag"] * math.sqrt(p["hover_thrust"] / p["thrust_per_speed2"]) / p["mass"]
        return {"derived": {"acceleration_m_s2": drag * math.hypot(values["x"], values["y"])}}
    if name == "com_offset":
        lever = math.hypot(values["x"], values["y"])
        return {"derived": {"torque_in_hover_n_m": lever * p["mass"] * GRAVITY}}
    return {}
