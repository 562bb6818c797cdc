"""The steps that fly: under the same supervisor as every test flight and every attempt."""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from onboard.outcome import Outcome
from onboard.policy.files import find_policy, load_policy, save_policy
from onboard.policy.model import Policy
from onboard.vehicle import load_vehicle
from perchhw.attempt import AttemptResult
from perchhw.bringup.flown import CourseWindow, hover_findings, step_findings
from perchhw.doctor.check_result import CheckResult, judged
from perchhw.flight import fly_attempt
from perchhw.flight.course import CourseRequest, fly_uninterrupted
from perchhw.lab.setup import FlightSetup
from perchhw.record import discard_if_empty, new_run_folder, read_run
from perchhw.screen.display import Display

HOVER_S = 20.0
GENTLE_CLIMB = 1.2
"""m/s of climb of the approach that must miss: at up to 1.6 m/s braking ends below the ceiling."""
_FLIGHT_WHY = "what the supervisor ends is not ready for the next step"
_FLIGHT_REMEDY = (
    "did it turn over as it took off: exchanged motors, or a propeller of the wrong direction; else "
    "perchhw log view shows the record, and docs/safety.md the rule"
)


@dataclass(frozen=True)
class Flights:
    """Flies steps of the ladder.

    Attributes:
        setup: what flies where.
        out: folder for the records.
        speed, angle_deg: of the first landing (m/s, deg).
        display: where they are shown.
    """

    setup: FlightSetup
    out: Path
    speed: float
    angle_deg: float
    display: Display | None = None

    def hover(self) -> tuple[CheckResult, ...]:
        """20 s in one place: thrust, imbalance, vibration against the vehicle file."""
        vehicle = load_vehicle(self.setup.vehicle, self.setup.legs)
        return self._course(
            "hover",
            "long_discharge",
            {"seconds": HOVER_S},
            lambda window, course: hover_findings(window, course, vehicle),
        )

    def step(self) -> tuple[CheckResult, ...]:
        """Steps to all sides, each levelled out."""
        return self._course("step", "attitude_doublets", {"repeats": 1.0}, step_findings)

    def approach(self) -> tuple[CheckResult, ...]:
        """An approach with a policy that cannot fire: it must brake, and hand back."""
        speed = min(self.speed, GENTLE_CLIMB / math.sin(math.radians(self.angle_deg)))
        folder = new_run_folder(self.out, "bringup-policy")
        file = folder / "silent.policy.json"
        save_policy(silent(load_policy(find_policy(self.setup.policy))), file)
        result = self._attempt(dataclasses.replace(self.setup, policy=str(file)), speed)
        return (
            _flight(result.aborted_by, result.record, result.diagnosis),
            judged(
                "missed_trigger",
                result.outcome is Outcome.NO_TRIGGER and not result.triggered and result.fell is None,
                result.fell or result.outcome.value,
                Outcome.NO_TRIGGER.value,
                "a trigger that does not come must end in a brake below the ceiling and a landing",
                "do not go on: read the record, and docs/flying.md on what it should have done",
            ),
        )

    def landing(self) -> tuple[CheckResult, ...]:
        """The first landing."""
        result = self._attempt(self.setup, self.speed)
        return (
            _flight(result.aborted_by, result.record, result.diagnosis),
            judged(
                "landed",
                result.outcome.attached,
                result.fell or result.outcome.value,
                "it hangs from the ceiling",
                "it is what all of this was for",
                "clean the pads and the ceiling, look at trigger and label: perchhw log label",
            ),
        )

    def _course(
        self,
        name: str,
        kind: str,
        parameters: dict[str, float],
        judge: Callable[..., tuple[CheckResult, ...]],
    ) -> tuple[CheckResult, ...]:
        folder = new_run_folder(self.out, f"bringup-{name}")
        request = CourseRequest.of(self.setup, kind, parameters, folder)
        result = fly_uninterrupted(request, **self._shown(folder, name))
        flight = _flight(result.aborted_by, result.record, result.diagnosis)
        if flight.missing:
            return (flight,)
        course = request.course()
        return (flight, *judge(CourseWindow.of(read_run(result.record), course), course))

    def _attempt(self, setup: FlightSetup, speed: float) -> AttemptResult:
        request = setup.attempt(speed, self.angle_deg, self.out)
        try:
            return fly_attempt(
                request, **self._shown(request.folder, f"{speed:.2g} m/s, {self.angle_deg:g} deg")
            )
        finally:
            discard_if_empty(request.folder)

    def _shown(self, folder: Path, what: str) -> dict[str, Any]:
        return {} if self.display is None else self.display.shows(folder, what)


def silent(policy: Policy) -> Policy:
    """The same policy, whose trigger value is negative everywhere: a kernel is at most 1."""
    never = -(1.0 + float(np.sum(policy.dual_coefficients, dtype=np.float64)))
    return dataclasses.replace(policy, name=f"{policy.name}, silent", intercept=np.float32(never))


def _flight(aborted_by: str | None, record: Path, diagnosis: dict[str, Any] | None) -> CheckResult:
    measured = f"ended by {aborted_by}" if aborted_by is not None else "to its end"
    remedy = _FLIGHT_REMEDY if diagnosis is None else f"{diagnosis['next']}; {_FLIGHT_REMEDY}"
    return judged("flight", aborted_by is None, f"{measured} ({record})", "to its end", _FLIGHT_WHY, remedy)
