"""The contact phase: which effect of legs and feet is missing in a vehicle file, found from landings."""

from calibration.gap.landing.findings import Finding, LandingFindings, Verdict
from calibration.gap.landing.judge import judge_landings

__all__ = ["Finding", "LandingFindings", "Verdict", "judge_landings"]
