"""Moments of inertia that no body has, as yaw is known badly: the most likely ones that a body can have."""

import dataclasses

import numpy as np

from calibration.gap.estimate.acceptance import clustered_errors
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training

_EFFECT = "inertia_error"

_AXES = ("xx", "yy", "zz")

_THICKNESS = 1e-3
"""Share of the largest moment by which the other two exceed it, small beside any error of them: they add up
to it in a plate without thickness, which a vehicle file may not have."""

_FAR = 4.0
"""Standard errors beyond which it is not for chance that no body has them: few flights know their errors
badly, and that it is a body that flew is certain."""


def as_a_rigid_body(present: Fitted, training: Training) -> Fitted:
    """The fit with the most likely inertias that a rigid body can have: two add up to more than the third.

    To second order the likelihood falls with the distance from the estimate in its covariance. Along the one
    inequality that does not hold, the most likely estimate that meets it is in closed form (estimate
    projection: Simon, IET Control Theory & Applications 4(8), 2010). Everything that is fitted moves, as far
    as it goes with the inertias.

    Args:
        present: the fit; returned as it is where a body has its inertias, and where they are :data:`_FAR`
            from any body's: then they stand in for something else.
        training: the flights, by which errors are clustered.
    """
    slopes = np.array([_slope(present.model, v) for v in present.variables])
    missing = _THICKNESS * max(_inertias(present.model).values()) - _surplus(present.model)
    if missing <= 0.0 or not slopes.any():
        return present
    errors = clustered_errors(present, training)
    widened = np.array([errors[v] for v in present.variables])
    covariance = present.estimate.fit.covariance[: widened.size, : widened.size]
    widened = widened / np.sqrt(np.diag(covariance))
    along = (covariance * np.outer(widened, widened)) @ slopes
    if missing > _FAR * np.sqrt(slopes @ along):
        return present
    steps = along * missing / (slopes @ along)
    moved = {v: present.model.start_value(v) + step for v, step in zip(present.variables, steps, strict=True)}
    return dataclasses.replace(present, model=present.model.with_values(moved))


def _inertias(model: Model) -> dict[str, float]:
    """True moments of inertia by axis, kg m2."""
    return {
        axis: getattr(model.base.body, f"inertia_{axis}").value
        * (1.0 + model.start_value(Variable(_EFFECT, axis)))
        for axis in _AXES
    }


def _surplus(model: Model) -> float:
    """By how much two moments of inertia exceed the largest, kg m2."""
    inertias = _inertias(model)
    return sum(inertias.values()) - 2.0 * max(inertias.values())


def _slope(model: Model, variable: Variable) -> float:
    """Derivative of the surplus by a variable, kg m2."""
    if variable.effect != _EFFECT:
        return 0.0
    inertias = _inertias(model)
    sign = -1.0 if variable.parameter == max(inertias, key=inertias.__getitem__) else 1.0
    return sign * float(getattr(model.base.body, f"inertia_{variable.parameter}").value)
