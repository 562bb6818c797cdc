"""What a vehicle file takes from a tachometer: speed law, first-order constants, thrust coefficient."""

from dataclasses import dataclass

from calibration.measurement import Estimate
from calibration.tachometer.errors import TachometerError
from calibration.tachometer.result import TachometerResult
from onboard.quantity import Quantity
from onboard.vehicle.model import Effect


@dataclass(frozen=True, slots=True)
class MotorDynamics:
    """Numbers for the sections of a vehicle file.

    Attributes:
        time_constant_up, time_constant_down: s, ``motors``: first-order thrust for the paper's steps.
        thrust_coefficient: N s2/rad2, ``motors``: thrust over squared speed at hover, by the propeller's map.
        speed_law: the effect ``motor_speed_law``, which stands in place of the time constants where it is on.
    """

    time_constant_up: Quantity
    time_constant_down: Quantity
    thrust_coefficient: Quantity
    speed_law: Effect


def motor_dynamics(result: TachometerResult, source: str) -> MotorDynamics:
    """The quantities with `source` as their provenance.

    Raises:
        TachometerError: one direction was not measured.
    """
    tau_up, tau_down, up, down = result.tau_up, result.tau_down, result.up, result.down
    if up is None or down is None or tau_up is None or tau_down is None:
        raise TachometerError("a vehicle needs steps up and down: one direction was not measured; record it")
    coefficient = result.propeller.coefficient(result.hover_thrust)
    parameters = {
        "a_up": _quantity(up.a, source),
        "b_up": _quantity(up.b, source),
        "a_down": _quantity(down.a, source),
        "b_down": _quantity(down.b, source),
    }
    return MotorDynamics(
        time_constant_up=_quantity(tau_up, f"{source}; first order in place of 5 -> 12 gf"),
        time_constant_down=_quantity(tau_down, f"{source}; first order in place of 12 -> 0 gf"),
        thrust_coefficient=Quantity(
            coefficient,
            "N s2/rad2",
            result.propeller.relative_sigma * coefficient,
            f"propeller {result.propeller.name} at hover: {result.propeller.source}",
        ),
        speed_law=Effect(name="motor_speed_law", parameters=parameters),
    )


def _quantity(estimate: Estimate, source: str) -> Quantity:
    return Quantity(estimate.value, estimate.unit, estimate.sigma, source)
