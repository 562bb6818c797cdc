"""The result of a thrust run: forms, the chosen one, its band and domain, and what a vehicle takes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.bench.thrust.choose import FormReport, map_json
from calibration.bench.thrust.compensation import REPORTED_VOLTAGES, achievable
from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.errors import ThrustTableError
from calibration.measurement import Estimate, Finding, rejected
from onboard.arrays import FloatArray
from onboard.battery import voltage_from_thrust
from onboard.gravity import GRAM_FORCE
from onboard.vehicle.model import ThrustMapDescription


@dataclass(frozen=True, slots=True)
class ThrustResult:
    """Maps fitted to one table.

    Attributes:
        data: the points.
        forms: all that were fitted, by name.
        chosen: name of the one to use.
        thrust_min, thrust_max: N, range that was measured.
        findings: what the checks saw.
    """

    data: ThrustData
    forms: dict[str, FormReport]
    chosen: str
    thrust_min: Estimate
    thrust_max: Estimate
    findings: tuple[Finding, ...]

    @property
    def best(self) -> FormReport:
        """The chosen form."""
        return self.forms[self.chosen]

    @property
    def accepted(self) -> bool:
        """Whether nothing rejects the table."""
        return not rejected(self.findings)

    def band(self, voltage: FloatArray) -> FloatArray:
        """Half width (N) of the 95 % band of the chosen curve at `voltage` (V)."""
        return self.best.band(np.asarray(voltage), list(self.forms.values())) * GRAM_FORCE

    def thrust_at(self, voltage: float) -> Estimate:
        """Thrust (N) at the motor voltage (V) by the chosen form."""
        value = float(self.best.fit.thrust_at(np.array([voltage]))[0]) * GRAM_FORCE
        return Estimate(value, "N", float(self.band(np.array([voltage]))[0]) / 1.96)

    def achievable(self) -> dict[float, Estimate]:
        """Most thrust (N) of one motor by battery voltage (V); beyond what was measured, extrapolated."""
        compiled = _map(self.best).compiled()
        found: dict[float, Estimate] = {}
        for battery in REPORTED_VOLTAGES:
            most = achievable(compiled, battery)
            found[battery] = Estimate(most, "N", self.thrust_at(voltage_from_thrust(compiled, most)).sigma)
        return found

    def json_shape(self) -> dict[str, Any]:
        """``{forms, chosen, rms_gf, thrust_min, thrust_max, achievable, findings, ...}``."""
        highest = float(np.max(self.data.voltage))
        document: dict[str, Any] = {
            "schema": "perchhw.thrust/1",
            "source": self.data.source,
            "forms": self.forms,
            "chosen": self.chosen,
            "rms_gf": self.best.fit.rms,
            "thrust_min": self.thrust_min,
            "thrust_max": self.thrust_max,
            "achievable": [
                {"battery_v": battery, "thrust": most, "extrapolated": battery > highest}
                for battery, most in self.achievable().items()
            ],
            "accepted": self.accepted,
            "findings": self.findings,
            "warnings": [finding.text for finding in self.findings],
        }
        return document


def flyable_map(result: ThrustResult, form: str | None = None) -> ThrustMapDescription:
    """The map of a form (None for the chosen one) as a vehicle file takes it.

    Raises:
        ThrustTableError: the form is not one that may fly.
    """
    name = result.chosen if form is None else form
    if name not in result.forms or not result.forms[name].usable:
        usable = ", ".join(one.name for one in result.forms.values() if one.usable)
        raise ThrustTableError(f"form {name!r} may not fly here; choose one of {usable}")
    return _map(result.forms[name])


def _map(report: FormReport) -> ThrustMapDescription:
    if report.map is None:
        raise ThrustTableError(f"{report.name} is for comparison only")
    return report.map


def imported_json(maps: dict[str, ThrustMapDescription]) -> dict[str, Any]:
    """The same shape for maps that come as coefficients: no points, hence no rms."""
    forms: dict[str, Any] = {}
    for name, description in maps.items():
        compiled = description.compiled()
        forms[name] = {
            "form": description.form.name.lower(),
            "source": next(iter(description.coefficients.values())).source,
            "coefficients": map_json(description),
            "achievable": [
                {
                    "battery_v": battery,
                    "thrust": {"value": achievable(compiled, battery), "unit": "N", "u95": None},
                }
                for battery in REPORTED_VOLTAGES
            ],
        }
    return {"schema": "perchhw.thrust/1", "forms": forms, "chosen": next(iter(forms)), "rms_gf": None}
