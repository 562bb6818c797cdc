"""The report of a calibration: one HTML page with results, budget, plots, findings and where it all is."""

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from calibration.bench.procedures.calibration import Calibration, Estimates, VehicleChange
from calibration.bench.procedures.compare import Comparison
from calibration.measurement import Contribution, Estimate, Finding, Severity
from calibration.report_style import MUTED, ORANGE, TRIGGER, grid, page, report_style, section, svg, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPORT_FILE = "report.html"

_COLOURS = {Severity.NOTE: MUTED, Severity.WARNING: ORANGE, Severity.REJECT: TRIGGER}


def write_report(
    folder: Path,
    calibration: Calibration,
    figures: Mapping[str, "Figure"],
    comparisons: Mapping[str, Sequence[Comparison]],
) -> Path:
    """Write ``report.html`` beside a result. It opens with the first figure.

    Args:
        folder: of the run.
        calibration: its result.
        figures: by title, the telling one first.
        comparisons: with earlier calibrations or a vehicle file, by their name.
    """
    with report_style():
        drawings = [section(title, svg(figure, title)) for title, figure in figures.items()]
    parts = [
        *drawings[:1],
        section("Result", _quantities(calibration.change), _how(calibration)),
        _findings(calibration.findings),
        *(
            section(f"Uncertainty of {key}", _budget(lines), "The largest comes first: measure it better.")
            for key, lines in calibration.budgets.items()
            if lines
        ),
        *(section(f"Compared with {name}", _compared(rows)) for name, rows in comparisons.items() if rows),
    ]
    parts.append(grid(drawings[1:]))
    parts.append(section("Measured by hand", _inputs(calibration.inputs)))
    parts.append(
        section("Recordings", _recordings(calibration.raw), "Beside this page; their SHA-256 is theirs here.")
    )
    title = f"{calibration.kind.capitalize()} calibration {calibration.id}"
    path = folder / REPORT_FILE
    path.write_text(page(title, _subtitle(calibration), "\n".join(parts)), encoding="utf-8")
    return path


def _subtitle(calibration: Calibration) -> str:
    origin = [
        f"{key} {value}" for key, value in calibration.provenance.items() if value and isinstance(value, str)
    ]
    return f"{calibration.made}; " + "; ".join(origin)


def _how(calibration: Calibration) -> str:
    parent = f" Follows {calibration.parent}." if calibration.parent else ""
    return f"± is the 95 % interval (GUM).{parent}"


def _quantities(change: VehicleChange) -> str:
    estimates = {key.removeprefix("effects."): one for key, one in change.estimates.items()}
    if change.thrust_map is not None:
        form, coefficients = change.thrust_map
        estimates |= {f"thrust map ({form}) {key}": one for key, one in coefficients.items()}
    rows = [[escape(key), escape(str(one)), _share(one)] for key, one in estimates.items()]
    return table(["quantity", "value", "relative"], rows)


def _share(estimate: Estimate) -> str:
    if estimate.value == 0.0 or not math.isfinite(estimate.u95):
        return ""
    return f"{100.0 * abs(estimate.u95 / estimate.value):.2g} %"


def _findings(findings: Sequence[Finding]) -> str:
    if not findings:
        return section("What was seen", "<p>Nothing that speaks against these recordings.</p>")
    rows = [
        [
            f'<span class="badge" style="background:{_COLOURS[one.severity]}">{one.severity.value}</span>',
            escape(one.text),
        ]
        for one in findings
    ]
    return section("What was seen", table(["", "finding"], rows))


def _budget(lines: Sequence[Contribution]) -> str:
    rows = [
        [escape(one.name), f"{100.0 * one.share:.3g} %", escape(one.advice)]
        for one in sorted(lines, key=lambda one: -one.share)
    ]
    return table(["from", "share (k = 1)", "what would help"], rows)


def _compared(rows: Sequence[Comparison]) -> str:
    cells = [
        [
            escape(row.key),
            escape(str(row.before)),
            escape(str(row.now)),
            "" if row.normalised is None else f"{row.normalised:.2f}",
            f"<b>{row.verdict}</b>" if row.contradicts else row.verdict,
        ]
        for row in rows
    ]
    return table(["quantity", "before", "now", "E_n", ""], cells)


def _inputs(inputs: Estimates) -> str:
    rows = [[escape(name), escape(str(one))] for name, one in inputs.items()]
    return table(["quantity", "value"], rows) if rows else "<p>Nothing.</p>"


def _recordings(raw: Sequence[Mapping[str, str]]) -> str:
    rows = [[escape(one["file"]), f"<code>{escape(one['sha256'])}</code>"] for one in raw]
    return table(["file", "SHA-256"], rows)
