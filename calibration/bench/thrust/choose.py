"""Which form to take: block cross-validation, the one-standard-error rule, and the figures of reports."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.bench.thrust.convert import thrust_map
from calibration.bench.thrust.data import FEWEST_POINTS, ThrustData
from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.fit import FormFit, fit_form, region_rms
from calibration.bench.thrust.law import CUBIC, FORMS, VEHICLE_FORMS, Form
from calibration.bench.thrust.pwm import applied_duty
from calibration.bench.thrust.shape import shape_problems
from calibration.measurement import coverage_factor
from onboard.arrays import FloatArray
from onboard.gravity import GRAM_FORCE
from onboard.vehicle.model import ThrustMapDescription

_FEWEST_BLOCKS = 3
_FOLDS = 5


@dataclass(frozen=True, slots=True)
class FormReport:
    """A form with what speaks for and against it; thrusts in gf.

    Attributes:
        fit: of the form.
        cross_validation: rms error (gf) in blocks that the fit did not see; infinite if a fit failed.
        cross_validation_error: its standard error.
        aicc, bic: criteria of Akaike (small samples) and Schwarz, from the sum of squares.
        durbin_watson: of the residuals in the order of the voltage; 2 when they do not follow each other.
        r_squared: share of variance explained; above 0.99 for all forms, hence no criterion.
        map: as a vehicle file takes it; None for forms that it does not have.
        problems: what keeps it from being used.
    """

    fit: FormFit
    cross_validation: float
    cross_validation_error: float
    aicc: float
    bic: float
    durbin_watson: float
    r_squared: float
    map: ThrustMapDescription | None
    problems: tuple[str, ...]

    @property
    def name(self) -> str:
        """Of the form."""
        return self.fit.form.name

    @property
    def usable(self) -> bool:
        """Whether a vehicle may fly with it."""
        return self.map is not None and not self.problems

    def band(self, voltage: FloatArray, others: Sequence["FormReport"] = ()) -> FloatArray:
        """Half width (gf) of the 95 % band of the curve at each voltage (V).

        Other usable forms that predict unseen blocks as well are as true as this one: how far they lie away,
        beyond what noise explains, enters as a rectangular half width.
        """
        sigma = self.fit.curve_sigma(voltage)
        apart = np.zeros(np.shape(voltage))
        for other in others:
            if other.name != self.name and other.usable and self.ties_with(other):
                apart = np.maximum(apart, np.abs(other.fit.thrust_at(voltage) - self.fit.thrust_at(voltage)))
        beyond = np.maximum(apart**2 - sigma**2, 0.0)
        dof = math.inf if self.fit.scale == 1.0 else float(self.fit.dof)
        return np.asarray(coverage_factor(dof) * np.sqrt(sigma**2 + beyond / 3.0))

    def ties_with(self, other: "FormReport") -> bool:
        """Whether the two predict unseen blocks alike, within one standard error."""
        best, worst = sorted((self, other), key=lambda one: one.cross_validation)
        return worst.cross_validation <= best.cross_validation + best.cross_validation_error

    def json_shape(self) -> dict[str, Any]:
        """Figures in gf, coefficients in SI with uncertainties."""
        deviation = np.sqrt(np.diag(self.fit.covariance))
        correlation = self.fit.covariance / np.outer(deviation, deviation)
        return {
            "equation": self.fit.form.equation,
            "n": int(self.fit.residuals.size),
            "parameters": int(self.fit.parameters.size),
            "dof": self.fit.dof,
            "rms_gf": self.fit.rms,
            "max_gf": float(np.max(np.abs(self.fit.residuals))),
            "rms_by_region_gf": region_rms(self.fit),
            "cross_validation_gf": _finite(self.cross_validation),
            "cross_validation_error_gf": _finite(self.cross_validation_error),
            "aicc": self.aicc,
            "bic": self.bic,
            "r_squared": self.r_squared,
            "durbin_watson": self.durbin_watson,
            "correlation": np.round(correlation, 4).tolist(),
            "usable": self.usable,
            "problems": self.problems,
            "coefficients": None if self.map is None else map_json(self.map),
        }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def map_json(description: ThrustMapDescription) -> dict[str, dict[str, Any]]:
    """Coefficients as ``{value, unit, u95}``."""
    return {
        name: {"value": one.value, "unit": one.unit, "u95": 1.96 * one.sigma}
        for name, one in description.coefficients.items()
    }


def report_form(form: Form, data: ThrustData) -> FormReport:
    """Fit one form and judge it."""
    fit = fit_form(form, data)
    count, parameters = fit.residuals.size, fit.parameters.size
    squares = float(np.sum(fit.residuals**2))
    likelihood = count * math.log(max(squares, 1e-30) / count)
    free = parameters + 1  # and the scatter
    ordered = fit.residuals[np.argsort(fit.voltage)]
    error, spread = cross_validate(form, data)
    described: ThrustMapDescription | None = None
    problems: tuple[str, ...] = ()
    if form.in_vehicle:
        described = thrust_map(fit, data.source)
        low, high = thrust_range(data)
        problems = tuple(shape_problems(described.compiled(), low, high))
    return FormReport(
        fit=fit,
        cross_validation=error,
        cross_validation_error=spread,
        aicc=likelihood + 2.0 * free + 2.0 * free * (free + 1) / max(count - free - 1, 1),
        bic=likelihood + free * math.log(count),
        durbin_watson=float(np.sum(np.diff(ordered) ** 2) / max(squares, 1e-30)),
        r_squared=1.0 - squares / max(float(np.sum((fit.thrust - fit.thrust.mean()) ** 2)), 1e-30),
        map=described,
        problems=problems,
    )


def thrust_range(data: ThrustData) -> tuple[float, float]:
    """Lowest and highest thrust (N) that was measured: a map is not used beyond."""
    positive = data.thrust[data.thrust > 0.0]
    if positive.size == 0:
        raise ThrustTableError(f"{data.name}: no positive thrust: is the rig the right way round?")
    return float(np.min(positive)), float(np.max(data.thrust))


def cross_validate(form: Form, data: ThrustData) -> tuple[float, float]:
    """rms error (gf) in blocks left out of the fit, and its standard error over the blocks.

    With fewer than three blocks, every fifth point of the ordered voltages makes a block.
    """
    block: FloatArray = data.block
    if np.unique(block).size < _FEWEST_BLOCKS:
        block = np.asarray(np.argsort(np.argsort(data.voltage)) % _FOLDS, dtype=np.float64)
    squares: list[float] = []
    for label in np.unique(block):
        kept = block != label
        if kept.sum() < max(FEWEST_POINTS, len(form.parameters) + 1):
            continue
        fit = fit_form(form, data.chosen(kept))
        error = fit.thrust_at(data.voltage[~kept]) - data.thrust[~kept] / GRAM_FORCE
        squares.append(float(np.mean(error**2)))
    if len(squares) < 2:
        return math.inf, math.inf
    mean = float(np.mean(squares))
    if not math.isfinite(mean):
        return math.inf, math.inf
    rms = math.sqrt(mean)
    return rms, float(np.std(squares, ddof=1)) / math.sqrt(len(squares)) / (2.0 * rms)


def report_forms(data: ThrustData, forms: Sequence[Form] = FORMS) -> dict[str, FormReport]:
    """All forms by name; one that is only for comparison and has no fit to these points is left out."""
    reports: dict[str, FormReport] = {}
    for form in forms:
        try:
            reports[form.name] = report_form(form, data)
        except ThrustTableError:
            if form.in_vehicle:
                raise
    return reports


def choose(reports: dict[str, FormReport]) -> FormReport:
    """The form to use: within a standard error of the best usable one, the fewest parameters, then the cubic.

    Raises:
        ThrustTableError: no form is usable.
    """
    usable = [one for one in reports.values() if one.usable]
    if not usable:
        reasons = "; ".join(f"{one.name}: {', '.join(one.problems)}" for one in reports.values() if one.map)
        raise ThrustTableError(
            f"no form gives a map that may fly ({reasons}); look at the points, record more"
        )
    best = min(usable, key=lambda one: one.cross_validation)
    near = [one for one in usable if best.ties_with(one) or one is best]
    order = [form.name for form in VEHICLE_FORMS]
    return min(near, key=lambda one: (one.fit.parameters.size, one.name != CUBIC.name, order.index(one.name)))


FULL_DUTY = float(applied_duty(np.array([65535.0]))[0])
"""Most that the timer applies: 255/256."""
