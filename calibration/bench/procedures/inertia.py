"""The bifilar wizard: weigh, hang, twist, and the moments of inertia come out.

Every number that a person measured and every recording is in the run's folder, and :func:`fit_inertia` makes
the result from them alone: the same now and after a better fit was written.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from calibration.bench.inertia.errors import UnusableSwingError
from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.inertia import InertiaResult, inertia_about_axis
from calibration.bench.inertia.plan import HangPlan, Instruments, plan_hang
from calibration.bench.inertia.recordings import read_swing, write_swing
from calibration.bench.inertia.rest import check_rest
from calibration.bench.inertia.rig import Jig, Rig
from calibration.bench.inertia.swing import Swing
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.bench.instruments.gyro_recorder import GyroRecorder
from calibration.bench.procedures.operator import Question, Task
from calibration.bench.procedures.readings import estimate_of
from calibration.bench.procedures.run_book import Json, RunBook
from calibration.bench.procedures.swing_recording import record_rest, record_swing, wait_until_quiet
from calibration.errors import CalibrationError
from calibration.measurement import Estimate, Finding, Severity, rejected
from onboard.arrays import Vector
from onboard.errors import InputError
from onboard.vehicle import Vehicle

KIND = "bifilar"
AXES: Mapping[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
TWIST = math.radians(9.0)
"""In the middle of the 5 to 12 deg that a person is asked for."""
REHANG_BEFORE = 4
"""The trial before which the drone is hung up anew, so that the spread holds what hanging does."""
TRIES = 4
"""Recordings of one trial before the wizard gives up on it."""

TOOLS: Mapping[str, Instruments] = {
    "jig": Instruments(),
    "ruler": Instruments(distance=0.5e-3, length=1e-3, mass=0.1e-3),
}
"""What measures: a printed jig and a fine balance, or a ruler and a kitchen scale (bench notes 1.1)."""


class PlanError(CalibrationError, InputError):
    """A plan that nobody can carry out."""


@dataclass(frozen=True)
class InertiaPlan:
    """What is to be measured.

    Attributes:
        vehicle: as it is believed to be; its inertias choose the strings.
        axes: body axes in their order, of "xyz".
        trials: of each axis.
        cycles: of each trial.
        tools: key of :data:`TOOLS`.
        jig: whether the drone hangs in something that weighs.
    """

    vehicle: Vehicle
    axes: str = "zxy"
    trials: int = 5
    cycles: int = 20
    tools: str = "jig"
    jig: bool = False

    def __post_init__(self) -> None:
        """Refuse axes and tools that do not exist."""
        if not self.axes or len(set(self.axes)) < len(self.axes) or not set(self.axes) <= set(AXES):
            raise PlanError(f"axes {self.axes!r}: write each of x, y, z once, in the order of hanging")
        if self.tools not in TOOLS:
            raise PlanError(f"tools {self.tools!r}: choose {' or '.join(TOOLS)}")

    def settings(self) -> Json:
        """What must stay the same when a run goes on."""
        return {
            "vehicle": self.vehicle.name,
            "axes": self.axes,
            "trials": self.trials,
            "cycles": self.cycles,
            "tools": self.tools,
            "jig": self.jig,
        }

    def hang(self, axis: str) -> HangPlan:
        """Distance and length of the strings for one axis."""
        body = self.vehicle.body
        expected = getattr(body, f"inertia_{axis}{axis}").value
        return plan_hang(expected, body.mass.value, TOOLS[self.tools])


def questions(tools: str) -> dict[str, Question]:
    """Everything that is measured by hand, by name."""
    widths = TOOLS[tools]
    distance, length, mass = widths.distance, widths.length, widths.mass
    rows = (
        Question(
            "mass", "everything that hangs, battery in, propellers taped", "kg", "g", (0.005, 2.0), mass
        ),
        Question("jig_mass", "the jig alone", "kg", "g", (0.0, 1.0), mass),
        Question("jig_inertia", "the jig's inertia about the vertical", "kg m2", "kg m2", (0.0, 1e-2), 0.0),
        Question(
            "string_distance_top", "distance of the strings at the top", "m", "mm", (0.01, 0.5), distance, 3
        ),
        Question(
            "string_distance_bottom",
            "distance of the strings at the drone",
            "m",
            "mm",
            (0.01, 0.5),
            distance,
            3,
        ),
        Question("string_length", "length of the strings, drone hanging", "m", "mm", (0.1, 5.0), length, 3),
    )
    return {row.name: row for row in rows}


class InertiaWizard:
    """Leads through the hangs.

    Args:
        plan: what is measured.
        recorder: the drone's gyro; it refuses armed motors.
    """

    def __init__(self, plan: InertiaPlan, recorder: GyroRecorder) -> None:
        self._plan = plan
        self._recorder = recorder
        self._questions = questions(plan.tools)

    def run(self, book: RunBook) -> None:
        """All steps that are not done yet.

        Raises:
            Paused, StepBack: the operator's wish. LinkLost, InstrumentLost: of the drone.
            NothingMoved, UnusableSwingError: a trial failed :data:`TRIES` times.
        """
        book.step("weigh", "Weigh what hangs", partial(self._weigh, book))
        for axis in self._plan.axes:
            book.step(f"hang-{axis}", f"Hang it, body axis {axis} vertical", partial(self._hang, book, axis))
            book.step(f"rest-{axis}", "Look at it hanging still", partial(self._rest, book, axis))
            for number in range(1, self._plan.trials + 1):
                book.step(
                    f"trial-{axis}-{number}",
                    f"Swing {number} of {self._plan.trials} about {axis}",
                    partial(self._trial, book, axis, number),
                )

    def _weigh(self, book: RunBook) -> Json:
        names = ["mass", "jig_mass", "jig_inertia"] if self._plan.jig else ["mass"]
        return {name: book.operator.measure(self._questions[name]) for name in names}

    def _hang(self, book: RunBook, axis: str) -> Json:
        plan = self._plan.hang(axis)
        book.operator.tell(
            f"Period about {plan.period:.2f} s; the inertia will be known to about "
            f"{196.0 * plan.uncertainty:.1g} % (95 %)."
        )
        book.operator.do(self._hang_task(axis, plan))
        names = ("string_distance_top", "string_distance_bottom", "string_length")
        return {name: book.operator.measure(self._questions[name]) for name in names}

    def _hang_task(self, axis: str, plan: HangPlan, again: bool = False) -> Task:
        text = (
            f"Hang the drone from two braided lines of 0.12 mm or less, {1e3 * plan.distance:.0f} mm apart "
            f"above and below and {1e3 * plan.length:.0f} mm long, body axis {axis} vertical, disarmed."
        )
        if again:
            text = "Take the drone out of its loops and hang it as before: that shows what hanging changes."
        parameters = {
            "axis": AXES[axis],
            "string_distance_top": plan.distance,
            "string_distance_bottom": plan.distance,
            "string_length": plan.length,
        }
        return Task("hang", text, parameters)

    def _rest(self, book: RunBook, axis: str) -> Json:
        for _ in range(TRIES):
            book.operator.do(Task("damp", "Stop it with a finger and let it hang.", noticed=True))
            wait_until_quiet(self._recorder, book.operator)
            swing = record_rest(self._recorder, book.operator, AXES[axis], f"rest-{axis}")
            kept = book.keep_raw(f"rest-{axis}", partial(write_swing, swing=swing))
            check = check_rest(swing)
            for finding in check.findings:
                book.operator.warn(finding.text)
            if not rejected(check.findings):
                return {"raw": kept, "tilt": check.tilt, "bias": list(check.bias)}
        raise UnusableSwingError(
            f"axis {axis}: the drone never hung still in {TRIES} looks; find what moves it"
        )

    def _trial(self, book: RunBook, axis: str, number: int) -> Json:
        if number == REHANG_BEFORE:
            book.operator.do(self._hang_task(axis, self._plan.hang(axis), again=True))
        for _ in range(TRIES):
            kept, fit = self._record(book, axis, f"{axis}-{number}")
            if fit is not None and not fit.rejected:
                book.operator.tell(
                    f"T0 = {fit.period.value:.4f} s, amplitude {math.degrees(fit.start_amplitude):.1f} to "
                    f"{math.degrees(fit.end_amplitude):.1f} deg, swing {100.0 * fit.swing_share:.1f} %"
                )
                return {"raw": kept}
            book.operator.warn("This one does not count (it is kept). Once more.")
        raise UnusableSwingError(
            f"swing {number} about {axis}: {TRIES} recordings in a row cannot be used; the reasons are above"
        )

    def _record(self, book: RunBook, axis: str, stem: str) -> tuple[Json, SwingFit | None]:
        operator = book.operator
        operator.do(Task("damp", "Stop all swinging with a finger.", noticed=True))
        wait_until_quiet(self._recorder, operator)
        text = "Twist it by 5 to 12 deg about the vertical and let go without pushing."
        operator.do(Task("twist", text, {"angle": TWIST}, noticed=True))
        swing = record_swing(self._recorder, operator, AXES[axis], stem, self._plan.cycles)
        kept = book.keep_raw(stem, partial(write_swing, swing=swing))
        try:
            fit = fit_swing(swing)
        except UnusableSwingError as error:
            operator.warn(str(error))
            return kept, None
        for finding in fit.findings:
            if finding.severity is not Severity.NOTE:
                operator.warn(finding.text)
        return kept, fit


@dataclass(frozen=True)
class InertiaFits:
    """What a run gives.

    Attributes:
        results: by axis.
        swings: fits of the trials by axis.
        inputs: what was measured by hand.
        raw: recordings that were used.
    """

    results: dict[str, InertiaResult]
    swings: dict[str, list[SwingFit]]
    inputs: dict[str, Estimate]
    raw: list[dict[str, str]]

    @property
    def findings(self) -> list[Finding]:
        """Of all axes and trials."""
        of_swings = [one for fits in self.swings.values() for fit in fits for one in fit.findings]
        return [*(one for result in self.results.values() for one in result.findings), *of_swings]


def fit_inertia(folder: Path, steps: Mapping[str, Any], plan: InertiaPlan) -> InertiaFits:
    """The inertias of a run, from its folder.

    Args:
        folder: of the run.
        steps: finished steps of its book.
        plan: as it was recorded.

    Raises:
        RigError, SwingFileError, UnusableSwingError: what was recorded gives no result.
    """
    asked = questions(plan.tools)

    def known(step: str, name: str) -> Estimate:
        return estimate_of(steps[step][name], asked[name])

    inputs: dict[str, Estimate] = {"mass": known("weigh", "mass")}
    jig = None
    if plan.jig:
        jig = Jig(known("weigh", "jig_mass"), known("weigh", "jig_inertia"))
        inputs |= {"jig mass": jig.mass, "jig inertia": jig.inertia}
    results, swings, raw = {}, {}, []
    for axis in plan.axes:
        hang = f"hang-{axis}"
        trials = [steps.get(f"trial-{axis}-{number}", {}) for number in range(1, plan.trials + 1)]
        kept = [trial["raw"] for trial in trials if "raw" in trial]
        if not kept or not steps.get(hang):
            continue
        rig = Rig(
            mass=known("weigh", "mass"),
            top=known(hang, "string_distance_top"),
            bottom=known(hang, "string_distance_bottom"),
            length=known(hang, "string_length"),
            jig=jig,
        )
        recorded: list[Swing] = [
            replace(read_swing(folder / one["file"], AXES[axis]), source=one["file"]) for one in kept
        ]
        swings[axis] = [fit_swing(swing) for swing in recorded]
        expected = getattr(plan.vehicle.body, f"inertia_{axis}{axis}").value
        results[axis] = inertia_about_axis(swings[axis], rig, expected)
        inputs |= {f"{name} ({axis})": getattr(rig, name) for name in ("top", "bottom", "length")}
        raw += kept
    return InertiaFits(results, swings, inputs, raw)
