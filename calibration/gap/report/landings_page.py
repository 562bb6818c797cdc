"""The page of ``perchhw gap landings``: predicted beside real outcomes, and each flight's motion."""

from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from calibration.gap.landings.outcomes.document import LandingReport, classified
from calibration.gap.landings.outcomes.labels import CLASS_NAMES, landing_class
from calibration.gap.landings.outcomes.prepare import RATE_ERROR
from calibration.gap.landings.outcomes.roll import REFUTED, REFUTED_LEVEL, RollEvidence
from calibration.gap.landings.outcomes.scores import Score
from calibration.gap.report.landing_pictures import LandingPicture, by_surprise
from calibration.gap.report.landing_scores import score_tables, search_table
from calibration.gap.report.landing_style import CLASS_COLOURS, CLASS_MARKERS, CLASS_WORDS, short_name
from calibration.report_style import (
    BLUE,
    MUTED,
    by_width,
    new_figure,
    page,
    pixels,
    report_style,
    section,
    svg,
    table,
    text_table,
)
from onboard.json_file import as_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WORDS, _COLOURS = tuple(CLASS_WORDS.values()), tuple(CLASS_COLOURS.values())
_MARKERS = tuple(CLASS_MARKERS.values())


def landings_page(report: LandingReport, pictures: Sequence[LandingPicture]) -> str:
    """The whole page; it loads nothing from elsewhere.

    Args:
        report: what to show. pictures: of its landings (:func:`.landing_pictures.landing_pictures`).
    """
    with report_style():
        body = "".join(_sections(report, pictures))
    title = f"Landings of {report.vehicle.name}: predicted and real"
    draws = f"{report.forecast.draws} simulated landings each"
    return page(title, f"{len(report.real)} flights, {draws}, seed {report.seed}", body)


def _sections(report: LandingReport, pictures: Sequence[LandingPicture]) -> Iterator[str]:
    yield section("What the simulation expects, and what happened", _outcomes(report), _NOTE)
    yield section("What the simulation lacks", _verdict(report))
    if report.prospects:
        yield section("What to expect of the next flights", "<br>".join(map(escape, report.prospects)))
    if report.score is not None:
        yield section("How good the probabilities are", score_tables(report.score, report.contact_score))
        drawn = svg(reliability_diagram(report.score), "Share of four legs against their probability")
        yield section("Does it happen as often as it is said to", drawn)
    yield section("Flights", _flights(report), _FLIGHTS_NOTE)
    yield from _landings(pictures)
    scatter = vars(report.prepared.dispersion)
    rows = [
        [_SCATTER[name], ", ".join(f"{v:.3f}" for v in np.ravel(found))] for name, found in scatter.items()
    ]
    scattered_by = table(["standard deviation, from these flights", ""], rows)
    yield section("How starts and flips scatter", scattered_by)
    if report.prepared.roll is not None:
        yield section("Why flips roll", _roll(report.prepared.roll), _ROLL_NOTE)
    if report.unused:
        unused = text_table(["flight", "why not"], ([one.name, one.reason] for one in report.unused))
        yield section("Not judged", unused)


_SCATTER = {
    "height": "distance to the ceiling, m",
    "velocity": "velocity, m/s (world)",
    "attitude": "attitude, rad (body)",
    "rate": "rate, rad/s (body)",
    "pitch": "pitch acceleration of the flip, share",
    "roll": "roll acceleration per pitch acceleration",
}
_NOTE = (
    "Each row is a flight, simulated from its recorded trigger with the measured scatter of the starts. The "
    "mark on the right is what really happened (dot: four legs, square: two, cross: none); the bars below "
    "are all flights together."
)
_FLIGHTS_NOTE = "Those first whose end was expected least; a name leads to its motion."
_LANDINGS_NOTE = (
    "Dots are the log's own samples, the grey band holds 80 % of all simulated draws about their "
    "median, and a coloured line is one draw of those that end on four legs, on two, or on none: the "
    "one nearest to their median pitch rate. Vertical lines: the trigger (red), the measured contact "
    "(black), when the feet are counted (dotted); 80 % of the draws touch within the blue bar. Flip "
    "angle: how far the body axis has turned, 0 level, 180 upside down; open dots add up the gyro from "
    "the trigger to the contact. On the right the vehicle at the trigger, half of the way, at the "
    "contact, and at the end. What counts as apart lies outside the band by more than the log can be "
    f"wrong: rates by {RATE_ERROR:g} rad/s in two samples, the contact by the time between two samples."
)


_RATE = ", rad/s"
_ROLL_MEASURED = {
    "roll_per_pitch": "roll per pitch in the flip",
    "yaw_rad_s": f"yaw rate gained in the flip{_RATE}",
    "approach_roll_per_pitch": "roll per pitch in the approach",
    "hover_roll": "left less right in hover",
    "hover_twist": "M2, M4 less M1, M3 in hover",
}
_ROLL_CAUSES = {
    "inertia_products": "products of inertia",
    "com_offset": "centre of mass to one side",
    "motor_imbalance": "motors unequal",
}
"""Those with a name of their own in vehicle files."""
_ROLL_NOTE = (
    "What each cause of the measured roll would do, beside what was measured (and its standard error); "
    f"more than {REFUTED:g} standard errors apart refutes it, of fewer than 15 flips as many as Student's t "
    f"has at {REFUTED_LEVEL:.0%}."
)


def _verdict(report: LandingReport) -> str:
    said = "<br>".join(escape(sentence) for sentence in report.words)
    return said if report.search is None else said + search_table(report.search, report.nested)


def _outcomes(report: LandingReport) -> str:
    real = [None if one is None else landing_class(one) for one in report.real]
    counts = ", ".join(f"{word} {real.count(number)}" for number, word in enumerate(_WORDS))
    alt = f"Probabilities of {len(real)} flights beside what happened: {counts}"
    return by_width(lambda broad: outcome_bars(report, broad), alt)


def outcome_bars(report: LandingReport, broad: bool) -> "Figure":
    """Stacked probabilities of each flight with the real outcome, and all flights together."""
    shares, (rows, known) = report.forecast.probability, classified(report.real)
    ends = {"simulated": (shares[rows] if rows.size else shares).mean(axis=0)}
    if rows.size:
        ends = {"real": np.bincount(known, minlength=3) / rows.size, **ends}
    order = np.argsort(shares[:, 0], kind="stable")
    bars = np.vstack([*ends.values(), shares[order]])
    at = np.concatenate([1.2 * np.arange(len(ends)), np.arange(len(order)) + 3.5])
    figure = new_figure(8.6 if broad else 4.4, 1.6 + 0.21 * len(order))
    axes = figure.add_subplot()
    heights, lefts = np.where(at < 3.0, 1.0, 0.8), np.cumsum(bars, axis=1) - bars
    for share, left, colour in zip(bars.T, lefts.T, _COLOURS, strict=True):
        axes.barh(at, share, left=left, height=heights, color=colour)
    classes = dict(zip(rows.tolist(), known.tolist(), strict=True))
    for position, k in zip(at[len(ends) :], order.tolist(), strict=True):
        if k in classes:
            marker, colour = _MARKERS[classes[k]], _COLOURS[classes[k]]
            axes.plot(1.03, position, marker, ms=7, color=colour, clip_on=False)
    names = [short_name(report.forecast.flights[k].name, 34 if broad else 16) for k in order]
    axes.set_yticks(at, [*ends, *names], fontsize=8)
    axes.set(xlim=(0.0, 1.0), xlabel="probability")
    axes.grid(axis="y", visible=False)
    styles = zip(_MARKERS, _COLOURS, strict=True)
    handles = [axes.plot([], [], marker, ms=7, color=colour)[0] for marker, colour in styles]
    axes.legend(handles, _WORDS, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
    return figure


def reliability_diagram(found: Score) -> "Figure":
    """Share of real four-leg landings against their probability, with intervals."""
    figure = new_figure(4.2, 3.6)
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], "--", color=MUTED, lw=1)
    for one in found.reliability:
        axes.plot([one.p_four] * 2, one.ci95, color=BLUE, lw=1.2)
        axes.plot(one.p_four, one.real, "o", color=BLUE, ms=3 + one.flights**0.5)
    axes.set(
        xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), xlabel="probability of four legs", ylabel="share that did"
    )
    return figure


def _landings(pictures: Sequence[LandingPicture]) -> Iterator[str]:
    """A section for each, under a heading that explains them."""
    yield section("Flight by flight", escape(_LANDINGS_NOTE))
    for one in pictures:
        content = f'<p class="said">{escape(one.words)}</p>{pixels(one.drawn, one.alt)}'
        yield section(one.name, content, one.left_out, anchor=_anchor(one.index))


def _anchor(index: int) -> str:
    return f"flight-{index + 1}"


def _flights(report: LandingReport) -> str:
    rows = []
    flights = as_json(report)["flights"]
    for index in by_surprise(report):
        flight, real = flights[index], report.real[index]
        name = f'<a href="#{_anchor(index)}">{escape(flight["name"])}</a>'
        shares = [f"{flight[f'p_{name}']:.2f}" for name in (*CLASS_NAMES, "body_contact")]
        times = [_time(flight["contact_s"]), _time(flight["contact_measured_s"])]
        rows.append([name, "" if real is None else real.value, *shares, *times])
    header = ["flight", "real", "four", "two", "none", "body contact", "contact, s", "measured, s"]
    return table(header, rows)


def _time(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def _roll(found: RollEvidence) -> str:
    rows = [["measured", "", *(f"{v:+.3f} &plusmn; {s:.3f}" for v, s in found.measured.values()), ""]]
    for cause in found.causes:
        would = [
            f"{cause.predicted[name]:+.3f}" if name in cause.predicted else "" for name in found.measured
        ]
        against = ", ".join(_ROLL_MEASURED[name].removesuffix(_RATE) for name in cause.refuted_by)
        size = f"{cause.value:.3g}{'' if cause.unit == '1' else f' {cause.unit}'}".replace("m2", "m²")
        rows.append(
            [
                escape(_ROLL_CAUSES.get(cause.name, cause.name)),
                escape(size),
                *would,
                escape(f"refuted by {against}" if against else "not refuted"),
            ]
        )
    columns = (_ROLL_MEASURED[name] for name in found.measured)
    return table(["cause", "size that it needs", *columns, ""], rows)
