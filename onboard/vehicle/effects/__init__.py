"""All effects that a vehicle file may declare, by name: the tables beside this module, a file a domain.

A new one is one table in them, with the attributes of :class:`.description.EffectDescription` and, under
``parameters``, of :class:`.description.EffectParameter` (names that share a table stand in one key, with
blanks between), and one module of its name in ``sim_backend/physics/effects`` (docs/physics.md, Effects).
"""

import tomllib
from pathlib import Path
from typing import Any

from onboard.vehicle.effects.description import Domain, EffectDescription, EffectParameter, Needs
from onboard.vehicle.effects.size import Size

__all__ = ["AIR_FORCES", "EFFECTS", "Domain", "EffectDescription", "EffectParameter", "Needs", "Size"]

AIR_FORCES = (
    "rotor_drag",
    "linear_drag",
    "body_drag",
    "inflow_thrust_loss",
    "translational_lift",
    "velocity_moment",
)
"""Effects that depend on the motion through the air, and so on the wind."""


def described(text: str) -> dict[str, EffectDescription]:
    """The effects of a file's text, by name."""
    return {name: _described(name, table) for name, table in tomllib.loads(text).items()}


def _described(name: str, table: dict[str, Any]) -> EffectDescription:
    others: Any = {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}
    others |= {
        "domain": Domain(table["domain"]),
        "needs": tuple(Needs(need) for need in table.get("needs", ())),
        "parameters": {
            parameter: EffectParameter(**rule)
            for alike, rule in table["parameters"].items()
            for parameter in alike.split()
        },
    }
    return EffectDescription(name=name, **others)


_FILES = ("actuation", "air", "rigid_body", "contact", "sensing")
EFFECTS: dict[str, EffectDescription] = {
    name: description
    for file in _FILES
    for name, description in described(
        Path(__file__).with_name(f"{file}.toml").read_text(encoding="utf-8")
    ).items()
}
"""Every known effect, by name."""
