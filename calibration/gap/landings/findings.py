"""What a set of landings says about legs and feet: the result of :func:`judge_landings`."""

from dataclasses import dataclass
from typing import Any

from calibration.gap.data.found_effect import FoundEffect, Verdict
from calibration.gap.data.record import NotUsed
from calibration.gap.landings.flip import FlipResidual
from calibration.measurement import Interval


@dataclass(frozen=True)
class LandingFindings:
    """The result.

    Attributes:
        findings: in the order found. Errors are rad/s, median over landings of the RMS rate error in the
            0.3 s after the contact, each landing with values that were fitted to the others. What ended at
            the end of what is searched is at its bound: no value.
        allowed: what the data still allow for each effect alone: 95 % interval by effect and parameter.
        misfit: their median cost per residual with the vehicle as it was given: about 0.1 to 1 where the
            equations hold; None where they are too few to be judged, or the vehicle does not fly them at all.
        flip: pitch rate before the contact, or None without commands.
    """

    verdict: Verdict
    findings: tuple[FoundEffect, ...]
    allowed: dict[str, dict[str, Interval]]
    usable: tuple[str, ...]
    misfit: float | None
    limitations: tuple[str, ...]
    flip: FlipResidual | None
    unused: tuple[NotUsed, ...]

    def json_shape(self) -> dict[str, Any]:
        """Which landings were looked at, as the report has it: its effects stand among those of the air."""
        return {"usable": self.usable, "refused": self.unused, "misfit": self.misfit, "flips": self.flip}
