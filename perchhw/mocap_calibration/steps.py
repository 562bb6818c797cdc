"""The steps of the calibration, each kept in the run's book once it is done."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.bench.procedures.operator import StepAgain, StepBack, StepSkipped, Task
from calibration.bench.procedures.run_book import RunBook
from calibration.errors import CalibrationError
from calibration.room.errors import GeometryRefused
from calibration.room.marker_body import HEADINGS_APART_DEG, Rest, rests_apart_deg
from onboard.arrays import FloatArray
from onboard.errors import SafetyStop
from onboard.lab_file import with_subject
from onboard.lab_time import open_timebase
from perchhw.flight.turnaround import Confirm, Turnaround
from perchhw.hover_check.check import fly_check
from perchhw.lab.setup import FlightSetup
from perchhw.mocap_calibration.touches import MOST_TOUCHES, touches_of_one_plane
from perchhw.mocap_calibration.watch import SubjectWatch
from perchhw.screen.display import Display

RESTS = ("rest_1", "rest_2")
_TITLES = dict(zip(RESTS, ("The drone rests", "The drone rests, turned round"), strict=True))
TOUCH_STEPS = tuple(f"touch_{number}" for number in range(1, MOST_TOUCHES + 1))
FLIGHT = "flight"
"""Names of the steps in the book; the last touch is made where the others are not on one plane."""
TOUCHES_APART_M = 0.3
"""m between two touches, for the program to see that it is another."""
FLIGHT_S = 5.0
_FLOWN_ON = "Put the drone upright on its start mark facing +x"


class CalibrationFlightEnded(CalibrationError, SafetyStop):
    """A safety rule ended the flight of a calibration."""


@contextmanager
def forgotten_if_refused(book: RunBook, *keys: str) -> Iterator[None]:
    """Take these steps back when what they measured is refused, so that they are done anew."""
    try:
        yield
    except GeometryRefused:
        book.forget(*keys)
        raise


@dataclass(frozen=True)
class Survey:
    """Who is watched.

    Attributes:
        book: keeps the steps.
        setup: drone, room and motion capture.
        wand: subject whose origin touches the ceiling.
        within: s to wait for each step.
    """

    book: RunBook
    setup: FlightSetup
    wand: str
    within: float

    def places(self) -> tuple[Rest, Rest, FloatArray]:
        """Two rests of the drone and the touches of the wand, (4, 3) in m, or (5, 3) where four disagreed.

        Raises:
            GeometryRefused: a step was not done within its time.
            Paused: the operator goes on later.
        """
        while True:
            try:
                return self._places()
            except StepBack:  # the book has forgotten the last step
                self.book.restart()

    def _places(self) -> tuple[Rest, Rest, FloatArray]:
        with open_timebase("mocap calibrate", self.setup.mocap) as time:
            with SubjectWatch(self.setup.mocap, time) as drone:
                first = self._rest(
                    drone,
                    RESTS[0],
                    "Put the drone on a level plate, its centre over a mark, its nose along +x, and let go",
                    None,
                )
                second = self._rest(
                    drone,
                    RESTS[1],
                    "Turn it by half a turn, its centre over the same mark, and let go",
                    first,
                )
            with SubjectWatch(with_subject(self.setup.mocap, self.wand), time) as wand:
                touches = touches_of_one_plane(
                    partial(self._touch, wand),
                    lambda number: self.book.forget(TOUCH_STEPS[number - 1]),
                    self.book.operator.warn,
                    goes_on=TOUCH_STEPS[-1] in self.book.steps,
                )
        return first, second, touches

    def flight(self, setup: FlightSetup, out: Path, confirm: Confirm, display: Display) -> Path:
        """A hover with small quick tilts, with `setup` of what the rests said; gives its record.

        Raises:
            CalibrationFlightEnded: a safety rule ended it.
        """

        def fly() -> dict[str, Any]:
            Turnaround(setup.drone, confirm, _FLOWN_ON).put_back()
            flown = fly_check(setup, out, FLIGHT_S, display)
            if flown.aborted_by is not None:
                raise CalibrationFlightEnded(
                    f"the flight was ended by {flown.aborted_by} ({flown.record}); rests and touches are kept"
                )
            return {"record": str(flown.record)}

        return Path(self.book.step(FLIGHT, "Hover and small tilts", fly)["record"])

    def _rest(self, watch: SubjectWatch, key: str, request: str, other: Rest | None) -> Rest:
        def refuse(rest: Rest) -> str | None:
            if other is None or rests_apart_deg(rest, other) >= HEADINGS_APART_DEG:
                return None
            return (
                f"the drone rests {rests_apart_deg(rest, other):.0f} deg from its first heading; turn it by "
                f"half a turn ({HEADINGS_APART_DEG:g} deg at least)"
            )

        def work() -> dict[str, Any]:
            self._ask(Task(key, request))
            return _kept(watch.rest(self.within, refuse))

        return _rest_of(self.book.step(key, _TITLES[key], work))

    def _ask(self, task: Task) -> None:
        try:
            self.book.operator.do(task)
        except StepSkipped as skipped:
            self.book.operator.warn("No step can be left out: all of them are needed.")
            raise StepAgain("it is needed") from skipped

    def _touch(
        self, watch: SubjectWatch, number: int, others: Sequence[FloatArray], where: str
    ) -> FloatArray:
        def refuse(rest: Rest) -> str | None:
            nearest = min((float(np.linalg.norm(rest.position - one)) for one in others), default=np.inf)
            if nearest >= TOUCHES_APART_M:
                return None
            return f"the wand is {100.0 * nearest:.0f} cm from another touch; touch {number}: {where}"

        request = (
            f"Touch the ceiling with the marker of {self.wand}, point {number}: {where}; hold still for 2 s"
        )

        def work() -> dict[str, Any]:
            self._ask(Task("touch", request))
            return _kept(watch.rest(self.within, refuse))

        return _rest_of(self.book.step(TOUCH_STEPS[number - 1], f"Touch {number}", work)).position


def _kept(rest: Rest) -> dict[str, Any]:
    return {
        "position": rest.position.tolist(),
        "quaternion": rest.attitude.as_quat().tolist(),
        "place_scatter": rest.place_scatter,
        "attitude_scatter": rest.attitude_scatter,
        "samples": rest.samples,
    }


def _rest_of(kept: dict[str, Any]) -> Rest:
    return Rest(
        np.array(kept["position"]),
        Rotation.from_quat(kept["quaternion"]),
        float(kept["place_scatter"]),
        float(kept["attitude_scatter"]),
        int(kept["samples"]),
    )
