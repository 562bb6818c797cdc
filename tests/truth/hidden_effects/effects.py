"""What the named effects change in the record of the true vehicle, and how big the hidden ones are."""

from collections.abc import Callable, Mapping

import numpy as np

from tests.truth.hidden_effects.layout import CONTROL_PERIOD, SUBSTEPS

Values = Mapping[str, float]
SIZES = ("weak", "medium", "strong")


def apply(p: np.ndarray, name: str, values: Values) -> None:
    """Give the vehicle (record of `layout.PARAMETERS`) the effect, parameters in SI units."""
    _APPLY[name](p, values)


def draw(name: str, size: str, rng: np.random.Generator) -> dict[str, float]:
    """Random parameters of an effect at a size of `SIZES`."""
    return _DRAW[name](SIZES.index(size), rng)


def _axes(v: Values) -> tuple[float, float, float]:
    return v["x"], v["y"], v["z"]


def _scale(key: str, *fields: str) -> Callable[[np.ndarray, Values], None]:
    def change(p: np.ndarray, v: Values) -> None:
        for field in fields:
            p[field] *= v[key]

    return change


def _set(field: str, *keys: str) -> Callable[[np.ndarray, Values], None]:
    def change(p: np.ndarray, v: Values) -> None:
        p[field] = v[keys[0]] if len(keys) == 1 else [v[key] for key in keys]

    return change


def _sag(p: np.ndarray, v: Values) -> None:
    p["ohms"] += v["resistance"]


def _warming(p: np.ndarray, v: Values) -> None:
    p["warming_loss"], p["warming_time"] = v["loss"], v["time_constant"]


def _asymmetry(p: np.ndarray, v: Values) -> None:
    root = np.sqrt(v["ratio"])
    p["tau_up"] /= root
    p["tau_down"] *= root


def _imbalance(p: np.ndarray, v: Values) -> None:
    p["gain"] *= [v["m1"], v["m2"], v["m3"], v["m4"]]


def _inertia(p: np.ndarray, v: Values) -> None:
    p["inertia"] *= 1.0 + np.array([v["xx"], v["yy"], v["zz"]])


def _mass(p: np.ndarray, v: Values) -> None:
    p["mass"] *= 1.0 + v["relative"]


def _centre(p: np.ndarray, v: Values) -> None:
    """Rotors, hull, sensors and markers stay where they are on the frame; the origin moves."""
    for field in ("hub", "corner", "tracked", "imu"):
        p[field] -= _axes(v)


def _markers(p: np.ndarray, v: Values) -> None:
    p["tracked"] += _axes(v)


def _lean(p: np.ndarray, v: Values) -> None:
    axis = np.array([np.tan(v["x"]), np.tan(v["y"]), 1.0])
    p["axis"] = axis / np.linalg.norm(axis)


def _ceiling(p: np.ndarray, v: Values) -> None:
    p["ceiling_inflow"], p["ceiling_opening"] = v["inflow"], v["opening"]


def _tether(p: np.ndarray, v: Values) -> None:
    p["tether_end"] = _axes(v)
    p["tether_length"], p["tether_stiffness"] = v["length"], v["stiffness"]
    p["tether_damping"] = v["damping"]


_APPLY: dict[str, Callable[[np.ndarray, Values], None]] = {
    "thrust_scale": _scale("scale", "gain"),
    "thrust_curve": _set("curvature", "curvature"),
    "battery_sag": _sag,
    "motor_warming": _warming,
    "motor_lag": _scale("scale", "tau_up", "tau_down"),
    "motor_lag_asymmetry": _asymmetry,
    "motor_imbalance": _imbalance,
    "motor_saturation": _set("thrust_limit", "thrust_limit"),
    "command_delay": _set("command_delay", "delay"),
    "rotor_drag": _set("rotor_drag", "coefficient"),
    "body_drag": _set("blunt_area", "area_x", "area_y", "area_z"),
    "inflow_thrust_loss": _set("inflow_loss", "coefficient"),
    "translational_lift": _set("lift_inflow", "inflow"),
    "ceiling_effect": _ceiling,
    "ground_effect": _set("ground_strength", "strength"),
    "wind": _set("wind", "x", "y", "z"),
    "velocity_moment": _set("velocity_moment", "roll", "pitch"),
    "rate_damping": _set("rate_damping", "x", "y", "z"),
    "rotor_gyroscopic": _set("gyroscopic_inertia", "rotor_inertia"),
    "rotor_acceleration_torque": _set("accelerated_inertia", "rotor_inertia"),
    "mass_error": _mass,
    "inertia_error": _inertia,
    "com_offset": _centre,
    "thrust_tilt": _lean,
    "tether": _tether,
    "pose_delay": _set("pose_delay", "delay"),
    "pose_rotation": _set("pose_turn", "x", "y", "z"),
    "pose_offset": _markers,
    "gyro_bias": _set("gyro_bias", "x", "y", "z"),
}
EFFECT_NAMES = tuple(_APPLY)


def _about(rng: np.random.Generator, typical: float) -> float:
    """A size within 15 % of the typical one, so that no two seeds hide the same number."""
    return float(typical * rng.uniform(0.85, 1.15))


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice((-1.0, 1.0)))


def _more(
    key: str, typical: tuple[float, float, float], base: float = 0.0
) -> Callable[..., dict[str, float]]:
    """One parameter beyond `base`, always upwards."""
    return lambda k, rng: {key: base + _about(rng, typical[k])}


def _off(key: str, typical: tuple[float, float, float], base: float = 0.0) -> Callable[..., dict[str, float]]:
    """One parameter on either side of `base`."""
    return lambda k, rng: {key: base + _sign(rng) * _about(rng, typical[k])}


def _each(
    keys: str, typical: tuple[float, float, float], signed: bool = False
) -> Callable[..., dict[str, float]]:
    """Several parameters of about the same size."""

    def sizes(k: int, rng: np.random.Generator) -> dict[str, float]:
        sign = _sign(rng) if signed else 1.0
        return {key: sign * _about(rng, typical[k]) for key in keys.split()}

    return sizes


def _flat(typical: tuple[float, float, float], flat: str = "z") -> Callable[..., dict[str, float]]:
    """A vector of a given length and any direction in the horizontal plane; the axis `flat` is left out."""

    def vector(k: int, rng: np.random.Generator) -> dict[str, float]:
        length, angle = _about(rng, typical[k]), rng.uniform(0.0, 2.0 * np.pi)
        values = {"x": float(length * np.cos(angle)), "y": float(length * np.sin(angle))}
        return {**values, "z": 0.0} if flat else values

    return vector


def _anywhere(typical: tuple[float, float, float]) -> Callable[..., dict[str, float]]:
    """A vector of a given length and any direction in space."""

    def vector(k: int, rng: np.random.Generator) -> dict[str, float]:
        way = rng.standard_normal(3)
        way *= _about(rng, typical[k]) / np.linalg.norm(way)
        return dict(zip("xyz", way.tolist(), strict=True))

    return vector


def _weak_motor(k: int, rng: np.random.Generator) -> dict[str, float]:
    gains = dict.fromkeys(("m1", "m2", "m3", "m4"), 1.0)
    gains[str(rng.choice(list(gains)))] -= _about(rng, (0.015, 0.05, 0.12)[k])
    return gains


def _warm(k: int, rng: np.random.Generator) -> dict[str, float]:
    return {"loss": _about(rng, (0.01, 0.025, 0.06)[k]), "time_constant": _about(rng, 12.0)}


def _string(k: int, rng: np.random.Generator) -> dict[str, float]:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    place = {"x": float(1.3 * np.cos(angle)), "y": float(1.3 * np.sin(angle)), "z": 0.1}
    return {**place, "length": 1.0, "stiffness": _about(rng, (0.015, 0.06, 0.15)[k]), "damping": 0.0}


def _gap(k: int, rng: np.random.Generator) -> dict[str, float]:
    return {"inflow": 1.0, "opening": _about(rng, (0.5, 0.28, 0.24)[k])}


def _late(k: int, rng: np.random.Generator) -> dict[str, float]:
    """A delay in whole steps of the integrator, which is how it acts."""
    step = CONTROL_PERIOD / SUBSTEPS
    return {"delay": round(_about(rng, (0.004, 0.008, 0.015)[k]) / step) * step}


_DEGREE = float(np.deg2rad(1.0))
_DRAW: dict[str, Callable[[int, np.random.Generator], dict[str, float]]] = {
    "thrust_scale": _off("scale", (0.02, 0.06, 0.15), 1.0),
    "thrust_curve": _off("curvature", (0.02, 0.06, 0.15)),
    "battery_sag": _more("resistance", (0.02, 0.06, 0.15)),
    "motor_warming": _warm,
    "motor_lag": _more("scale", (0.15, 0.4, 1.0), 1.0),
    "motor_lag_asymmetry": _more("ratio", (0.2, 0.6, 1.5), 1.0),
    "motor_imbalance": _weak_motor,
    "command_delay": _late,
    "rotor_drag": _more("coefficient", (0.3e-6, 1e-6, 3e-6)),
    "body_drag": _each("area_x area_y area_z", (0.002, 0.006, 0.02)),
    "inflow_thrust_loss": _more("coefficient", (0.3e-6, 1e-6, 3e-6)),
    "translational_lift": _more("inflow", (0.4, 1.2, 3.5)),
    "ceiling_effect": _gap,
    "ground_effect": _more("strength", (2.0, 5.0, 12.0)),
    "wind": _flat((0.3, 0.8, 1.6)),
    "velocity_moment": _each("roll pitch", (1e-5, 6e-5, 2e-4), signed=True),
    "rate_damping": _each("x y z", (4e-6, 1.6e-5, 5e-5)),
    "rotor_gyroscopic": _more("rotor_inertia", (2e-8, 1e-7, 5e-7)),
    "rotor_acceleration_torque": _more("rotor_inertia", (6e-9, 2e-8, 6e-8)),
    "mass_error": _off("relative", (0.02, 0.06, 0.15)),
    "inertia_error": _each("xx yy zz", (0.05, 0.15, 0.4), signed=True),
    "com_offset": _flat((0.0005, 0.002, 0.005)),
    "thrust_tilt": _flat((0.005, 0.02, 0.06), flat=""),
    "tether": _string,
    "pose_delay": _more("delay", (0.004, 0.010, 0.025)),
    "pose_rotation": _anywhere((0.5 * _DEGREE, 2 * _DEGREE, 5 * _DEGREE)),
    "pose_offset": _anywhere((0.003, 0.01, 0.03)),
    "gyro_bias": _anywhere((0.004, 0.02, 0.08)),
}
