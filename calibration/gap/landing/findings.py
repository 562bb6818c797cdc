"""What a set of landings says about legs and feet: the result of :func:`judge_landings`."""

from dataclasses import dataclass
from enum import StrEnum

from calibration.gap.landing.approach import ApproachResidual
from calibration.gap.landing.flip import FlipResidual
from calibration.gap.landing.segments import NoLanding

Interval = tuple[float, float]
"""95 % interval."""


class Verdict(StrEnum):
    """What the landings say."""

    EFFECTS_FOUND = "effects_found"
    NO_GAP = "no_gap"
    UNEXPLAINED_GAP = "unexplained_gap"
    """the vehicle does not explain them, and no contact effect does"""
    CANNOT_TELL = "cannot_tell"
    """too few landings, or landings that would look alike with legs far from the filed ones"""


@dataclass(frozen=True)
class Finding:
    """One missing effect.

    Attributes:
        effect: name as in vehicle files.
        parameters: value and 95 % interval by parameter, SI, relative to the vehicle file.
        error_before, error_after: rad/s, median over landings of the RMS rate error in the 0.3 s after the
            contact, without and with the effect, each landing with values that were fitted to the others.
        improvement_ci95: of 1 - after/before, bootstrap over landings.
        ambiguous_with: effects that explain these landings as well.
    """

    effect: str
    parameters: dict[str, tuple[float, Interval]]
    error_before: float
    error_after: float
    improvement_ci95: Interval
    ambiguous_with: tuple[str, ...]


@dataclass(frozen=True)
class Residual:
    """One observable of a landing: measured, and predicted over uncertain starts (median, sd).

    None: this landing does not show it. ``after`` is None where nothing was found.
    """

    measured: float | None
    before: tuple[float, float] | None
    after: tuple[float, float] | None


@dataclass(frozen=True)
class LandingResidual:
    """What is left of one landing.

    Attributes:
        name: of the flight.
        rate_error_before, rate_error_after: rad/s, RMS in the 0.3 s after the contact.
        misfit_before, misfit_after: cost per residual; about 0.1 to 1 where the equations hold.
        peak_rate, rebound_rate: rad/s. impulse: m/s, vertical change of velocity in the first 30 ms.
        swing_period: s. swing_decay: 1/s.
        feet: that hold at the end (measured: None, nobody logs it).
    """

    name: str
    rate_error_before: float
    rate_error_after: float | None
    misfit_before: float
    misfit_after: float | None
    peak_rate: Residual
    rebound_rate: Residual
    impulse: Residual
    swing_period: Residual
    swing_decay: Residual
    feet: Residual


@dataclass(frozen=True)
class LandingFindings:
    """The result.

    Attributes:
        verdict: in one word.
        findings: in the order found.
        allowed: what the data still allow for each effect alone: 95 % interval by effect and parameter.
        residuals: per landing.
        limitations: what was not, or could not be, judged.
        flip: pitch rate before the contact, or None without commands. approach: velocity, or None.
        unused: flights without a usable landing.
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    allowed: dict[str, dict[str, Interval]]
    residuals: tuple[LandingResidual, ...]
    limitations: tuple[str, ...]
    flip: FlipResidual | None
    approach: ApproachResidual | None
    unused: tuple[NoLanding, ...]
