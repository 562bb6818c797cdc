"""Every landing of a report as a picture with its words, those first that were predicted worst."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.gap.landings.outcomes.differences import differences
from calibration.gap.landings.outcomes.document import LandingReport
from calibration.gap.landings.outcomes.labels import CLASS_NAMES, landing_class
from calibration.gap.landings.outcomes.measured_motion import MeasuredMotion, measured_motion
from calibration.gap.landings.outcomes.predict import Forecast
from calibration.gap.landings.outcomes.simulated_motion import (
    AFTER_CONTACT,
    SimulatedMotion,
    simulated_motion,
)
from calibration.gap.report.landing_figure import ShownLanding, landing_figure
from calibration.report_style import RASTER_DPI, png, report_style
from onboard.outcome import Outcome

_BEYOND = 0.05
"""s that are drawn beyond the end of a landing."""
_UNTOUCHED = 0.3
"""s after the trigger that stand for a contact where nothing touches."""

_HOW = {
    Outcome.FOUR_LEG: "held on four legs",
    Outcome.FOUR_LEG_BODY_CONTACT: "held on four legs, and its body touched",
    Outcome.TWO_LEG: "held on two legs",
    Outcome.TWO_LEG_BODY_CONTACT: "held on two legs, and its body touched",
    Outcome.FAILURE: "held on no leg",
    Outcome.NO_TRIGGER: "never flipped, it is said",
    Outcome.ABORTED: "was aborted, it is said",
}


@dataclass(frozen=True)
class LandingPicture:
    """A landing as a picture.

    Attributes:
        index: of the flight in its report. name: of the flight.
        drawn: PNG file.
        words: what happened, what was expected, and by which both part.
        left_out: what the picture does not show, and why; may be empty.
    """

    index: int
    name: str
    drawn: bytes
    words: str
    left_out: str

    @property
    def alt(self) -> str:
        """What the picture shows, for who cannot see it."""
        return f"Motion of {self.name}, measured over simulated. {self.words}"


def landing_pictures(report: LandingReport, parameters: Any) -> Iterator[LandingPicture]:
    """Draw every landing, one after the other.

    Args:
        report: what to show. parameters: physics of its vehicle.
    """
    for index in by_surprise(report):
        yield _picture(report, index, parameters)


def by_surprise(report: LandingReport) -> list[int]:
    """Indices of the flights: those first whose end had the least probability, those without one last."""
    return sorted(range(len(report.real)), key=lambda index: _probability(report, index))


def _probability(report: LandingReport, index: int) -> float:
    """What was expected of how a flight ended; infinite where nobody knows that."""
    real = report.real[index]
    known = None if real is None else landing_class(real)
    return np.inf if known is None else float(report.forecast.flights[index].probability[known])


def _picture(report: LandingReport, index: int, parameters: Any) -> LandingPicture:
    prepared, expected = report.prepared, report.forecast.flights[index]
    touched = [when for when in (expected.contact, expected.measured_contact) if when is not None]
    horizon = max(touched, default=_UNTOUCHED) + AFTER_CONTACT + _BEYOND
    measured = measured_motion(prepared, index, report.vehicle, horizon)
    simulated = simulated_motion(prepared, index, parameters, horizon)
    start, ceiling = prepared.starts[index].state["position"][0], float(prepared.ceilings[index])
    with report_style():
        shown = ShownLanding(measured, simulated, start, ceiling, report.vehicle, parameters)
        drawn = png(landing_figure(shown), RASTER_DPI)
    words = f"{_ended(report.real[index], expected)} {_apart(measured, simulated)}"
    return LandingPicture(index, expected.name, drawn, words, _left_out(measured))


def _ended(real: Outcome | None, expected: Forecast) -> str:
    happened = "Nobody said how it ended" if real is None else f"It {_HOW[real]}"
    shares = zip(CLASS_NAMES, expected.probability, strict=True)
    told = ", ".join(f"{name} {share:.2f}" for name, share in shares)
    return f"{happened}; expected were {told}."


def _apart(measured: MeasuredMotion, simulated: SimulatedMotion) -> str:
    if not measured.clock_known:
        return "When its log was taken is not known, so it is not compared."
    found = differences(measured, simulated)
    if not found:
        return "Up to the contact the log shows nothing that most draws do not."
    return f"First apart: {'; '.join(one.words for one in found)}."


def _left_out(measured: MeasuredMotion) -> str:
    moved = f"The log's times are moved by {1e3 * measured.clock:+.0f} ms, as its gyro asks."
    if not measured.left_out:
        return moved
    return f"{moved} Not shown or not known: {'; '.join(measured.left_out)}."
