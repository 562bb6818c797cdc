"""From a finished search to names, values and intervals."""

import dataclasses
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from calibration.gap.data.excitation import answered, commanded, excitation_weights, excited
from calibration.gap.estimate.acceptance import DETECTABLE, clustered_errors, sizeable
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine
from calibration.gap.search.always import LOG_TIMING, late_by_more_than_the_log
from calibration.gap.search.credible import what_speaks_against
from calibration.gap.search.doubts import moved_by_timing, with_doubts
from calibration.gap.search.forward import Search
from calibration.gap.search.rivals import needed
from onboard.vehicle import EFFECTS, Vehicle, VehicleFileError, vehicle_to_toml
from onboard.vehicle.file_format import parse_vehicle
from onboard.vehicle.unnamed import UnnamedCurve

REAL = "real, but too small for a name"
"""How the reason begins for which an effect is in the improved vehicle without a name."""

FEWEST = 3
"""Flights: what fewer show may be of one of them alone."""

UNNAMED = "with what has no name"
"""The stage of a model with terms without a name."""

NOTHING = "its interval contains nothing"

SMALL_AND_NOTHING = f"too small for a name, and {NOTHING}"

BY_DELAY = "it is there only beside a delay of commands that is within half an interval of the log"

_LAGS = ("motor_lag", "motor_lag_asymmetry")


@dataclass(frozen=True)
class Named:
    """Effects that were named.

    Attributes:
        effects: names, in the order found.
        minor: effects that are real, but too small for a name: they are in the improved vehicle.
        model: the base vehicle with the named effects alone.
        improved: with the minor ones too.
        errors: standard error of each variable: clustered, and with what no flight tells of it
            (:mod:`calibration.gap.search.doubts`).
        ambiguous: by effect, those that the flights do not rule out in its place.
        unconfirmed: effects that would have been named, had there been flights to confirm them on.
        rejected: effects that are in the final fit and got no name, with the reason.
        curves: what has no name and is in the improved vehicle.
    """

    effects: tuple[str, ...]
    minor: tuple[str, ...]
    model: Model
    improved: Model
    errors: dict[Variable, float]
    ambiguous: dict[str, tuple[str, ...]]
    unconfirmed: tuple[str, ...]
    rejected: dict[str, str]
    curves: tuple[UnnamedCurve, ...] = ()

    @property
    def given_up(self) -> dict[str, str]:
        """What was in the last fit and is believed no more, not even without a name; with the reason."""
        if self.unconfirmed:
            return {}
        return {
            name: reason
            for name, reason in self.rejected.items()
            if name not in self.minor and name != LOG_TIMING.effect and reason != SMALL_AND_NOTHING
        }

    def without_any(self, reason: str) -> "Named":
        """The same without a name, each refused for one reason."""
        refused = {**self.rejected, **dict.fromkeys(self.effects, reason)}
        model = Model(self.model.base, {}, self.model.ceiling_z)
        return dataclasses.replace(
            self, effects=(), minor=(), model=model, improved=model, ambiguous={}, rejected=refused
        )

    def models(self) -> dict[str, Model]:
        """The model before, after each effect, and with all that is real: "before", "with <effect>" ...,
        at last with what has no name."""
        model = Model(self.model.base, {}, self.model.ceiling_z)
        stages = {"before": model}
        for name in self.effects:
            model = model.with_values({v: x for v, x in self.model.values.items() if v.effect == name})
            stages[f"with {name}"] = model
        if self.minor:
            stages["with the small ones"] = self.improved
        if self.curves:
            stages[UNNAMED] = self.improved.with_curves(self.curves)
        return stages


def name_effects(found: Search, training: Training) -> Named:
    """The named effects of a search, in the order found.

    The log's timing, which is always fitted, is named where it is beyond half a sample: nobody knows better
    when a line was written.
    """
    final = found.final
    order = [step.effect for step in found.steps]
    if LOG_TIMING in final.model.values and needed(final, LOG_TIMING.effect, training):
        order.append(LOG_TIMING.effect)
    chance = clustered_errors(final, training)
    errors = with_doubts(chance, final, training)
    doubts = {name: _doubt(name, final, training, chance, errors) for name in order}
    confirmed = len(training.records) >= FEWEST
    worthy = [name for name in order if doubts[name] is None]
    believed = [*worthy, *(name for name in order if (doubts[name] or "").startswith(REAL))]
    believed = (
        [name for name in believed if doubts[name] is None or name != LOG_TIMING.effect] if confirmed else []
    )
    while believed and (problem := not_loaded(_model_of(believed, final).vehicle())):
        culprit = _why_not_loaded(believed, final)
        believed.remove(culprit)
        doubts[culprit] = f"no vehicle file can say it: {problem}"
    order = [name for name in believed if doubts[name] is None]
    minor = [name for name in believed if name not in order]
    return Named(
        effects=tuple(order),
        minor=tuple(minor),
        improved=_model_of(believed, final),
        model=_model_of(order, final),
        errors=errors,
        ambiguous={name: _not_ruled_out(name, found, order) for name in order},
        unconfirmed=() if confirmed else tuple(worthy),
        rejected={name: doubt for name, doubt in doubts.items() if doubt is not None},
    )


def as_believed(found: Search, names: Named, training: Training) -> Fitted:
    """The last fit without the effects that got no name, small ones aside: nothing explains what they did.

    A verdict is passed on what is said, not on what was tried; noise and spreads of nuisances are found anew.
    """
    final, believed = found.final, {*names.effects, *names.minor, LOG_TIMING.effect}
    gone = {step.effect for step in found.steps} - believed
    if names.unconfirmed or not gone:
        return final
    model = final.model.without_values([v for v in final.model.values if v.effect in gone])
    return refine(
        model, [v for v in final.variables if v.effect not in gone], training, unnamed=final.unnamed
    )


def _model_of(names: Sequence[str], final: Fitted) -> Model:
    """The vehicle with what was found of these effects; those that were given up count where they matter."""
    values = {
        v: x
        for name in names
        for v, x in final.model.values.items()
        if v.effect == name and (v in final.variables or sizeable(final.model, v))
    }
    return Model(final.model.base, values, final.model.ceiling_z)


def _not_ruled_out(effect: str, found: Search, named: list[str]) -> tuple[str, ...]:
    """Effects in the place of a named one: not told apart by these flights, or by any."""
    rivals = [rival.effect for rival in found.ambiguous.get(effect, ())]
    return tuple(dict.fromkeys([*rivals, *(name for name in EFFECTS[effect].alike if name not in named)]))


def _doubt(
    effect: str,
    final: Fitted,
    training: Training,
    chance: Mapping[Variable, float],
    errors: Mapping[Variable, float],
) -> str | None:
    """Why an effect of the final model gets no name; None where it is large, free and steady.

    Args:
        effect: which.
        final: the fit.
        training: the flights.
        chance, errors: standard error of each variable, clustered, and with all doubts.
    """
    values = {v: x for v, x in final.model.values.items() if v.effect == effect}
    if effect == LOG_TIMING.effect and not _tells_delays(final, training):
        return "too little was commanded to tell it"
    if against := what_speaks_against(list(values), final, chance):
        return against
    if effect != LOG_TIMING.effect and not there_without_delay(values, final, training, chance):
        return BY_DELAY
    nothing = contains_nothing(values, final, errors)
    if effect == LOG_TIMING.effect and not late_by_more_than_the_log(final.model, training):
        return _small(values)
    large = [v for v in values if sizeable(final.model, v)]
    if effect in _LAGS:  # no better known than when a line of the log was written
        half = 0.5 * training.regression.signals.dt / final.model.base.motors.time_constant_up.value
        large = [v for v in large if abs(final.model.change(v)) > half]
    if not large:
        return SMALL_AND_NOTHING if nothing else _small(values)
    return NOTHING if nothing or contains_nothing(large, final, errors) else None


def there_without_delay(
    variables: Collection[Variable], final: Fitted, training: Training, chance: Mapping[Variable, float]
) -> bool:
    """Whether an effect is still beyond chance where commands arrive when the vehicle file says.

    A delay that is within half an interval of the log is no finding: lines may be that late, or it answers
    for what a controller did between two of them. What is nothing without it is no finding either.
    """
    delay = final.model.change(LOG_TIMING)
    removable = [v for v in variables if v in final.variables and final.model.without_it(v) is not None]
    if not removable or not delay or late_by_more_than_the_log(final.model, training):
        return True
    share = delay / (0.5 * training.regression.signals.dt)
    moved = moved_by_timing(final, training)
    return any(abs(final.model.change(v) - share * moved[v]) >= DETECTABLE * chance[v] for v in removable)


def _tells_delays(final: Fitted, training: Training) -> bool:
    """Whether enough was commanded, or else the vehicle moved by itself as the final model says."""
    signals, predicted = training.regression.signals, final.predicted
    quiet = answered(training.quiet, signals, predicted)
    shakes = bool(np.any(quiet < training.quiet))
    by_itself = shakes and excited(excitation_weights(commanded(signals, predicted), quiet))
    return by_itself or excited(training.regression.weights)


def contains_nothing(
    variables: Collection[Variable], final: Fitted, errors: Mapping[Variable, float]
) -> bool:
    """Whether chance alone takes one of these parameters as far from nothing once in twenty times.

    Each has its 95 % interval; of three, one is outside it by chance once in seven times (Sidak, JASA 62,
    1967).
    """
    removable = [v for v in variables if final.model.without_it(v) is not None]
    if not removable:
        return False
    least = norm.isf(0.5 * (1.0 - 0.95 ** (1.0 / len(removable))))
    return all(abs(final.model.change(v)) < least * errors.get(v, 0.0) for v in removable)


def not_loaded(vehicle: Vehicle) -> str | None:
    """Why a vehicle file with these effects would be refused; None where it would not."""
    try:
        parse_vehicle(tomllib.loads(vehicle_to_toml(vehicle)), vehicle.name)
    except VehicleFileError as error:
        return str(error)
    return None


def _why_not_loaded(believed: Sequence[str], final: Fitted) -> str:
    """The effect without which the others load; the last, where there is more than one to blame."""
    for name in reversed(believed):
        others = [one for one in believed if one != name]
        if not_loaded(_model_of(others, final).vehicle()) is None:
            return name
    return believed[-1]


def _small(values: Mapping[Variable, float]) -> str:
    values_in_words = ", ".join(
        f"{v.parameter} = {x:.3g} {EFFECTS[v.effect].parameters[v.parameter].unit}".removesuffix(" 1")
        for v, x in values.items()
    )
    return f"{REAL} ({values_in_words})"
