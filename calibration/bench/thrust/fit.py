"""Fit a form of thrust map to points whose voltage and thrust both have errors (effective variance).

A point weighs by sigma_f^2 + (df/dV)^2 sigma_V^2 (Orear, American Journal of Physics 50, 1982); the slope
comes from the fit before. Errors that points share (a tare reading) do not change the weights, but they enter
the covariance.
"""

import math
from dataclasses import dataclass

import numpy as np

from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.law import BREAK_GF, Form
from onboard.arrays import FloatArray
from onboard.gravity import GRAM_FORCE

_ROUNDS = 4
_RELATIVE_STEP = 1e-6
_INSIDE = 1e-3
"""A fit begins this far inside its bounds."""


@dataclass(frozen=True, slots=True)
class FormFit:
    """A form fitted to data; thrusts in gf.

    Attributes:
        form: which.
        parameters: (k,) in the form's own terms (gf, V).
        covariance: (k, k) of them, shared errors included.
        residuals: (n,) gf, measured less fitted.
        voltage, thrust: (n,) V, gf: the data.
        scale: by how much the scatter is larger than stated (1 when nothing was stated).
        sigma: (n,) gf, effective standard uncertainty of each point, `scale` included.
    """

    form: Form
    parameters: FloatArray
    covariance: FloatArray
    residuals: FloatArray
    voltage: FloatArray
    thrust: FloatArray
    scale: float
    sigma: FloatArray

    @property
    def dof(self) -> int:
        """Points less parameters."""
        return self.residuals.size - self.parameters.size

    @property
    def rms(self) -> float:
        """gf."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    def thrust_at(self, voltage: FloatArray) -> FloatArray:
        """gf at `voltage` (V)."""
        return self.form.thrust(self.parameters, np.asarray(voltage, dtype=np.float64))

    def curve_sigma(self, voltage: FloatArray) -> FloatArray:
        """gf: standard uncertainty of the curve at `voltage` (V), from the parameters' covariance."""
        matrix = jacobian(self.form, self.parameters, np.asarray(voltage, dtype=np.float64))
        return np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", matrix, self.covariance, matrix), 0.0))


def jacobian(form: Form, parameters: FloatArray, voltage: FloatArray) -> FloatArray:
    """(n, k) derivative of the thrust (gf) by the form's parameters."""
    columns = []
    for index in range(parameters.size):
        step = _RELATIVE_STEP * max(abs(parameters[index]), 1.0)
        up, down = parameters.copy(), parameters.copy()
        up[index] += step
        down[index] -= step
        columns.append((form.thrust(up, voltage) - form.thrust(down, voltage)) / (2.0 * step))
    return np.stack(columns, axis=1)


def slope(form: Form, parameters: FloatArray, voltage: FloatArray) -> FloatArray:
    """df/dV, gf/V."""
    step = 1e-5
    return (form.thrust(parameters, voltage + step) - form.thrust(parameters, voltage - step)) / (2.0 * step)


def fit_form(form: Form, data: ThrustData) -> FormFit:
    """Fit `form` to `data`.

    Raises:
        ThrustTableError: fewer points than parameters, or no fit that is a number.
    """
    v, f = data.voltage, data.thrust / GRAM_FORCE
    if v.size <= len(form.parameters):
        raise ThrustTableError(f"{data.name}: {v.size} points cannot tell the parameters of {form.name}")
    stated = None if data.sigma_thrust is None else data.sigma_thrust / GRAM_FORCE
    sigma_f = 1.0 if stated is None else stated
    with np.errstate(all="ignore"):
        parameters = np.clip(form.start(v, f), form.low + _INSIDE, form.high - _INSIDE)
    sigma = np.full(v.size, sigma_f)
    for _ in range(_ROUNDS if data.sigma_voltage > 0.0 else 1):
        parameters = _solve(form, v, f, sigma, parameters, data.name)
        sigma = np.hypot(sigma_f, data.sigma_voltage * slope(form, parameters, v))
    residuals = f - form.thrust(parameters, v)
    dof = v.size - parameters.size
    spread = math.sqrt(float(np.sum((residuals / sigma) ** 2)) / dof)
    # Scatter below what is stated is luck; scatter above it is real.
    scale = spread if stated is None else max(1.0, spread)
    covariance = _covariance(form, parameters, v, sigma * scale, data.shared)
    return FormFit(form, parameters, covariance, residuals, v, f, scale, sigma * scale)


def _solve(
    form: Form, v: FloatArray, f: FloatArray, sigma: FloatArray, start: FloatArray, name: str
) -> FloatArray:
    from scipy.optimize import least_squares

    with np.errstate(all="ignore"):  # a step too far is taken back by the solver
        usable = np.all(np.isfinite(form.thrust(start, v))) and np.all(np.isfinite(jacobian(form, start, v)))
        if not usable or not np.all(np.isfinite(sigma)):
            raise ThrustTableError(
                f"{name}: no fit of {form.name}; look at the points for one that is far off"
            )
        solution = least_squares(
            lambda p: (form.thrust(p, v) - f) / sigma,
            start,
            lambda p: jacobian(form, p, v) / sigma[:, None],
            bounds=(form.low, form.high),
            x_scale="jac",
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
        )
    return np.asarray(solution.x)


def _covariance(
    form: Form, parameters: FloatArray, v: FloatArray, sigma: FloatArray, shared: FloatArray | None
) -> FloatArray:
    """(X'WX)^-1 X'W C W X (X'WX)^-1 with C the points' own and their shared variances."""
    matrix = jacobian(form, parameters, v)
    weighted = matrix / sigma[:, None]
    inverse = np.linalg.pinv(weighted.T @ weighted)
    if shared is None or shared.size == 0:
        return np.asarray(inverse)
    pull = inverse @ (matrix / sigma[:, None] ** 2).T @ (shared / GRAM_FORCE)
    return np.asarray(inverse + pull @ pull.T)


def region_rms(fit: FormFit) -> dict[str, float | None]:
    """rms (gf) of the residuals below 2, from 2 to 5 and above 5 gf; None where there are no points."""
    regions = {
        "below_2_gf": fit.thrust < 2.0,
        "2_to_5_gf": (fit.thrust >= 2.0) & (fit.thrust <= BREAK_GF),
        "above_5_gf": fit.thrust > BREAK_GF,
    }
    return {
        name: float(np.sqrt(np.mean(fit.residuals[mask] ** 2))) if np.any(mask) else None
        for name, mask in regions.items()
    }
