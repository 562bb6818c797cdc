"""What a set of landings says about legs and feet: the result of :func:`judge_landings`."""

from dataclasses import dataclass
from enum import StrEnum

from calibration.gap.data.record import NotUsed
from calibration.gap.landings.flip import FlipResidual
from calibration.measurement import Interval


class LandingVerdict(StrEnum):
    """What the landings say, by their motion or by their outcomes."""

    EFFECTS_FOUND = "effects_found"
    NO_GAP = "no_gap"
    UNEXPLAINED_GAP = "unexplained_gap"
    """the vehicle does not explain them, and no effect does"""
    CANNOT_TELL = "cannot_tell"
    """too few landings, or landings that would look alike with legs far from the filed ones"""


@dataclass(frozen=True)
class LandingEffect:
    """One missing effect.

    Attributes:
        effect: name as in vehicle files.
        parameters: value and 95 % interval by parameter, SI, relative to the vehicle file.
        error_before, error_after: rad/s, median over landings of the RMS rate error in the 0.3 s after the
            contact, without and with the effect, each landing with values that were fitted to the others.
        improvement_ci95: rad/s, of `error_before` minus `error_after`, bootstrap over landings.
        ambiguous_with: effects that explain these landings as well.
        at_bound: parameters that ended at the end of what is searched: no values.
    """

    effect: str
    parameters: dict[str, tuple[float, Interval]]
    error_before: float
    error_after: float
    improvement_ci95: Interval
    ambiguous_with: tuple[str, ...]
    at_bound: tuple[str, ...]


@dataclass(frozen=True)
class LandingFindings:
    """The result.

    Attributes:
        verdict: in one word.
        findings: in the order found.
        allowed: what the data still allow for each effect alone: 95 % interval by effect and parameter.
        usable: names of the flights whose landings can be judged.
        misfit: their median cost per residual with the vehicle as it was given: about 0.1 to 1 where the
            equations hold; None where they are too few to be judged.
        limitations: what was not, or could not be, judged.
        flip: pitch rate before the contact, or None without commands.
        unused: flights without a usable landing.
    """

    verdict: LandingVerdict
    findings: tuple[LandingEffect, ...]
    allowed: dict[str, dict[str, Interval]]
    usable: tuple[str, ...]
    misfit: float | None
    limitations: tuple[str, ...]
    flip: FlipResidual | None
    unused: tuple[NotUsed, ...]
