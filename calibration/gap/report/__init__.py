"""The gap finder's report: the document for programs (``report.json``) and the page for people."""

from calibration.gap.report.document import (
    SCHEMA,
    AmbiguousSet,
    Flips,
    FoundEffect,
    FoundParameter,
    Gap,
    GapReport,
    Landings,
    Levels,
    Rejected,
    Unexplained,
    UnusableFile,
    Verdict,
    Where,
)
from calibration.gap.report.figures_data import (
    ClosedLoopTrace,
    HeatMap,
    HorizonCurves,
    ReportFigures,
    ResidualCloud,
    StageBars,
)
from calibration.gap.report.writing import HTML_FILE, JSON_FILE, write_report

__all__ = [
    "HTML_FILE",
    "JSON_FILE",
    "SCHEMA",
    "AmbiguousSet",
    "ClosedLoopTrace",
    "Flips",
    "FoundEffect",
    "FoundParameter",
    "Gap",
    "GapReport",
    "HeatMap",
    "HorizonCurves",
    "Landings",
    "Levels",
    "Rejected",
    "ReportFigures",
    "ResidualCloud",
    "StageBars",
    "Unexplained",
    "UnusableFile",
    "Verdict",
    "Where",
    "write_report",
]
