"""The contact phase: which effect of legs and feet is missing in a vehicle file, found from landings."""

from calibration.gap.landing.findings import Finding, LandingFindings, LandingResidual, Residual, Verdict
from calibration.gap.landing.judge import judge_landings
from calibration.gap.landing.segments import LandingSegment, NoLanding, find_landings, landing_of

__all__ = [
    "Finding",
    "LandingFindings",
    "LandingResidual",
    "LandingSegment",
    "NoLanding",
    "Residual",
    "Verdict",
    "find_landings",
    "judge_landings",
    "landing_of",
]
