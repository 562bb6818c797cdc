"""``report.html``: the verdict, the effects, the gap before and after, where it lives, what is not known."""

from collections.abc import Iterator, Mapping
from html import escape
from operator import attrgetter
from typing import Any

from calibration.gap.data.found_effect import FoundEffect, Verdict
from calibration.gap.landings import LandingFindings
from calibration.gap.landings.flip import FlipResidual
from calibration.gap.replay.closed_loop import ClosedLoopFlight
from calibration.gap.report import drawings, words
from calibration.gap.report.document import Gap, GapReport, Levels, leaves
from calibration.gap.report.figures_data import ReportFigures
from calibration.gap.report.words import interval, number, plain, unit
from calibration.report_style import by_width, grid, page, report_style, section, svg, table, text_table
from onboard.vehicle import EFFECTS

_COLOURS = {
    Verdict.EFFECTS_FOUND: "#2067b0",
    Verdict.NO_GAP: "#1a7f4b",
    Verdict.UNEXPLAINED_GAP: "#b5531c",
}
_UNNAMED = (
    "What is a function of place, speed or turn, and holds on flights that no fit saw, is in the vehicle "
    "file as [[unnamed]]: the simulation flies it; nobody knows what it is."
)


def report_page(report: GapReport, figures: ReportFigures) -> str:
    """The whole page; it loads nothing from elsewhere."""
    with report_style():
        body = "".join(_sections(report, figures))
    title = f"Gap between model and flights: {report.vehicle}"
    counts = f"{len(report.train)} flights fitted, {len(report.held_out)} held out"
    return page(title, f"{counts}, {len(report.unusable)} not used", body)


def _sections(report: GapReport, figures: ReportFigures) -> Iterator[str]:
    yield _verdict(report)
    if figures.effects:
        drawn = svg(
            drawings.effect_panels(figures.effects), "Each effect: what the flights show, what it says"
        )
        yield section(
            "What the flights show of it",
            drawn,
            "Measured, beyond the model without the effect and with the others: medians of parts of equal "
            "count, and the middle two thirds of each. The line is what the effect says.",
        )
    yield from _gap(report, figures)
    if report.effects:
        yield section(
            "What was missing",
            _effects(report),
            "In the order found. Errors are on flights that no fit saw, without and with the effect, those "
            "before it in the model.",
        )
    if report.ambiguous:
        alike = text_table(
            ["effects", "what would tell them"],
            ([" or ".join(map(plain, item.names)), item.separated_by] for item in report.ambiguous),
        )
        yield section("What these flights cannot tell apart", alike)
    yield from _where(report, figures)
    if figures.closed_loop:
        yield _closed_loop(figures.closed_loop)
    if report.unexplained.share > 0.0 or report.verdict is Verdict.UNEXPLAINED_GAP:
        yield section("What is left", _rest(report))
    if report.nameless.written or report.nameless.refused:
        yield section("What was found without a name", _unnamed(report), _UNNAMED)
    if report.rejected:
        rejected = text_table(["effect", "why not"], ([plain(it.name), it.reason] for it in report.rejected))
        yield section("What looked missing and was not accepted", rejected)
    yield section("Flights", _flights(report))
    if report.landings is not None:
        yield section("Landings", _landings(report.landings))
    if report.limitations:
        items = "".join(f"<li>{escape(text)}</li>" for text in report.limitations)
        yield section("What cannot be concluded", f"<ul>{items}</ul>")
    yield grid([section(title, content) for title, content in _settings(report)])


def _verdict(report: GapReport) -> str:
    unseen = bool(report.held_out)
    sentences = [words.gap_in_words(report.gap.metric, report.gap.overall, unseen)]
    if report.verdict is Verdict.UNEXPLAINED_GAP:
        sentences.append(words.unexplained_in_words(report))
    if report.nameless.closes is not None:
        sentences.append(words.unnamed_in_words(report.nameless.closes))
    sentences += [words.ambiguity_in_words(effect) for effect in report.effects if effect.ambiguous_with]
    bounds = [
        f"{plain(effect.name)}: {plain(name)} ended at the limit of what is physical, which is a warning and "
        "not a measurement."
        for effect in report.effects
        for name, found in effect.parameters.items()
        if found.at_bound
    ]
    text = "".join(f"<p>{escape(sentence)}</p>" for sentence in [*sentences, *bounds])
    colour = _COLOURS[report.verdict]
    badge = f'<span class="badge" style="background:{colour}">{escape(plain(str(report.verdict)))}</span>'
    return (
        f'<section style="border-left:6px solid {colour}"><p>{badge}</p>'
        f'<p style="font-size:20px;margin:6px 0 10px">{escape(words.headline(report))}</p>{text}</section>\n'
    )


def _effects(report: GapReport) -> str:
    rows = []
    for index, effect in enumerate(report.effects, start=1):
        known = EFFECTS.get(effect.name)
        meaning = "" if known is None else f"<br><small>{escape(known.equation)}</small>"
        values = "<br>".join(escape(words.parameter(n, p)) for n, p in effect.parameters.items())
        others = ", ".join(plain(name) for name in effect.ambiguous_with) or "nothing"
        told = f"<br><small>to tell: {escape(effect.separated_by)}</small>" if effect.separated_by else ""
        error = f"{number(effect.error_before)} to {number(effect.error_after)}"
        if effect.metric:
            error += f"<br><small>{escape(effect.metric)}</small>"
        else:
            error += unit(report.gap.overall.unit)
        rows.append(
            [
                str(index),
                f"<b>{escape(plain(effect.name))}</b>{meaning}",
                values,
                error,
                interval(effect.improvement_ci95),
                _probability(effect),
                escape(others) + told,
            ]
        )
    header = ["", "effect", "parameters", "error", "improvement, 95 %", "probability", "could also be"]
    return table(header, rows)


def _probability(effect: FoundEffect) -> str:
    if effect.probability is None:
        return ""
    either = "<br><small>it, or what it could also be</small>" if effect.ambiguous_with else ""
    return number(effect.probability) + either


def _gap(report: GapReport, figures: ReportFigures) -> Iterator[str]:
    gap, stages = report.gap, figures.stages
    drawing = _horizons(stages) if stages else ""
    if drawing or gap.predictions:
        metric = {f"{horizon:g} s ahead": level for horizon, level in gap.by_horizon.items()}
        others = _folded("other predictions", _levels(gap.by_quantity, "prediction"))
        yield section(
            "The gap by horizon",
            drawing + _levels(metric, gap.metric.split(" after ")[0]) + others,
            "Mean errors on flights that no fit saw. The floor is what gyro and accelerometer give in place "
            "of the model.",
        )
    parts = []
    for title, of, along, relative in (
        ("The gap by channel", attrgetter("by_channel"), "share of before", True),
        ("The gap by phase of flight", attrgetter("by_phase"), f"{gap.metric}, {gap.overall.unit}", False),
    ):
        drawn, levels = {name: of(one) for name, one in stages.items()}, of(gap)
        bars = drawings.stage_bars(drawn, along, relative) if any(drawn.values()) else None
        if levels:
            image = "" if bars is None else svg(bars, f"{title}, before and after")
            parts.append(section(title, image + _levels(levels, "")))
    if parts:
        yield grid(parts)


def _horizons(stages: Mapping[str, Gap]) -> str:
    alt = f"Errors of prediction against how far ahead, before and after: {', '.join(drawings.CURVES)}"
    return by_width(lambda broad: drawings.horizon_panels(stages, broad), alt)


def _levels(levels: Mapping[str, Levels], heading: str) -> str:
    if not levels:
        return ""
    rows = []
    floors = any(level.noise_floor is not None for level in levels.values())
    for name, level in levels.items():
        share = level.closed_share
        row = [escape(plain(name)), *(f"{number(v)}{unit(level.unit)}" for v in (level.before, level.after))]
        if floors:
            row.append("" if level.noise_floor is None else f"{number(level.noise_floor)}{unit(level.unit)}")
            row.append("" if share is None else words.closed(share))
        rows.append(row)
    return table([heading, "before", "after", *(["floor", "closed"] if floors else [])], rows)


def _folded(title: str, content: str) -> str:
    """Content that a click opens; nothing where there is none."""
    if not content:
        return ""
    return f'<details><summary class="note">{escape(title)}</summary>{content}</details>'


def _where(report: GapReport, figures: ReportFigures) -> Iterator[str]:
    if report.where or figures.heat_map is not None:
        rows = [[plain(one.channel), one.condition, number(one.share)] for one in report.where]
        content = text_table(["channel", "condition", "share of the gap before"], rows) if rows else ""
        note = ""
        if figures.heat_map is not None:
            content += svg(
                drawings.heat_maps(figures.heat_map),
                "Share of each channel's residual that goes with each regressor, before and after",
            )
            note = (
                "Cells, in percent: share of the residual's variance that goes with the regressor. Faint "
                "cells are no larger than what the colour of the noise alone makes in 1 of 20."
            )
        yield section("Where it lives", content, note)
    if figures.clouds:
        yield section(
            "Residuals against what they may depend on",
            svg(
                drawings.cloud_panels(figures.clouds),
                "Residuals against what they may depend on, with medians",
            ),
            "Measured minus modelled; medians of parts of equal count, and the middle two thirds of each. A "
            "model that lacks nothing is flat at zero.",
        )


def _closed_loop(stages: Mapping[str, ClosedLoopFlight]) -> str:
    name = next(iter(stages.values())).name
    drawn = svg(
        drawings.closed_loop_trace(stages), f"Closed loop of {name}: what the models and the vehicle needed"
    )
    return section(
        "Flown again in closed loop",
        f"<h3>{escape(name)}</h3>{drawn}",
        "The project's own controller flies the model along the measured path. What the model needs should "
        "be what the vehicle needed.",
    )


def _rest(report: GapReport) -> str:
    rest = report.unexplained
    rows = [
        ["share of the gap", number(rest.share)],
        ["channels", escape(", ".join(map(plain, rest.channels)) or "none stands out")],
        ["goes with", escape(", ".join(rest.suspects) or "nothing that was measured")],
        ["closest formula", f"<code>{escape(rest.formula)}</code>" if rest.formula else "none"],
    ]
    return table(["", ""], rows)


def _unnamed(report: GapReport) -> str:
    told = report.nameless
    rows = [[f"<code>{escape(text)}</code>", "yes"] for text in told.written]
    rows += [[f"<code>{escape(one.name)}</code>", f"no: {escape(one.reason)}"] for one in told.refused]
    content = table(["what", "in the vehicle file"], rows)
    if told.closes is not None:
        content += _levels({report.gap.metric: told.closes}, "with names alone, and with these")
    return content


def _flights(report: GapReport) -> str:
    kinds = (("fitted", report.train), ("held out", report.held_out))
    content = text_table(
        ["", ""], ([f"{title} ({len(names)})", ", ".join(names) or "none"] for title, names in kinds)
    )
    if report.unusable:
        unusable = ([item.name, item.reason] for item in report.unusable)
        content += "<h3>Not used</h3>" + text_table(["file", "reason"], unusable)
    return content


def _landings(landings: LandingFindings) -> str:
    rows = [[f"usable ({len(landings.usable)})", ", ".join(landings.usable) or "none"]]
    if landings.misfit is not None:
        meaning = "about 0.1 to 1 where the equations hold"
        rows.append(["cost per residual before, median", f"{number(landings.misfit)} ({meaning})"])
    content = text_table(["", ""], rows)
    if landings.unused:
        refused = ([item.name, item.reason] for item in landings.unused)
        content += "<h3>Refused</h3>" + text_table(["flight", "reason"], refused)
    return content if landings.flip is None else content + _flips(landings.flip)


def _flips(flips: FlipResidual) -> str:
    words = "".join(f"<li>{escape(text)}</li>" for text in flips.judgement)
    rows = ([name, number(flips.mean[name]), number(flips.rms[name])] for name in flips.mean)
    compared = text_table(["model minus gyro", "mean, rad/s", "RMS, rad/s"], rows)
    names = f"{flips.samples} samples of {', '.join(flips.flights)}"
    return f"<h3>Flips before the contact</h3><ul>{words}</ul>" + _folded(names, compared)


def _settings(report: GapReport) -> Iterator[tuple[str, str]]:
    yield "Settings", _facts({"seed": report.seed, **report.settings})
    if report.noise:
        yield "Noise as measured", _facts(report.noise)


def _facts(facts: Mapping[str, Any]) -> str:
    rows = []
    for place, value in leaves(facts):
        shown = number(value) if isinstance(value, float) else "not given" if value is None else str(value)
        rows.append([plain(place).replace(".", ", "), shown])
    return text_table(["", ""], rows)
