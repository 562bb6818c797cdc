"""The report of a calibration: one HTML page with results, budget, plots, findings and where it all is."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calibration.bench.procedures.compare import Comparison
from calibration.report_style import grid, page, report_style, section, svg, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPORT_FILE = "report.html"

_COLOURS = {"note": "#6b7480", "warning": "#d2691e", "reject": "#c0392b"}


def write_report(
    folder: Path,
    result: Mapping[str, Any],
    figures: Mapping[str, "Figure"],
    comparisons: Mapping[str, Sequence[Comparison]],
) -> Path:
    """Write ``report.html`` beside a result.

    Args:
        folder: of the run.
        result: as :func:`~calibration.bench.procedures.result.load_result` gives it.
        figures: by title.
        comparisons: with earlier calibrations or a vehicle file, by their name.
    """
    parts = [
        section("Result", _quantities(result), _how(result)),
        _findings(result),
        *(
            section(f"Uncertainty of {key}", _budget(lines), "The largest comes first: measure it better.")
            for key, lines in result["budgets"].items()
            if lines
        ),
        *(section(f"Compared with {name}", _compared(rows)) for name, rows in comparisons.items() if rows),
    ]
    with report_style():
        drawings = [section(title, svg(figure)) for title, figure in figures.items()]
    parts.append(grid(drawings))
    parts.append(section("Measured by hand", _inputs(result)))
    parts.append(
        section("Recordings", _recordings(result), "Beside this page; their SHA-256 is theirs here.")
    )
    title = f"{result['kind'].capitalize()} calibration {result['id']}"
    path = folder / REPORT_FILE
    path.write_text(page(title, _subtitle(result), "\n".join(parts)), encoding="utf-8")
    return path


def said(raw: Mapping[str, Any]) -> str:
    """An estimate in words: ``1.70e-05 ± 1.1e-07 kg m2``."""
    uncertainty = "not known" if raw["u95"] is None else f"{raw['u95']:.2g}"
    return f"{raw['value']:.5g} ± {uncertainty} {raw['unit']}"


def _subtitle(result: Mapping[str, Any]) -> str:
    provenance = result["provenance"]
    told = [f"{key} {value}" for key, value in provenance.items() if isinstance(value, str) and value]
    return f"{result['made']}; " + "; ".join(told)


def _how(result: Mapping[str, Any]) -> str:
    parent = f" Follows {result['parent']}." if result["parent"] else ""
    return f"± is the 95 % interval (GUM).{parent}"


def _quantities(result: Mapping[str, Any]) -> str:
    change = result["vehicle"]
    rows = [[escape(key), escape(said(raw)), _share(raw)] for key, raw in change["quantities"].items()]
    for name, parameters in change["effects"].items():
        rows += [[escape(f"{name}.{key}"), escape(said(raw)), _share(raw)] for key, raw in parameters.items()]
    if change["thrust_map"] is not None:
        form = change["thrust_map"]["form"]
        rows += [
            [escape(f"thrust map ({form}) {key}"), escape(said(raw)), _share(raw)]
            for key, raw in change["thrust_map"]["coefficients"].items()
        ]
    return table(["quantity", "value", "relative"], rows)


def _share(raw: Mapping[str, Any]) -> str:
    if raw["u95"] is None or raw["value"] == 0.0:
        return ""
    return f"{100.0 * abs(raw['u95'] / raw['value']):.2g} %"


def _findings(result: Mapping[str, Any]) -> str:
    if not result["findings"]:
        return section("What was seen", "<p>Nothing that speaks against these recordings.</p>")
    rows = [
        [
            f'<span class="badge" style="background:{_COLOURS[one["severity"]]}">{one["severity"]}</span>',
            escape(one["text"]),
        ]
        for one in result["findings"]
    ]
    return section("What was seen", table(["", "finding"], rows))


def _budget(lines: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        [escape(one["name"]), f"{100.0 * one['share']:.3g} %", escape(one["advice"])]
        for one in sorted(lines, key=lambda one: -one["share"])
    ]
    return table(["from", "share (k = 1)", "what would help"], rows)


def _compared(rows: Sequence[Comparison]) -> str:
    cells = [
        [
            escape(row.key),
            escape(said(row.before.to_json())),
            escape(said(row.now.to_json())),
            f"{row.normalised:.2f}",
            "<b>they contradict each other</b>" if row.contradicts else "they agree",
        ]
        for row in rows
    ]
    return table(["quantity", "before", "now", "E_n", ""], cells)


def _inputs(result: Mapping[str, Any]) -> str:
    rows = [[escape(name), escape(said(raw))] for name, raw in result["inputs"].items()]
    return table(["quantity", "value"], rows) if rows else "<p>Nothing.</p>"


def _recordings(result: Mapping[str, Any]) -> str:
    rows = [[escape(one["file"]), f"<code>{escape(one['sha256'])}</code>"] for one in result["raw"]]
    return table(["file", "SHA-256"], rows)
