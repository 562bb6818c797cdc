"""Where a residual lives and what no named effect explains; ``docs/gap_localisation.md``."""

from calibration.gap.data.channels import BY_NAME, CHANNELS, Channel
from calibration.gap.unnamed.gap_map import Cell, GapMap, gap_map
from calibration.gap.unnamed.lines import Line, find_lines
from calibration.gap.unnamed.regressors import Regressor, regressors
from calibration.gap.unnamed.structure import Structure, structured
from calibration.gap.unnamed.term_search import unnamed_terms
from calibration.gap.unnamed.terms import IntervalTerm, LineTerm, PolynomialTerm, UnnamedTerm

__all__ = [
    "BY_NAME",
    "CHANNELS",
    "Cell",
    "Channel",
    "Structure",
    "GapMap",
    "IntervalTerm",
    "Line",
    "LineTerm",
    "PolynomialTerm",
    "Regressor",
    "UnnamedTerm",
    "find_lines",
    "gap_map",
    "regressors",
    "structured",
    "unnamed_terms",
]
