"""What the values of a fit may be off by for other reasons than chance: what flights do not tell.

Where the alternative can be computed, the flights are fitted with it, and what a value moves by is a bound of
its error to either side: a third of its square is a variance (rectangular distribution; Guide to the
expression of uncertainty in measurement, JCGM 100:2008, 4.3.7).
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from calibration.gap.data.signals import VOLTAGE
from calibration.gap.estimate.acceptance import NINETY_FIVE, drift
from calibration.gap.estimate.model import LIFT_ONLY, Model, Variable
from calibration.gap.estimate.nuisances import NUISANCES
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.search.always import LOG_TIMING
from onboard.arrays import FloatArray
from onboard.vehicle import EFFECTS

SYSTEMATIC = 0.02
"""Share of an effect that its value may be off by for other reasons than noise: regressors are measured, with
noise and filters of their own, and commands are known at the samples only. On flights with known effects of
medium size the values were off by up to this much more than their scatter over flights says. Along one axis
of several it is a share of the largest: axes are told apart no better than they are at right angles."""

_RESISTANCE = Variable("battery_sag", "resistance")
_AREAS = tuple(Variable("body_drag", f"area_{axis}") for axis in "xyz")
_SCALE, _MASS = Variable("thrust_scale", "scale"), Variable("mass_error", "relative")
_MOTORS = tuple(Variable("motor_imbalance", motor) for motor in ("m1", "m2", "m3", "m4"))
_LIFT = [nuisance.name for nuisance in NUISANCES].index("thrust_scale")


def with_doubts(chance: Mapping[Variable, float], final: Fitted, training: Training) -> dict[Variable, float]:
    """Standard error of each variable with everything that is doubtful about it.

    Args:
        chance: clustered standard error of each variable.
        final: the fit.
        training: its flights.
    """
    half = 0.5 * training.regression.signals.dt
    alternatives = [
        moved_by_timing(final, training),
        moved_by_drag_along_each_axis(final, training),
        moved_by_current(final, training),
        {LOG_TIMING: half, _RESISTANCE: _other_current(final.model)},
    ]
    return {
        v: math.hypot(
            error,
            SYSTEMATIC * _size(v, chance, final.model),
            drift(v, final),
            *(abs(bounds.get(v, 0.0)) / math.sqrt(3.0) for bounds in alternatives),
        )
        for v, error in chance.items()
    }


def moved_by_timing(final: Fitted, training: Training) -> dict[Variable, float]:
    """What each variable moves by where each line of the log was written half an interval later."""
    half = 0.5 * training.regression.signals.dt
    return _moved(final, training, [LOG_TIMING], _other_timing(final, training, half))


def moved_by_drag_along_each_axis(final: Fitted, training: Training) -> dict[Variable, float]:
    """What each variable moves by where a body's drag along an axis goes with the square of that component.

    With the speed, as the model has it, an area counts for more where the vehicle moves across the axis, too;
    no flight of hover, laps and climbs tells the two laws apart, and the areas differ by up to a few times.
    """
    if not any(v in _AREAS for v in final.variables):
        return {}
    model, records = final.model, training.records
    pulls = {area: model.derivative(records, area, final.predicted) for area in _AREAS}
    along = np.stack([np.abs(pulls[area][:, axis]) for axis, area in enumerate(_AREAS)], axis=1)
    shares = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    others = {area: pulls[area] * shares[:, axis, None] for axis, area in enumerate(_AREAS)}
    predicted = final.predicted + sum(model.change(area) * (others[area] - pulls[area]) for area in _AREAS)
    columns = [others.get(v, column) for v, column in zip(final.variables, final.columns, strict=False)]
    columns += final.columns[len(final.variables) :]
    at = final.estimate
    other = training.regression.estimate(predicted, columns, final.prior, at.fit.spread, at.noise)
    steps = other.fit.theta - at.fit.theta
    return {v: float(step) for v, step in zip(final.variables, steps, strict=False)}


def moved_by_current(final: Fitted, training: Training) -> dict[Variable, float]:
    """What a battery's resistance moves by where motors draw for what they lift, not for their command.

    A bent thrust map, and motors that warm, lift otherwise at a command than the vehicle file says; whether
    they draw otherwise as well, no flight tells.
    """
    effects = final.model.effects
    if _RESISTANCE not in final.variables or not any(name in effects for name in LIFT_ONLY):
        return {}
    other = final.predicted.copy()
    other[:, VOLTAGE] = final.model.voltage_for_lift(training.records)
    return {_RESISTANCE: _moved(final, training, [], other)[_RESISTANCE]}


def _size(variable: Variable, chance: Mapping[Variable, float], model: Model) -> float:
    """Distance of an effect from neutral: of this variable, or what is sure of another in its unit."""
    rules = EFFECTS[variable.effect].parameters
    alike = (
        abs(model.change(other)) - NINETY_FIVE * error
        for other, error in chance.items()
        if other.effect == variable.effect and rules[other.parameter].unit == rules[variable.parameter].unit
    )
    return max(abs(model.change(variable)), *alike)


def _moved(
    final: Fitted, training: Training, known: Sequence[Variable], predicted: FloatArray
) -> dict[Variable, float]:
    """What variables move by where signals are predicted otherwise, and those `known` keep their values."""
    free = [i for i in range(len(final.columns)) if i not in final.columns_of(known)]
    columns, prior, at = [final.columns[i] for i in free], final.prior.of(free), final.estimate
    before, after = (
        training.regression.estimate(one, columns, prior, at.fit.spread, at.noise).fit
        for one in (final.predicted, predicted)
    )
    variables = [v for v in final.variables if v not in known]
    moved = {v: float(step) for v, step in zip(variables, after.theta - before.theta, strict=False)}
    return moved | _taken_back(moved, final.model, float((after.per_part - before.per_part)[:, _LIFT].mean()))


def _taken_back(moved: Mapping[Variable, float], model: Model, shared: float) -> dict[Variable, float]:
    """What a mass, a scale of thrust or four motors move by, less what the thrusts of all flights take back.

    What alters quick forces moves them, as noise is whitened, and leaves it to every part's own thrust to
    lift the vehicle as before. Flights tell both together, and nothing better: a vehicle hovers.

    Args:
        moved: what each fitted variable moves by.
        model: from which.
        shared: what the scales of thrust of all parts move by on average.
    """
    lifts = [v for v in moved if v in (_SCALE, _MASS, *_MOTORS)]
    if lifts not in ([_SCALE], [_MASS], [*_MOTORS]):  # of two nobody knows whose it is
        return {}
    whole = {v: -1.0 - model.start_value(v) if v == _MASS else model.start_value(v) for v in lifts}
    return {v: moved[v] + shared * whole[v] for v in lifts}


def _other_timing(final: Fitted, training: Training, half: float) -> FloatArray:
    """Predicted signals, shape (n, 7), had each line been written half an interval of the log (s) later.

    A delay that is fitted does not settle it: between two lines the controller answered, and that answer is
    told apart from a delay, and a delay from a lag, no better than the lines are from each other.
    """
    later = final.model.start_value(LOG_TIMING) + half
    moved = final.model.with_values({LOG_TIMING: later}).predict(training.records)
    moved[:, VOLTAGE] = final.predicted[:, VOLTAGE]
    return moved


def _other_current(model: Model) -> float:
    """Doubt (ohm) of a battery's resistance by what nobody knows of the current through it.

    Rotors that lift less than the vehicle file says draw less (worn propellers), or as much as before (warm
    magnets): the current is anywhere between that of the thrust, which the model has, and of the command. A
    mass is never told from a scale.
    """
    lifted = model.start_value(_SCALE) * (1.0 + model.start_value(_MASS))
    lifted *= sum(model.start_value(v) for v in _MOTORS) / len(_MOTORS)
    whole = model.base.battery.resistance.value + model.start_value(_RESISTANCE)
    return whole * abs(lifted - 1.0)
