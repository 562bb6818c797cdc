"""Where a residual lives and what no named effect explains; ``docs/gap_localisation.md``."""

from calibration.gap.localisation.channels import BY_NAME, CHANNELS, Channel
from calibration.gap.localisation.gap_map import Cell, GapMap, gap_map
from calibration.gap.localisation.regressors import Regressor, regressors

__all__ = ["BY_NAME", "CHANNELS", "Cell", "Channel", "GapMap", "Regressor", "gap_map", "regressors"]
