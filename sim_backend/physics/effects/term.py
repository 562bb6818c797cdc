"""What a module of an effect hands to the physics."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any, NamedTuple


class Acts(StrEnum):
    """Which part of the physics looks at an effect."""

    ONCE = "once"
    """changes parameters of the base model when the record is made, and costs nothing afterwards"""
    COMMAND = "command"
    """changes what the motors head for"""
    MOTORS = "motors"
    """changes how they get there"""
    FORCES = "forces"
    """adds to force and torque of free flight"""
    SENSORS = "sensors"
    """changes what is measured; the physics only carries the numbers"""


class Field(NamedTuple):
    """A field of the record of parameters: float64, of this shape, with the value that does nothing."""

    name: str
    shape: tuple[int, ...] = ()
    default: float = 0.0


class EffectTerm(NamedTuple):
    """One effect of the physics.

    Attributes:
        name: that of its description (:data:`onboard.vehicle.effects.EFFECTS`).
        acts: which part of the physics looks at it.
        apply: writes the effect's parameters (SI, all of them) into a record of parameters.
        fields: fields that the effect adds to the record.
    """

    name: str
    acts: Acts
    apply: Callable[[Any, Mapping[str, float]], None]
    fields: tuple[Field, ...] = ()
