"""The result of a tachometer run: speed law per direction, times of standard steps, JSON."""

from dataclasses import dataclass
from typing import Any

from calibration.bench.motors.clock import ClockFit
from calibration.bench.motors.direction import DirectionFit
from calibration.bench.motors.propellers import PropellerMap
from calibration.bench.motors.settling import PAPER_DOWN, PAPER_UP, STANDARD_STEPS, ThrustStep
from calibration.measurement import Estimate, Finding, rejected
from onboard.gravity import GRAM_FORCE
from onboard.json_file import as_json


@dataclass(frozen=True, slots=True)
class StepSummary:
    """One step that was fitted.

    Attributes:
        name: of its recording.
        begin: s, fitted.
        start, end: rad/s, fitted.
        time_63: of its thrust by the shared law, s.
        thrust_constant: s, of a first-order thrust fitted to this step alone, begin free (as authors did).
        rms: rad/s, of the shared law.
    """

    name: str
    begin: float
    start: float
    end: float
    time_63: float
    thrust_constant: float
    rms: float


@dataclass(frozen=True, slots=True)
class StandardStep:
    """63 % time and best first-order constant of a standard step, by the speed law."""

    step: ThrustStep
    time_63: Estimate
    first_order: Estimate


@dataclass(frozen=True, slots=True)
class TachometerResult:
    """What a tachometer run says about one motor with its propeller.

    Attributes:
        up, down: speed law per direction; None where no step was found.
        propeller: map that turned gram-force into speeds.
        hover_thrust: N per motor at which the local constants are given.
        standard: the steps of :data:`STANDARD_STEPS` whose direction was measured.
        steps: all steps, in the order of the recordings.
        clock: comparison with the host's clock, if there was one.
        findings: what the checks saw.
    """

    up: DirectionFit | None
    down: DirectionFit | None
    propeller: PropellerMap
    hover_thrust: float
    standard: tuple[StandardStep, ...]
    steps: tuple[StepSummary, ...]
    clock: ClockFit | None
    findings: tuple[Finding, ...]

    @property
    def accepted(self) -> bool:
        """Whether both directions were measured and nothing rejects the recordings."""
        return self.up is not None and self.down is not None and not rejected(self.findings)

    @property
    def tau_up(self) -> Estimate | None:
        """s: first-order thrust in place of the step 5 -> 12 gf, as the paper gives it."""
        return self._standard(PAPER_UP)

    @property
    def tau_down(self) -> Estimate | None:
        """s: first-order thrust in place of the step 12 -> 0 gf, as the paper gives it."""
        return self._standard(PAPER_DOWN)

    def _standard(self, step: ThrustStep) -> Estimate | None:
        return next((one.first_order for one in self.standard if one.step == step), None)

    def to_json(self) -> dict[str, Any]:
        """``{tau_up, tau_down, speed_law, hover, standard_steps, steps, alternatives, findings, ...}``."""
        directions = {"up": self.up, "down": self.down}
        document: dict[str, Any] = {
            "schema": "perchhw.tachometer/1",
            "tau_up": self.tau_up,
            "tau_down": self.tau_down,
            "speed_law": {name: None if one is None else _law(one) for name, one in directions.items()},
            "hover": self._hover(),
            "propeller": {"name": self.propeller.name, "source": self.propeller.source},
            "standard_steps": [
                {
                    "step": one.step.label,
                    "time_63": one.time_63,
                    "first_order": one.first_order,
                }
                for one in self.standard
            ],
            "steps": [self._step(one) for one in self.steps],
            "alternatives": {
                name: [
                    {
                        "law": score.name,
                        "equation": score.equation,
                        **score.values,
                        "rms": score.rms,
                        "aic": score.aic,
                    }
                    for score in one.alternatives
                ]
                for name, one in directions.items()
                if one is not None
            },
            "clock": self.clock and self.clock.scale,
            "accepted": self.accepted,
            "findings": self.findings,
            "warnings": [finding.text for finding in self.findings],
        }
        return {key: as_json(part) for key, part in document.items()}

    def _hover(self) -> dict[str, Any]:
        speed = self.propeller.speed(self.hover_thrust)
        return {
            "thrust_gf": self.hover_thrust / GRAM_FORCE,
            "speed_rad_s": speed,
            "tau_up": self.up and self.up.local(speed),
            "tau_down": self.down and self.down.local(speed),
        }

    def _step(self, step: StepSummary) -> dict[str, Any]:
        return {
            "recording": step.name,
            "begin_s": step.begin,
            "direction": "up" if step.end > step.start else "down",
            "from_rad_s": step.start,
            "to_rad_s": step.end,
            "from_gf": self.propeller.thrust(step.start) / GRAM_FORCE,
            "to_gf": self.propeller.thrust(step.end) / GRAM_FORCE,
            "time_63_s": step.time_63,
            "thrust_first_order_s": step.thrust_constant,
            "rms_rad_s": step.rms,
        }


def _law(fit: DirectionFit) -> dict[str, Any]:
    return {
        "a": fit.a,
        "b": fit.b,
        "a_at_bound": fit.a_at_bound,
        "rms_rad_s": fit.fit.rms,
        "samples": int(fit.fit.residuals.size),
        "steps": len(fit.steps),
    }


def standard_steps(
    up: DirectionFit | None, down: DirectionFit | None, propeller: PropellerMap
) -> tuple[StandardStep, ...]:
    """The times of the standard steps by the speed laws."""
    rows: list[StandardStep] = []
    for step in STANDARD_STEPS:
        fit = up if step.rising else down
        if fit is None:
            continue
        start = propeller.speed(step.start_gf * GRAM_FORCE)
        end = propeller.speed(step.end_gf * GRAM_FORCE)
        rows.append(StandardStep(step, fit.time_63(start, end), fit.first_order(start, end)))
    return tuple(rows)
