"""Effects that may be missing: which parameters to search for, and from where.

Most effects can be linearised about the value at which they do nothing. Some cannot: a limit that is never
reached, a ceiling that is far away or a slack string have no derivative. Those start from several values.
"""

from collections.abc import Collection, Container, Sequence
from typing import NamedTuple

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.acceptance import stuck
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.replay.teacher_forcing import teacher_forced
from calibration.gap.search.bounds import other_axes
from calibration.gap.search.instants import Instants
from onboard.vehicle import EFFECTS, Vehicle
from onboard.vehicle.effects import AIR_FORCES, Domain, EffectDescription, Needs

SCALES = ("thrust_scale", "mass_error")
"""What lifts more or less with all motors alike."""

_ELSEWHERE = {"pose_delay", "motor_speed_law"}
"""Timing of poses is judged without a vehicle model; the speed law is another form of the motor lag."""

_DYNAMIC = {Domain.ACTUATION, Domain.AIR, Domain.RIGID_BODY, Domain.TIMING}
_IN_VOLTAGE = {"thrust_scale", "mass_error", "battery_sag", "motor_warming"}
"""What a voltage that was made to carry the vehicle has taken in, and what an emptying pack does unseen."""

_WIND_DIRECTIONS, _WIND_SPEEDS = 4, (1.0, 6.0)
"""Directions and speeds (m/s) from which a wind is sought together with the drag that makes it felt."""

_OPENINGS = (0.9, 0.35)
"""Shares of a rotor's rim through which air can enter."""

_TETHER = tuple(Variable("tether", name) for name in ("x", "y", "z", "length", "stiffness"))

_ABOVE = (0.02, 0.04, 0.07, 0.12, 0.25)
"""m, ceiling above the highest rotor flown, where nobody said how high it is."""


class Candidate(NamedTuple):
    """An effect that may be missing.

    Attributes:
        effect: its name.
        variables: parameters to fit, of other effects too that it cannot be without.
        starts: models to start from; the first is the present one where that has a derivative.
        at_bound: parameters that are not fitted, as the flights ask for them beyond their bounds.
    """

    effect: str
    variables: tuple[Variable, ...]
    starts: tuple[Model, ...]
    at_bound: tuple[Variable, ...] = ()

    @property
    def effects(self) -> frozenset[str]:
        """Its own name, and those of effects that it cannot be without."""
        return frozenset({self.effect, *(v.effect for v in self.variables)})

    def along_other_axes(self, left_out: Collection[Variable]) -> "Candidate | None":
        """The same effect with the vehicle file's value along the axes `left_out`; None where none is, where
        its parameters are not one quantity along several, or where none would be left."""
        rest = other_axes(self.effect, self.variables, left_out)
        return self._replace(variables=rest, at_bound=tuple(left_out)) if rest else None


def candidates(
    model: Model, records: Sequence[FlightRecord], among: Container[str] | None = None
) -> list[Candidate]:
    """Every effect of free flight, or of those `among` some names, that this vehicle could have and the model
    does not search for yet."""
    found = []
    made = not any(record.voltage_measured for record in records)
    for description in EFFECTS.values():
        if description.domain not in _DYNAMIC or description.name in {*_ELSEWHERE, *model.effects}:
            continue
        if among is not None and description.name not in among:
            continue
        if made and description.name in _IN_VOLTAGE:
            continue
        if description.name == "wind" and not _met(Needs.AIR_FORCE, model):
            found.append(_wind(model))
            continue
        if any(not _met(need, model) for need in description.needs):
            continue
        if not set(description.alike).isdisjoint(model.effects):
            continue  # scale and mass together would be a claim about inertia
        found.append(_candidate(description, model, records))
    return [candidate for candidate in found if candidate.starts]


def candidates_for(
    present: Fitted, training: Training, among: Container[str] | None = None
) -> list[Candidate]:
    """Candidates for what `present` lacks, all or those `among` some names.

    Forces without a derivative (a far ceiling, a slack string) start from what fits single instants of the
    flights best, a ceiling of unknown height from what does so at each of several heights and at any.
    """
    found = candidates(present.model, training.records, among)
    instants: Instants | None = None
    for index, candidate in enumerate(found):
        if candidate.starts[0] is present.model or EFFECTS[candidate.effect].domain is Domain.ACTUATION:
            continue
        if instants is None:
            signals = training.regression.signals
            misfit = training.regression.misfit(present.predicted)
            instants = Instants(present.model, training.records, signals, misfit)
        found[index] = candidate._replace(starts=(_deepest(candidate, present.model, instants),))
    return found


def _met(need: Needs, model: Model) -> bool:
    vehicle: Vehicle = model.base
    match need:
        case Needs.LEGS:
            return vehicle.legs is not None
        case Needs.ROTOR_SPEED:
            return vehicle.motors.thrust_coefficient is not None
        case Needs.AIR_FORCE:
            drags = (vehicle.air.drag_x.value, vehicle.air.drag_y.value, vehicle.air.drag_z.value)
            names = {*model.effects, *(effect.name for effect in vehicle.effects)}
            return any(drags) or not names.isdisjoint(AIR_FORCES)


def _candidate(description: EffectDescription, model: Model, records: Sequence[FlightRecord]) -> Candidate:
    name = description.name
    variables = tuple(Variable(name, parameter) for parameter in description.parameters)
    match name:
        case "motor_saturation":
            return Candidate(name, variables, _limits(model, records, variables[0]))
        case "ceiling_effect":
            return Candidate(name, variables, _ceilings(model, records))
        case "tether":
            return Candidate(name, _TETHER, _tethers(model, records))
        case "wind":
            # Upwards it does what a scale of thrust does, and would stand in for any error of a thrust map.
            return Candidate(name, tuple(v for v in variables if v.parameter != "z"), (model,))
    return Candidate(name, variables, (model,))


def _wind(model: Model) -> Candidate:
    """Wind together with a drag, where the model has no force of the air yet: it shows by the drag alone."""
    drags = [Variable("linear_drag", axis) for axis in "xyz"]
    wind = [Variable("wind", axis) for axis in "xy"]
    angles = 2.0 * np.pi * np.arange(_WIND_DIRECTIONS) / _WIND_DIRECTIONS
    starts = tuple(
        model.with_values(
            {
                **{v: model.rule(v).typical for v in drags},
                **dict(zip(wind, (speed * np.cos(angle), speed * np.sin(angle)), strict=True)),
            }
        )
        for speed in _WIND_SPEEDS
        for angle in angles
    )
    return Candidate("wind", (*drags, *wind), starts)


def _limits(model: Model, records: Sequence[FlightRecord], limit: Variable) -> tuple[Model, ...]:
    """Limits of thrust that a few or many samples would reach."""
    p = model.parameters()
    reached = [teacher_forced(r, p).thrust[r.flying].max(axis=1) for r in records if r.flying.any()]
    if not reached:
        return ()
    levels = np.quantile(np.concatenate(reached), [0.8, 0.9, 0.95, 0.98, 0.995, 0.999])
    return tuple(model.with_values({limit: level}) for level in levels)


def _ceilings(model: Model, records: Sequence[FlightRecord]) -> tuple[Model, ...]:
    """Ceiling effects of a free and of a crowded rotor, under the known ceiling or some that may be there."""
    inflow, opening = Variable("ceiling_effect", "inflow"), Variable("ceiling_effect", "opening")
    starts = [model.with_values({inflow: model.rule(inflow).typical, opening: share}) for share in _OPENINGS]
    if model.ceiling_z is not None:
        return tuple(starts)
    heights = [float(r.position[r.flying, 2].max()) for r in records if r.flying.any()]
    if not heights:
        return ()
    top = max(heights) + model.base.body.propeller_height_z.value
    return tuple(start.at_ceiling(top + gap) for start in starts for gap in _ABOVE)


def _tethers(model: Model, records: Sequence[FlightRecord]) -> tuple[Model, ...]:
    """Soft strings from places around the flown volume, taut in half of it."""
    places = np.vstack([r.position[r.flying] for r in records])
    if places.shape[0] == 0:
        return ()
    middle, reach = np.median(places, axis=0), float(np.percentile(np.ptp(places, axis=0), 50))
    starts = []
    for direction in ((0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)):
        anchor = middle + (reach + 0.5) * np.asarray(direction, dtype=float)
        length = float(np.median(np.linalg.norm(places - anchor, axis=1)))
        values = dict(zip(_TETHER, (*anchor, length, 0.1), strict=True))
        starts.append(model.with_values(values))
    return tuple(starts)


def _deepest(candidate: Candidate, base: Model, instants: Instants) -> Model:
    """The best fit to the instants; one at a bound only if all are."""
    settled = [instants.settled(start, candidate.variables) for start in candidate.starts]
    if candidate.effect == "ceiling_effect" and base.ceiling_z is None:
        settled += [instants.settled(start, candidate.variables, True) for start in candidate.starts[:2]]
    inside = [one for one in settled if not any(stuck(one[1], v) for v in candidate.variables)]
    return min(inside or settled, key=lambda one: one[0])[1]
