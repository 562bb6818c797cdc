"""The gap finder's report: the document for programs (``report.json``) and the page for people."""

from calibration.gap.report.document import GapReport
from calibration.gap.report.writing import write_report

__all__ = ["GapReport", "write_report"]
