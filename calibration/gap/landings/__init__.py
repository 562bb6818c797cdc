"""The contact phase: which effect of legs and feet is missing in a vehicle file, found from landings."""

from calibration.gap.landings.findings import LandingFindings
from calibration.gap.landings.judge import judge_landings

__all__ = ["LandingFindings", "judge_landings"]
