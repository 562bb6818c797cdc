"""All effects that a vehicle file may declare, by name. A new one is one entry in the module of its domain,
and one module of its name in ``sim_backend/physics/effects`` (docs/physics.md, Effects)."""

from onboard.vehicle.effects import actuation, air, contact, rigid_body, sensing
from onboard.vehicle.effects.air import AIR_FORCES
from onboard.vehicle.effects.description import Domain, EffectDescription, EffectParameter, Needs
from onboard.vehicle.effects.size import Size

__all__ = ["AIR_FORCES", "EFFECTS", "Domain", "EffectDescription", "EffectParameter", "Needs", "Size"]

EFFECTS: dict[str, EffectDescription] = {
    description.name: description
    for module in (actuation, air, rigid_body, contact, sensing)
    for description in module.DESCRIPTIONS
}
"""Every known effect, by name."""
