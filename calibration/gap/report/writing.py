"""Write a report into a folder."""

from pathlib import Path

from calibration.errors import CalibrationError
from calibration.gap.report.document import GapReport
from calibration.gap.report.figures_data import ReportFigures
from calibration.gap.report.page import report_page
from onboard.errors import InputError

JSON_FILE = "report.json"
HTML_FILE = "report.html"


class ReportFolderError(CalibrationError, InputError):
    """The folder cannot be written."""


def write_report(report: GapReport, folder: Path, figures: ReportFigures | None = None) -> Path:
    """Write ``report.json`` and ``report.html`` into a folder, which is made where it is missing.

    Returns:
        The page.

    Raises:
        CalibrationError: a number of the report is not finite.
        ReportFolderError: the folder cannot be written.
    """
    document, drawn = report.text(), report_page(report, figures or ReportFigures())
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / JSON_FILE).write_text(document, encoding="utf-8")
        (folder / HTML_FILE).write_text(drawn, encoding="utf-8")
    except OSError as error:
        raise ReportFolderError(f"{folder}: cannot be written ({error.strerror})") from error
    return folder / HTML_FILE
