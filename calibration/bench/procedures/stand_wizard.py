"""What every wizard on the thrust stand begins with: the scale against weights, and the drone on it."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE
from calibration.bench.instruments.scale import ScaleCalibration
from calibration.bench.procedures.inertia import PlanError
from calibration.bench.procedures.motors import SAFETY
from calibration.bench.procedures.operator import Task
from calibration.bench.procedures.run_book import Json, RunBook
from calibration.bench.procedures.thrust_recording import ThrustStand, calibrate_scale

WEIGHTS = (0.0, 0.02, 0.05)
"""kg, of the check of the scale."""


class StandStep(NamedTuple):
    """One step of a wizard.

    Attributes:
        key: in the book.
        title: in words.
        work: carries it out, and gives its result.
    """

    key: str
    title: str
    work: Callable[[], Json]


class StandWizard(ABC):
    """Leads through scale, stand and what is measured on it.

    Args:
        stand: motors, which the wizard has the operator unlock; scale; and supply, if there is one.
    """

    def __init__(self, stand: ThrustStand) -> None:
        self._stand = stand

    def run(self, book: RunBook) -> None:
        """All steps that are not done yet; the operator confirms that motors may turn, each time anew.

        Raises:
            NotConfirmed: nothing was started. Paused, StepBack: the operator's wish.
            ScaleUnusable, InstrumentError, LinkError, MotorsRefused: motors stopped, supply off.
        """
        book.operator.confirm(SAFETY, UNLOCK_PHRASE)
        book.step("scale", "Check the scale with weights", partial(_check_scale, book, self._stand))
        book.step("mount", "Put the drone on the stand", partial(_mount, book))
        for step in self._steps(book):
            book.step(*step)

    @abstractmethod
    def _steps(self, book: RunBook) -> Iterator[StandStep]:
        """What is measured, once scale and stand are ready."""


def kept_calibration(book: RunBook, stand: ThrustStand) -> ScaleCalibration:
    """What the check with weights said.

    Raises:
        PlanError: it was left out, or made with a scale of another kind.
    """
    kept = book.steps["scale"]
    if not kept:
        raise PlanError(f"{book.folder}: the scale was not checked; begin anew with another --out")
    if unit_shown(kept) != stand.scale.unit:
        raise PlanError(
            f"{book.folder}: the scale was checked in {unit_shown(kept)}, this one shows {stand.scale.unit}: "
            "give the same --scale, or begin anew with another --out"
        )
    return ScaleCalibration(kept["zero"], kept["counts_per_kg"])


def unit_shown(kept: Json) -> str:
    """Of what the scale showed: a run that does not say so had a load cell."""
    return str(kept.get("unit", "counts"))


def _check_scale(book: RunBook, stand: ThrustStand) -> Json:
    indications = []
    for mass in WEIGHTS:
        if mass == 0.0:
            task = Task("remove_weight", "Empty the scale: nothing on it, nothing touches it.")
        else:
            task = Task("put_weight", f"Put {1e3 * mass:g} g in the middle of the scale.", {"mass": mass})
        book.operator.do(task)
        indications.append(stand.read().indication)
    book.operator.do(Task("remove_weight", "Take the weight off."))
    calibration = calibrate_scale(stand.scale, WEIGHTS, indications)
    unit = stand.scale.unit
    book.operator.tell(
        f"{abs(calibration.per_kg):.5g} {unit} shown for a kg, linear within "
        f"{1e3 * calibration.nonlinearity:.3f} g"
    )
    return {
        "zero": calibration.zero,
        "counts_per_kg": calibration.per_kg,
        "unit": unit,
        "counts": indications,
    }


def _mount(book: RunBook) -> Json:
    text = (
        "Mount the drone upside down on a stalk of 150 mm or more, so that its thrust pushes the scale. "
        "All four propellers on, power from the supply with short leads."
    )
    book.operator.do(Task("mount_on_scale", text))
    return {}
