"""``report.html`` of a leg study: landing rates of the designs, what decides them, the paper's trends."""

from html import escape
from pathlib import Path

from calibration.report_style import page, report_style, section, svg, table
from perchhw.learning.leg_results import LegResults
from perchhw.report import leg_figures
from perchhw.report.picture import Picture, save_pictures
from perchhw.report.rate_maps import GOOD_RATE, rate_maps
from perchhw.report.run_report import REPORT_FILE


def write_leg_report(results: LegResults, pictures: Path | None = None) -> Path:
    """Write ``report.html`` into the folder of the study; one file that loads nothing from elsewhere.

    Args:
        results: the study.
        pictures: folder for the figures as PNG files; None for none.
    """
    path = results.folder / REPORT_FILE
    with report_style():
        drawn = _pictures(results)
        save_pictures(drawn, pictures)
        path.write_text(_page(results, drawn), encoding="utf-8")
    return path


def _pictures(results: LegResults) -> list[Picture]:
    # Short legs above long ones, as in the paper's figure.
    maps = sorted(results.maps.values(), key=lambda rates: not rates.name.endswith("short"))
    return [
        Picture(
            "leg_designs",
            "Landing rate of the designs over speed and approach angle",
            "Across is the horizontal speed, up is the climb. Dots have the best rate of the trials at their "
            f"condition, the surface is smoothed, and the black line is a rate of {GOOD_RATE:g}.",
            rate_maps(maps, columns=3 if len(maps) > 3 else None),
        ),
        Picture(
            "leg_factors",
            "Why: the four factors by approach angle",
            "Medians over fresh landings of the learned pairs, at the first contact. A short swing, gravity "
            "and swing rate above zero, and an impact well inside the window make a landing easy.",
            leg_figures.factors_by_angle(results),
        ),
        Picture(
            "leg_success",
            "What successes have and failures lack",
            "Marker: median; line: middle half of the landings. Where the two lie apart, the factor tells "
            "landings that succeed from those that fail.",
            leg_figures.success_and_failure(results),
        ),
    ]


def _page(results: LegResults, drawn: list[Picture]) -> str:
    settings = results.study.get("settings", {})
    first, *others = drawn
    body = section(first.title, svg(first.figure, first.title), first.meaning)
    body += section(
        "Landing rate by band",
        _rates(results),
        "Mean over the trials of a band of the rate of four-leg landings without body contact.",
    )
    for picture in others:
        body += section(picture.title, svg(picture.figure, picture.title), picture.meaning)
    body += section(
        "What the paper says", _trends(results), "Numbers are positive where the paper's sentence holds."
    )
    names = ("vehicle", "reward", "domain", "sensing", "gains", "ceiling_z", "seed", "rollouts")
    rows = [[name.replace("_", " "), escape(str(settings[name]))] for name in names if name in settings]
    rows.append(["fresh landings", f"{len(results.landings.design):,}"])
    body += section("Settings", table(["", ""], rows))
    return page(f"Leg designs on {settings.get('vehicle')}", results.folder.resolve().name, body)


def _rates(results: LegResults) -> str:
    """Landing rates by band and design, and the impact windows."""
    designs = results.study["designs"]
    rows: dict[tuple[str, str], list[str]] = {}
    for number, design in enumerate(designs.values()):
        for band in design["bands"]:
            row = rows.setdefault(_band_name(band), [""] * len(designs))
            row[number] = f"{band['landing_rate']:.2f}"
    body = [[escape(angles), escape(speeds), *cells] for (angles, speeds), cells in rows.items()]
    body.append(["all", "all", *(f"{design['landing_rate']:.2f}" for design in designs.values())])
    body.append(
        ["impact window from", "", *(f"{d['impact_window_deg'][0]:.0f} deg" for d in designs.values())]
    )
    return table(["approach angle", "speed", *designs], body)


def _band_name(band: dict[str, list[float]]) -> tuple[str, str]:
    (low, high), (slowest, limit) = band["angles_deg"], band["speeds_m_s"]
    return f"{low:g}-{high:g} deg", f">= {slowest:g} m/s" if limit is None else f"< {limit:g} m/s"


def _trends(results: LegResults) -> str:
    rows = []
    for trend in results.study.get("trends", {}).values():
        numbers = "<br>".join(f"{value:+.2f} {escape(name)}" for name, value in trend["numbers"].items())
        rows.append([escape(trend["says"]), "yes" if trend["holds"] else "not all", numbers])
    return table(["trend", "holds", "numbers"], rows)
