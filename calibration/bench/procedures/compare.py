"""A calibration beside an earlier one, or beside a vehicle file: do they contradict each other?"""

import math
from dataclasses import dataclass
from typing import Any

from calibration.bench.procedures.calibration import Calibration
from calibration.measurement import Estimate, normalised_difference
from onboard.battery import thrust_from_voltage
from onboard.quantity import Quantity
from onboard.vehicle import Vehicle


@dataclass(frozen=True)
class Comparison:
    """Two estimates of one quantity.

    Attributes:
        key: of the quantity.
        before, now: estimates.
        normalised: E_n (ISO 13528); above 1 they contradict each other. None: an uncertainty is not known.
    """

    key: str
    before: Estimate
    now: Estimate
    normalised: float | None

    @property
    def contradicts(self) -> bool:
        """Whether the difference is larger than both uncertainties allow."""
        return self.normalised is not None and self.normalised > 1.0

    @property
    def verdict(self) -> str:
        """In words."""
        if self.normalised is None:
            return "nobody can say: an uncertainty is not known"
        return "they contradict each other" if self.contradicts else "they agree"

    def json_shape(self) -> dict[str, Any]:
        """By name; an E_n that is infinite (both exact) or that nobody knows is None."""
        return {
            "key": self.key,
            "before": self.before,
            "now": self.now,
            "en": None if self.normalised is None or math.isinf(self.normalised) else self.normalised,
            "contradicts": self.contradicts,
            "comparable": self.normalised is not None,
        }


def compare_calibrations(before: Calibration, now: Calibration) -> list[Comparison]:
    """The quantities that both calibrations have."""
    old = before.change.estimates
    return [_compare(key, old[key], one) for key, one in now.change.estimates.items() if key in old]


def compare_with_vehicle(vehicle: Vehicle, now: Calibration) -> list[Comparison]:
    """The quantities of a calibration beside those of a vehicle file."""
    rows = []
    effects = {effect.name: effect.parameters for effect in vehicle.effects}
    for key, one in now.change.quantities.items():
        if key.startswith("motors.time_constant") and "motor_speed_law" in effects:
            continue  # the law stands in the place of the file's time constants
        section, _, name = key.partition(".")
        quantity = getattr(getattr(vehicle, section, None), name, None)
        if isinstance(quantity, Quantity):
            rows.append(_compare(key, Estimate.from_quantity(quantity), one))
    for name, parameters in now.change.effects.items():
        known = effects.get(name, {})
        rows += [
            _compare(f"effects.{name}.{key}", Estimate.from_quantity(known[key]), one)
            for key, one in parameters.items()
            if key in known
        ]
    return rows + _curves(vehicle, now)


def _curves(vehicle: Vehicle, now: Calibration) -> list[Comparison]:
    """A measured thrust curve beside that of the file's map, which says nothing of its own uncertainty."""
    thrust_map = vehicle.motors.thrust_map_compiled()
    return [
        _compare(f"thrust at {volts:g} V", Estimate(thrust_from_voltage(thrust_map, volts), "N", 0.0), thrust)
        for volts, thrust in now.curve.items()
    ]


def _compare(key: str, before: Estimate, now: Estimate) -> Comparison:
    return Comparison(key, before, now, normalised_difference(before, now))
