"""All effects of the physics by name, and how those of a vehicle get into its record of parameters."""

import importlib
import pkgutil
from pathlib import Path
from typing import Any

from onboard.vehicle import Vehicle
from sim_backend.errors import SimulationError
from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def collect_terms() -> dict[str, EffectTerm]:
    """The effect of each module of this package that has one, by name.

    Raises:
        SimulationError: an effect has not the name of its module.
    """
    found = {}
    for module in sorted(item.name for item in pkgutil.iter_modules([str(Path(__file__).parent)])):
        if module == "registry":
            continue
        term = getattr(importlib.import_module(f"{__package__}.{module}"), "EFFECT", None)
        if term is None:
            continue
        if term.name != module:  # else two modules could have one name, and one of them be lost
            raise SimulationError(
                f"sim_backend/physics/effects/{module}.py: its EFFECT is named {term.name!r}; it has "
                f"the name of its module: write {module!r}, or rename the module"
            )
        found[module] = term
    return found


TERMS = collect_terms()
"""Every effect that the physics has an equation for, by name."""

FIELDS: tuple[Field, ...] = tuple(field for term in TERMS.values() for field in term.fields)
"""What they add to the record of parameters."""

_SWITCHES = {
    Acts.COMMAND: "command_on",
    Acts.MOTORS: "motors_on",
    Acts.FORCES: "forces_on",
    Acts.SENSORS: "sensors_on",
}


def apply_effects(p: Any, vehicle: Vehicle) -> None:
    """Write the effects of a vehicle into its record of parameters.

    Raises:
        SimulationError: there is no equation for one of them.
    """
    missing = sorted({effect.name for effect in vehicle.effects} - set(TERMS))
    if missing:
        raise SimulationError(
            f"vehicle {vehicle.name!r} has the effect(s) {', '.join(missing)}, which the physics has no "
            "equation for: remove them from the vehicle file to simulate without them"
        )
    for effect in vehicle.effects:
        term = TERMS[effect.name]
        term.apply(p, effect.values())
        if term.acts in _SWITCHES:
            p[_SWITCHES[term.acts]] = 1
