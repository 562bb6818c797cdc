"""A fitted form as the thrust map of a vehicle file, in SI units with uncertainties."""

import numpy as np

from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.fit import FormFit
from calibration.bench.thrust.law import BREAK_GF, CUBIC, TWO_QUADRATICS, TWO_REGION_LOG
from onboard.arrays import FloatArray
from onboard.gravity import GRAM_FORCE
from onboard.quantity import Quantity
from onboard.thrust_map import COEFFICIENT_UNITS, ThrustMapForm
from onboard.vehicle.model import ThrustMapDescription

_FORM_OF = {
    CUBIC.name: ThrustMapForm.FIRMWARE_CUBIC,
    TWO_REGION_LOG.name: ThrustMapForm.TWO_REGION_LOG,
    TWO_QUADRATICS.name: ThrustMapForm.QUADRATIC_INVERSE,
}


def coefficients(form: str, parameters: FloatArray) -> FloatArray:
    """A file's coefficients (SI) from a fit's parameters, in the order of `COEFFICIENT_UNITS`."""
    if form == CUBIC.name:
        return np.asarray(parameters * GRAM_FORCE)
    if form == TWO_REGION_LOG.name:
        a1, b1, a2, b2 = np.exp(parameters)
        return np.array([a1, b1 * GRAM_FORCE, a2, b2 * GRAM_FORCE, BREAK_GF * GRAM_FORCE])
    low_a, low_b, high_a, slope = parameters
    corner = 2.0 * BREAK_GF / (low_b + np.sqrt(low_b**2 + 4.0 * low_a * BREAK_GF))
    high = (high_a, slope - 2.0 * high_a * corner, BREAK_GF - slope * corner + high_a * corner**2)
    return np.array([low_a, low_b, 0.0, *high, BREAK_GF]) * GRAM_FORCE


def thrust_map(fit: FormFit, source: str) -> ThrustMapDescription:
    """The map of a vehicle file.

    Args:
        fit: of a form that vehicle files have.
        source: provenance of every coefficient.

    Raises:
        ThrustTableError: vehicle files do not have the form.
    """
    if fit.form.name not in _FORM_OF:
        known = ", ".join(_FORM_OF)
        raise ThrustTableError(f"{fit.form.name} is for comparison only; vehicle files have {known}")
    form = _FORM_OF[fit.form.name]
    values = coefficients(fit.form.name, fit.parameters)
    columns = []
    for index in range(fit.parameters.size):
        step = 1e-6 * max(abs(fit.parameters[index]), 1.0)
        moved = fit.parameters.copy()
        moved[index] += step
        columns.append((coefficients(fit.form.name, moved) - values) / step)
    by_parameter = np.stack(columns, axis=1)
    sigma = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", by_parameter, fit.covariance, by_parameter), 0.0))
    return ThrustMapDescription(
        form=form,
        coefficients={
            name: Quantity(float(value), unit, float(spread), source)
            for (name, unit), value, spread in zip(
                COEFFICIENT_UNITS[form].items(), values, sigma, strict=True
            )
        },
    )
