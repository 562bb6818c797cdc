"""The gap finder's report: the document for programs (``report.json``) and the page for people."""

from calibration.gap.report.document import (
    SCHEMA,
    AmbiguousSet,
    FoundEffect,
    FoundParameter,
    Gap,
    GapReport,
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
    Lines,
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
    "FoundEffect",
    "FoundParameter",
    "Gap",
    "GapReport",
    "HeatMap",
    "HorizonCurves",
    "Levels",
    "Lines",
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
