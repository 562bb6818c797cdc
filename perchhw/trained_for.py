"""The vehicle that a policy was trained for, as its provenance keeps it, held against the one that flies."""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import hypot
from typing import Any

from onboard.policy.model import Policy
from onboard.quantity import Quantity, convert
from onboard.vehicle import Legs, Vehicle, VehicleFileError, known_vehicles, load_vehicle

TRAINED_FOR = "trained_for"
"""Key in the provenance of a policy."""
SIGMAS = 3.0
"""Two figures are the same when they differ by no more of their joint standard uncertainties."""
LEAST_TOLERANCE = 0.02
"""Share of a figure that is never held against anybody: files also hold numbers without an uncertainty."""
PAPER_MASS, PAPER_INERTIA = 0.5e-3, 1.5e-6
"""kg, kg m2. Standard deviations of the paper's domain randomisation, with which older policies were trained
(``perchhw.learning.domain_randomisation``)."""


@dataclass(frozen=True)
class _Figure:
    """A figure of the vehicle that decides how a flip goes: in words, and in the unit that people say."""

    words: str
    unit: str
    of: Callable[[Vehicle], Quantity | None]


def _of_legs(take: Callable[[Legs], Quantity]) -> Callable[[Vehicle], Quantity | None]:
    return lambda vehicle: None if vehicle.legs is None else take(vehicle.legs)


_BODY = {
    "mass": _Figure("a mass", "g", lambda v: v.body.mass),
    "inertia_yy": _Figure("a pitch inertia", "kg m2", lambda v: v.body.inertia_yy),
    "arm_x": _Figure("an arm", "mm", lambda v: v.body.arm_x),
    "thrust_max": _Figure("a largest thrust of a motor", "N", lambda v: v.motors.thrust_max),
}
_LEGS = {
    "leg_angle": _Figure("a leg angle", "deg", _of_legs(lambda legs: legs.angle_deg)),
    "leg_length": _Figure("a leg length", "mm", _of_legs(lambda legs: legs.length)),
}
_FIGURES = _BODY | _LEGS


@dataclass(frozen=True)
class TrainedFor:
    """What a policy was trained for.

    Attributes:
        vehicle: its name. legs: of the leg design.
        figures: by name; the sigma holds what the training drew at random.
    """

    vehicle: str
    legs: str
    figures: Mapping[str, Quantity]

    def document(self) -> dict[str, Any]:
        """As the provenance of a policy holds it."""
        figures = {
            name: {"value": q.value, "unit": q.unit, "sigma": q.sigma} for name, q in self.figures.items()
        }
        return {"vehicle": self.vehicle, "legs": self.legs, **figures}

    def other_than(self, policy: str, vehicle: Vehicle) -> tuple[str, ...]:
        """In what `vehicle` is another one, one sentence each; empty when the policy may fly it."""
        legs, body = self._differing(vehicle, _LEGS), self._differing(vehicle, _BODY)
        found = []
        learn = f"perchhw learn all --vehicle {vehicle.name}"
        if vehicle.legs is None:
            learn += f" --legs {self.legs}"
            found.append(
                f"{vehicle.name} has no legs, and policy {policy!r} was trained to land on {self.legs} ones: "
                f"give the legs that it has (--legs {self.legs}), or a vehicle that has some"
            )
        elif legs:
            found.append(
                f"policy {policy!r} was trained for {self.legs} legs, this vehicle has {vehicle.legs.design} "
                f"ones ({'; '.join(legs)}): give --legs {self.legs}, or a policy that was trained for "
                f"{vehicle.legs.design} (perchhw learn all --legs {vehicle.legs.design})"
            )
        if body:
            found.append(
                f"policy {policy!r} was trained for {self.vehicle}, and {vehicle.name} is another vehicle "
                f"({'; '.join(body)}): give --vehicle {self.vehicle}, or a policy that was trained for "
                f"{vehicle.name} ({learn})"
            )
        return tuple(found)

    def _differing(self, vehicle: Vehicle, figures: Mapping[str, _Figure]) -> list[str]:
        found = []
        for name, figure in figures.items():
            ours, theirs = self.figures.get(name), figure.of(vehicle)
            if ours is not None and theirs is not None and _apart(ours, theirs):
                found.append(
                    f"trained with {figure.words} of {_said(ours, figure.unit)}, "
                    f"flown with {_said(theirs, figure.unit)}"
                )
        return found


def trained_for(vehicle: Vehicle, *, mass: float = 0.0, inertia_yy: float = 0.0) -> TrainedFor:
    """What a policy is trained for that learns on `vehicle`.

    Args:
        vehicle: with its legs.
        mass, inertia_yy: standard deviations with which the training drew them, kg and kg m2.
    """
    drawn = {"mass": mass, "inertia_yy": inertia_yy}
    figures = {}
    for name, figure in _FIGURES.items():
        quantity = figure.of(vehicle)
        if quantity is not None:
            sigma = hypot(quantity.sigma, drawn.get(name, 0.0))
            figures[name] = dataclasses.replace(quantity, sigma=sigma, source="trained for")
    return TrainedFor(vehicle.name, "no" if vehicle.legs is None else vehicle.legs.design, figures)


def trained_for_of(policy: Policy) -> TrainedFor | None:
    """What `policy` was trained for; None where its provenance does not say it.

    Policies from before it was kept in full name vehicle and legs of their sweep: those of a vehicle that
    ships with the code are looked up there.
    """
    kept = policy.provenance.get(TRAINED_FOR)
    if isinstance(kept, Mapping):
        return _from_document(kept)
    settings = _settings(policy.provenance)
    name, design = settings.get("vehicle"), settings.get("legs")
    if name not in known_vehicles():
        return None
    try:
        vehicle = load_vehicle(name, design)
    except VehicleFileError:
        return None
    if vehicle.legs is not None:
        vehicle = dataclasses.replace(vehicle, legs=_as_swept(vehicle.legs, settings))
    return trained_for(vehicle, mass=PAPER_MASS, inertia_yy=PAPER_INERTIA)


def _settings(provenance: Mapping[str, Any]) -> Mapping[str, Any]:
    sweep = provenance.get("sweep")
    settings = sweep.get("settings") if isinstance(sweep, Mapping) else None
    return settings if isinstance(settings, Mapping) else {}


def _as_swept(legs: Legs, settings: Mapping[str, Any]) -> Legs:
    """The legs of a sweep that replaced angle or length of its design."""
    changed: dict[str, Any] = {}
    for field, key, unit in (("angle_deg", "leg_angle_deg", "deg"), ("length", "leg_length_m", "m")):
        value = settings.get(key)
        if isinstance(value, int | float):
            changed[field] = Quantity(float(value), unit, 0.0, "sweep")
    return dataclasses.replace(legs, design="custom", **changed) if changed else legs


def _from_document(kept: Mapping[str, Any]) -> TrainedFor | None:
    """None where it was written by hand and cannot be read."""
    figures = {}
    for name in _FIGURES.keys() & kept.keys():
        table = kept[name]
        if not isinstance(table, Mapping) or not isinstance(table.get("value"), int | float):
            return None
        figures[name] = Quantity(
            float(table["value"]), str(table.get("unit")), float(table.get("sigma", 0.0)), "trained for"
        )
    if not figures:
        return None
    return TrainedFor(str(kept.get("vehicle")), str(kept.get("legs")), figures)


def _apart(ours: Quantity, theirs: Quantity) -> bool:
    tolerance = max(SIGMAS * hypot(ours.sigma, theirs.sigma), LEAST_TOLERANCE * abs(ours.value))
    return not abs(ours.value - theirs.value) <= tolerance


def _said(quantity: Quantity, unit: str) -> str:
    return f"{convert(quantity.value, quantity.unit, unit):.3g} {unit}"
