"""The contact phase: which effect of legs and feet is missing in a vehicle file, found from landings."""

from calibration.gap.landings.findings import LandingFindings, LandingVerdict
from calibration.gap.landings.judge import judge_landings

__all__ = ["LandingFindings", "LandingVerdict", "judge_landings"]
