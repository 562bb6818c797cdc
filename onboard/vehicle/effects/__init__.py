"""All effects that a vehicle file may declare, by name: the tables beside this module, a file a domain.

A new one is one table in them, with the attributes of :class:`.description.EffectDescription` and, under
``parameters``, of :class:`.description.EffectParameter` (names that share a table stand in one key, with
blanks between), and one module of its name in ``sim_backend/physics/effects`` (docs/physics.md, Effects).
"""

from pathlib import Path

from onboard.vehicle.effects.description import Domain, EffectDescription, EffectParameter, Needs
from onboard.vehicle.effects.size import Size
from onboard.vehicle.effects.tables import read_effects

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

_FILES = ("actuation", "air", "rigid_body", "contact", "sensing")
EFFECTS: dict[str, EffectDescription] = read_effects(
    Path(__file__).with_name(f"{file}.toml") for file in _FILES
)
"""Every known effect, by name."""
