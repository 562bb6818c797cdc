"""The page of a flight that has just ended: drawn after its result was told, and named once it is there."""

import sys
from pathlib import Path

from perchhw.cli.output import written
from perchhw.consoles import progress_console


def draw_page(record: Path) -> None:
    """Draw the report of `record`, the last thing of a command, and say on stderr where it is.

    Drawing may be interrupted, which costs the page and no result; no record, or a full disk: no page.
    """
    from perchhw.report.run_report import report_flight

    page = report_flight(record)
    if page is not None:
        line = f"report: {page}"
        written(sys.stderr, lambda: progress_console().print(line, markup=False, soft_wrap=True))
