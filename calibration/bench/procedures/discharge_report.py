"""The page of a discharge: did the thrust stay what was asked for."""

from html import escape
from pathlib import Path

from calibration.bench.thrust.compensation import Discharge, Verification
from calibration.bench.thrust.figures import discharge_figure
from calibration.report_style import page, report_style, section, svg, table


def write_discharge_report(path: Path, discharge: Discharge, verdict: Verification) -> Path:
    """Write the page: the figure, verdict and findings."""
    below = verdict.saturated_below
    rows = [
        ["readings judged", str(int(verdict.judged.sum()))],
        ["largest error", f"{verdict.worst_gf:.2f} gf, {100.0 * verdict.worst_relative:.1f} %"],
        ["saturated", "never" if below is None else f"at and below {below:.2f} V"],
        *(["!", escape(finding.text)] for finding in verdict.findings),
    ]
    limit = "At most 3 % or 0.15 gf, whichever is larger, until the motors saturate."
    with report_style():
        figure = svg(discharge_figure(discharge, verdict), "Thrust over the discharge")
    body = section("Thrust over the discharge", figure) + section("Verdict", table(["", ""], rows), limit)
    title = f"Battery compensation: {'passed' if verdict.passed else 'not passed'}"
    path.write_text(page(title, str(path.parent.name), body), encoding="utf-8")
    return path
