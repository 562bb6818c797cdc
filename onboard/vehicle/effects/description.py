"""What an effect is, to people and to programs: name, where it acts, parameters with bounds, sources.

An effect is a deviation from the base model that a vehicle file may declare in an ``[[effects]]`` table. Its
equation is a module of the same name in ``sim_backend/physics/effects``; here is only what a vehicle file can
be checked against and what a search for a missing effect needs to know.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from onboard.quantity import Quantity
from onboard.vehicle.effects.size import Size


class Domain(StrEnum):
    """Where an effect acts."""

    ACTUATION = "actuation"
    """from the command to the thrust of the rotors"""
    AIR = "air"
    RIGID_BODY = "rigid_body"
    CONTACT = "contact"
    """legs, feet, ceiling"""
    SENSING = "sensing"
    """what the motion capture and the gyro report, not how the vehicle moves"""
    TIMING = "timing"


class Needs(StrEnum):
    """What else a vehicle file must hold for an effect to act at all."""

    LEGS = "legs"
    ROTOR_SPEED = "motors.thrust_coefficient"
    AIR_FORCE = "air force"


@dataclass(frozen=True, kw_only=True)
class EffectParameter:
    """One number of an effect, in SI units.

    Attributes:
        unit: SI unit.
        low, high: bounds of what is physically possible for a vehicle of the reference size.
        typical: value that an ordinary vehicle may show; the size to test a search with.
        neutral: value at which the parameter does nothing, taken when a file leaves it out; None: must be
            given.
        absent: value with which the whole effect is not there, where a file must give one (a string without
            stiffness); None: there is none but the neutral one.
        practical_minimum: smallest distance from the neutral value (from another value, where nothing is
            neutral) that is worth a name; below it a finding has no consequence for a flight.
        meaning: what it is.
        source: where the typical value comes from.
        spread: standard deviation about the typical value that is believed before any flight; None: nothing
            is known but the bounds.
        grows: powers of a vehicle's magnitudes (:class:`~onboard.vehicle.effects.size.Size`) with which
            bounds, typical and least size grow; empty for what is the same for vehicles of any size.
    """

    unit: str
    low: float
    high: float
    typical: float
    practical_minimum: float
    meaning: str
    source: str
    neutral: float | None = None
    absent: float | None = None
    spread: float | None = None
    grows: Mapping[str, float] = field(default_factory=dict)

    def for_size(self, size: Size) -> "EffectParameter":
        """The same for a vehicle of another size."""
        if not self.grows:
            return self
        ratio = size.ratio(self.grows)
        return replace(
            self,
            low=ratio * self.low,
            high=ratio * self.high,
            typical=ratio * self.typical,
            practical_minimum=ratio * self.practical_minimum,
        )


@dataclass(frozen=True, kw_only=True)
class EffectDescription:
    """A named effect.

    Attributes:
        name: as in ``[[effects]]`` and in the gap finder's report.
        domain: where it acts.
        equation: one line.
        parameters: by name.
        revealed_by: what a flight must do for the effect to show.
        measured_by: what measures it on the ground; empty: nothing does, as with most effects of the air.
        confused_with: effects that an ordinary flight can take for this one; the relation is symmetric.
        reference: paper or record that the equation is from.
        needs: what else the vehicle file must hold.
        excludes: effects that describe the same thing in another way.
        alike: effects that no flight tells from this one unless inertias are known better than they ever
            are; only `revealed_by` does.
        by_forces: it is a force whose torques are by-products, so that only forces are asked about it: the
            torques of a controlled vehicle answer disturbances, which passes for a drag many times as large.
        sized_by_forces: torques follow from it and speak for it, but forces alone say how large it is: what
            turns a body is thrust over inertia, and inertias are known to tenths, a mass to thousandths.
        may_differ: flights of one vehicle may each have their own: the air, the load, pack, propellers and
            trim of the day. What cannot differ and does stands in for something else.
    """

    name: str
    domain: Domain
    equation: str
    parameters: Mapping[str, EffectParameter]
    revealed_by: str
    reference: str
    measured_by: str = ""
    confused_with: tuple[str, ...] = ()
    needs: tuple[Needs, ...] = ()
    excludes: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()
    by_forces: bool = False
    sized_by_forces: bool = False
    may_differ: bool = False

    def values(self, given: Mapping[str, Quantity]) -> dict[str, float]:
        """Every parameter's value (SI), those that are not given at their neutral value.

        Raises:
            KeyError: a parameter without a neutral value is missing (a checked file has it).
        """
        complete = {}
        for name, parameter in self.parameters.items():
            if name in given:
                complete[name] = given[name].value
            elif parameter.neutral is None:
                raise KeyError(f"effect {self.name}: parameter {name} is missing")
            else:
                complete[name] = parameter.neutral
        return complete
