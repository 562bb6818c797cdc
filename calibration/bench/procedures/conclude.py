"""From fits to calibrations: what changes in the vehicle file, with budget, findings and provenance."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from calibration.bench.motors.errors import TachometerError
from calibration.bench.motors.tachometer_result import TachometerResult
from calibration.bench.procedures.calibration import Calibration, VehicleChange
from calibration.bench.procedures.inertia import KIND as BIFILAR
from calibration.bench.procedures.inertia import InertiaFits
from calibration.bench.procedures.motors import KIND as TACHOMETER
from calibration.bench.procedures.motors import MotorFits
from calibration.bench.procedures.thrust import KIND as THRUST
from calibration.bench.procedures.thrust import thrust_inputs
from calibration.measurement import Contribution, Estimate
from onboard.json_file import as_json
from onboard.vehicle import EFFECTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from calibration.bench.capture.fit import CaptureFit
    from calibration.bench.thrust.thrust_result import ThrustResult

CAPTURE = "capture"
"""Kind of the calibration of pads."""


def inertia_calibration(fits: InertiaFits, made: str, provenance: Mapping[str, Any]) -> Calibration:
    """Inertias of the axes that were measured, and the mass."""
    mass = fits.inputs["mass"]
    jig = fits.inputs.get("jig mass")
    alone = mass if jig is None else _difference(mass, jig)
    quantities: dict[str, Estimate] = {"body.mass": alone}
    budgets: dict[str, tuple[Contribution, ...]] = {}
    for axis, result in fits.results.items():
        key = f"body.inertia_{axis}{axis}"
        quantities[key] = result.inertia
        budgets[key] = result.budget
    details = {
        axis: {
            "method": "pendulum law fitted to the gyro, period at zero amplitude",
            "period_s": as_json(result.period),
            "trials_s": list(result.trials),
            "spread": _number(result.spread),
            "paper_formula_kg_m2": result.formula,
            "axis": list(result.axis),
        }
        for axis, result in fits.results.items()
    }
    return Calibration(
        kind=BIFILAR,
        change=VehicleChange(quantities=quantities),
        budgets=budgets,
        findings=tuple(dict.fromkeys(fits.findings)),
        details=details,
        inputs=fits.inputs,
        provenance=provenance,
        raw=fits.raw,
        made=made,
    )


def _difference(first: Estimate, second: Estimate) -> Estimate:
    return Estimate(first.value - second.value, first.unit, math.hypot(first.sigma, second.sigma))


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def inertia_figures(fits: InertiaFits) -> dict[str, "Figure"]:
    """Plots of the report, by title: the trials and the budget of each axis, and its first swing."""
    from calibration.bench.inertia.figures import budget_figure, swing_figure, trials_figure

    figures: dict[str, Figure] = {}
    for axis, result in fits.results.items():
        figures[f"About {axis}: first swing"] = swing_figure(fits.swings[axis][0])
        figures[f"About {axis}: trials"] = trials_figure(fits.swings[axis])
        figures[f"About {axis}: budget"] = budget_figure(result)
    return figures


def motor_calibration(fits: MotorFits, made: str, provenance: Mapping[str, Any]) -> Calibration:
    """Time constants and the speed law of the mean motor.

    Raises:
        TachometerError: a direction is missing.
    """
    rows = [_row(motor, one) for motor, one in fits.results.items()]
    means = {
        name: fits.mean([row[name] for row in rows], follows_voltage=not name.startswith("a_"))
        for name in rows[0]
    }
    constants = {f"motors.time_constant_{way}": means.pop(f"tau_{way}") for way in ("up", "down")}
    law = {key: _within_bounds(key, one) for key, one in means.items()}
    return Calibration(
        kind=TACHOMETER,
        change=VehicleChange(quantities=constants, effects={"motor_speed_law": law}),
        budgets={},
        findings=tuple(dict.fromkeys(fits.findings)),
        details={
            "supply_sag": fits.sag,
            **{f"motor {motor}": as_json(one) for motor, one in fits.results.items()},
        },
        inputs={},
        provenance=provenance,
        raw=fits.raw,
        made=made,
    )


def motor_figures(fits: MotorFits) -> dict[str, "Figure"]:
    """Plots of the report: the steps of each motor, and the constants of the first."""
    from calibration.bench.motors.figures import constants_figure, sizes_figure, steps_figure

    figures = {f"Motor {motor}: steps": steps_figure(one) for motor, one in fits.results.items()}
    first = next(iter(fits.results.values()))
    return figures | {"Time constants": constants_figure(first), "Steps of all sizes": sizes_figure(first)}


def thrust_figures(result: "ThrustResult") -> dict[str, "Figure"]:
    """Plots of the report: the curve with what is left, and how the forms predict unseen blocks."""
    from calibration.bench.thrust.figures import curve_figure, validation_figure

    return {"Thrust against voltage": curve_figure(result), "Forms": validation_figure(result)}


def thrust_calibration(
    result: "ThrustResult", steps: Mapping[str, Any], made: str, provenance: Mapping[str, Any]
) -> Calibration:
    """The thrust map. The file's clamp on a motor's thrust stays: it is a choice, not a measurement.

    Raises:
        ThrustTableError: no form that a vehicle file has may be used.
    """
    from calibration.bench.thrust.thrust_result import flyable_map

    thrust_map = flyable_map(result)
    coefficients = {name: Estimate.from_quantity(one) for name, one in thrust_map.coefficients.items()}
    return Calibration(
        kind=THRUST,
        change=VehicleChange(thrust_map=(thrust_map.form.name.lower(), coefficients)),
        budgets={},
        findings=tuple(dict.fromkeys(result.findings)),
        details=as_json(result),
        curve=_curve(result),
        inputs=thrust_inputs(steps),
        provenance=provenance,
        raw=[step["table"] for step in steps.values() if "table" in step],
        made=made,
    )


def capture_calibration(
    fit: "CaptureFit", raw: Mapping[str, str], made: str, provenance: Mapping[str, Any]
) -> Calibration:
    """The effect `pad_capture`, and which drops come next."""
    from calibration.bench.capture.advice import next_drops
    from calibration.bench.capture.checks import check_fit

    details = {
        "method": "probit fit to counts by speed, 95 % limits from the profile likelihood",
        "drops": fit.drops.rows(),
        "speed_ci95": list(fit.speed_interval),
        "spread_ci95": list(fit.spread_interval),
        "separated": fit.drops.separated,
        "misfit_probability": fit.misfit,
        **as_json(next_drops(fit)),
    }
    return Calibration(
        kind=CAPTURE,
        change=VehicleChange(effects={"pad_capture": fit.estimates}),
        budgets={},
        findings=check_fit(fit),
        details=details,
        inputs={},
        provenance=provenance,
        raw=[raw],
        made=made,
    )


def capture_figures(fit: "CaptureFit") -> dict[str, "Figure"]:
    """The plot of the report: shares that stuck, and the curve."""
    from calibration.bench.capture.figures import capture_figure

    return {"Which drops stuck": capture_figure(fit)}


def _within_bounds(key: str, estimate: Estimate) -> Estimate:
    """A number of the speed law as vehicle files take it: a motor may show nothing of one of its terms."""
    rule = EFFECTS["motor_speed_law"].parameters[key]
    return Estimate(
        min(max(estimate.value, rule.low), rule.high), estimate.unit, estimate.sigma, estimate.dof
    )


def _row(motor: int, result: TachometerResult) -> dict[str, Estimate]:
    """What one motor says, by name."""
    up, down, tau_up, tau_down = result.up, result.down, result.tau_up, result.tau_down
    if up is None or down is None or tau_up is None or tau_down is None:
        raise TachometerError(
            f"motor {motor}: steps up and down are needed, one direction is missing; repeat it"
        )
    return {
        "tau_up": tau_up,
        "tau_down": tau_down,
        "a_up": up.a,
        "b_up": up.b,
        "a_down": down.a,
        "b_down": down.b,
    }


def _curve(result: "ThrustResult") -> dict[float, Estimate]:
    """Thrust with its uncertainty at round voltages of the range that was measured."""
    low, high = float(result.data.voltage.min()), float(result.data.voltage.max())
    steps = [0.5 * k for k in range(1, 10) if low <= 0.5 * k <= high]
    return {volts: result.thrust_at(volts) for volts in steps}
