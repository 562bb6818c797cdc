"""The page of ``perchhw gap landings``: predicted beside real outcomes, and each flight's motion."""

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.gap.landings.kernels import COLUMNS, OMEGA
from calibration.gap.landings.outcomes.document import LandingReport
from calibration.gap.landings.outcomes.kernels import trace_flips
from calibration.gap.landings.outcomes.labels import CLASS_NAMES, landing_class
from calibration.gap.landings.outcomes.predict import scattered
from calibration.gap.landings.outcomes.prepare import SETTINGS
from calibration.gap.landings.outcomes.roll import REFUTED, RollEvidence
from calibration.gap.landings.outcomes.scores import Score
from calibration.gap.landings.outcomes.search import OutcomeSearch
from calibration.report_style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    TRIGGER,
    by_width,
    new_figure,
    page,
    report_style,
    section,
    svg,
    table,
    text_table,
)
from onboard.arrays import FloatArray
from onboard.json_file import as_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = (GREEN, ORANGE, TRIGGER)
_MARKERS = ("o", "s", "X")
_WORDS = ("four legs", "two legs", "none")
_MOTION = 0.6
"""s after the trigger that the motion is drawn for."""
_MOTIONS = 30
"""Simulated landings whose motion is drawn."""


def landings_page(report: LandingReport, parameters: Any) -> str:
    """The whole page; it loads nothing from elsewhere.

    Args:
        report: what to show. parameters: physics of its vehicle, for the motions.
    """
    with report_style():
        parts = [section("What the simulation expects, and what happened", _outcomes(report), _NOTE)]
        parts.append(section("What the simulation lacks", _verdict(report)))
        if report.expectation is not None:
            parts.append(section("What to expect of the next flights", escape(report.expectation.words)))
        if report.score is not None:
            parts.append(section("How good the probabilities are", _scores(report.score)))
            drawn = svg(reliability_diagram(report.score), "Share of four legs against their probability")
            parts.append(section("Does it happen as often as it is said to", drawn))
        parts.append(section("Flights", _flights(report)))
        parts.append(section("Pitch rate, real and simulated", _motions(report, parameters), _MOTION_NOTE))
        parts.append(section("How starts and flips scatter", _dispersion(report)))
        if report.prepared.roll is not None:
            parts.append(section("Why flips roll", _roll(report.prepared.roll), _ROLL_NOTE))
    if report.unused:
        unused = text_table(["flight", "why not"], ([one.name, one.reason] for one in report.unused))
        parts.append(section("Not judged", unused))
    count = len(report.real)
    title = f"Landings of {report.vehicle}: predicted and real"
    return page(
        title,
        f"{count} flights, {report.forecast.draws} simulated landings each, seed {report.seed}",
        "".join(parts),
    )


_NOTE = (
    "Each row is a flight, simulated from its recorded trigger with the measured scatter of the starts. The "
    "mark on the right is what really happened (dot: four legs, square: two, cross: none); the bars below "
    "are all flights together."
)
_MOTION_NOTE = (
    "Black: the gyro. Grey: simulated landings. Vertical line: the measured contact. Time from the trigger."
)


_ROLL_NOTE = (
    "What each cause of the measured roll would do, beside what was measured (and its standard error); "
    f"more than {REFUTED:g} standard errors apart refutes it."
)


def _verdict(report: LandingReport) -> str:
    said = "<br>".join(escape(sentence) for sentence in report.words)
    return said if report.search is None else said + _search(report.search)


def _search(found: OutcomeSearch) -> str:
    rows = []
    for fit in found.fits:
        one, half = fit.left_one_out, fit.halves
        values = ", ".join(
            f"{name} {mean:.3g} &plusmn; {sigma:.2g}" for name, (mean, sigma, _) in fit.values.items()
        )
        scores = [f"{value:.2f}" for value in (one.brier, one.brier_base, half.brier, half.brier_base_rate)]
        auc = "" if one.auc_four is None else f"{one.auc_four:.2f}"
        rows.append([fit.name, *scores, auc, values])
    header = ["open", "Brier, left one out", "base rate", "from halves", "base rate", "AUC of four", "values"]
    return table(header, rows)


def _outcomes(report: LandingReport) -> str:
    real = [None if one is None else landing_class(one) for one in report.real]
    counts = ", ".join(f"{word} {real.count(number)}" for number, word in enumerate(_WORDS))
    alt = f"Probabilities of {len(real)} flights beside what happened: {counts}"
    return by_width(lambda broad: outcome_bars(report, broad), alt)


def outcome_bars(report: LandingReport, broad: bool) -> "Figure":
    """Stacked probabilities of each flight with the real outcome, and all flights together."""
    shares = report.forecast.probability
    classes = [None if real is None else landing_class(real) for real in report.real]
    order = np.argsort(shares[:, 0], kind="stable")
    figure = new_figure(8.6 if broad else 4.4, 1.6 + 0.21 * len(order))
    axes = figure.add_subplot()
    names = [_short(report.forecast.flights[k].name, 34 if broad else 16) for k in order]
    at = np.arange(len(order)) + 3.5
    for position, k in zip(at, order, strict=True):
        _stack(axes, float(position), shares[k], 0.8)
        real = classes[k]
        if real is not None:
            axes.plot(1.03, position, _MARKERS[real], ms=7, color=_COLOURS[real], clip_on=False)
    known = [one for one in classes if one is not None]
    rows = [k for k, one in enumerate(classes) if one is not None]
    ends = [("real", np.bincount(known, minlength=3) / len(known))] if known else []
    ends.append(("simulated", shares[rows].mean(axis=0) if known else shares.mean(axis=0)))
    for position, (_, share) in zip((0.0, 1.2), ends, strict=False):
        _stack(axes, position, share, 1.0)
    ticks = [*[p for p, _ in zip((0.0, 1.2), ends, strict=False)], *at]
    axes.set_yticks(ticks, [*[name for name, _ in ends], *names], fontsize=8)
    axes.set(xlim=(0.0, 1.0), xlabel="probability")
    axes.grid(axis="y", visible=False)
    handles = [
        axes.plot([], [], marker, ms=7, color=colour)[0]
        for marker, colour in zip(_MARKERS, _COLOURS, strict=True)
    ]
    axes.legend(handles, _WORDS, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
    return figure


def _stack(axes: Any, y: float, shares: FloatArray, height: float) -> None:
    left = 0.0
    for share, colour in zip(shares, _COLOURS, strict=True):
        axes.barh(y, share, left=left, height=height, color=colour)
        left += float(share)


def _short(name: str, most: int = 34) -> str:
    return name if len(name) <= most else f"{name[: most - 1]}…"


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


def _motions(report: LandingReport, parameters: Any) -> str:
    alt = f"Pitch rates of {len(report.real)} flights by the gyro, over those of simulated landings"
    return by_width(lambda broad: motions(report, parameters, 4 if broad else 2), alt)


def motions(report: LandingReport, parameters: Any, side_by_side: int) -> "Figure":
    """Pitch rate of each flight: the gyro over simulated landings."""
    starts = report.prepared.starts
    rows = -(-len(starts) // side_by_side)
    figure = new_figure(2.6 * side_by_side, 1.7 * rows)
    panels = figure.subplots(rows, side_by_side, sharex=True, sharey=True, squeeze=False)
    axes = np.atleast_1d(panels).ravel()
    at = SETTINGS.dt * np.arange(round(_MOTION / SETTINGS.dt) + 1)
    p = parameters.copy()
    for index, start in enumerate(starts):
        panel = axes[index]
        p["ceiling_z"] = report.prepared.ceilings[index]
        numbers = report.prepared.draws[index][:_MOTIONS]
        states, flips = scattered(start, report.prepared.dispersion, numbers, p)
        traces = np.empty((len(states), at.size, COLUMNS))
        trace_flips(states, p, flips, SETTINGS, traces)
        panel.plot(at, traces[:, :, OMEGA + 1].T, color=MUTED, lw=0.4, alpha=0.35, rasterized=True)
        t = start.gyro_t + report.prepared.clocks[index]
        panel.plot(t[t < _MOTION], start.gyro[t < _MOTION, 1], color=INK, lw=1.1)
        contact = report.prepared.contact(index)
        if contact is not None:
            panel.axvline(contact, color=BLUE, lw=0.8)
        real = report.real[index]
        label = "" if real is None else f"\n{real.value}"
        panel.set_title(f"{_short(start.name)}{label}", fontsize=7, loc="left")
    for panel in axes[len(starts) :]:
        panel.set_visible(False)
    axes[0].set(xlim=(0.0, _MOTION), ylim=(-38.0, 38.0))
    figure.supylabel("rad/s", fontsize=9)
    figure.supxlabel("s after the trigger", fontsize=9)
    return figure


def _scores(found: Score) -> str:
    auc = "none or all" if found.auc_four is None else f"{found.auc_four:.2f}{_interval(found.auc_interval)}"
    rows = [
        [
            "Brier score (0 perfect, 2 worst)",
            f"<b>{found.brier:.2f}</b>{_interval(found.brier_interval)}",
            f"{found.brier_base:.2f}; knowing this flight too: {found.brier_base_in_sample:.2f}",
        ],
        ["its difference to the base rate", f"{found.gain:+.2f}{_interval(found.gain_interval)}", ""],
        ["log score (nats)", f"{found.log:.2f}", f"{found.log_base:.2f}"],
        ["AUC of four legs", auc, "0.50"],
    ]
    scores = table(["", "simulation (95 %, flights drawn again)", "base rate of the other flights"], rows)
    counts = [
        [
            word,
            str(count.real),
            f"{count.expected:.1f}",
            f"{count.interval80[0]} to {count.interval80[1]}{'' if count.inside else ': <b>outside</b>'}",
        ]
        for word, count in zip(_WORDS, found.counts, strict=True)
    ]
    return scores + table(["outcome", "real", "expected", "80 % of the time it would be"], counts)


def _interval(interval: tuple[float, float] | None) -> str:
    return "" if interval is None else f" ({interval[0]:.2f} to {interval[1]:.2f})"


def _flights(report: LandingReport) -> str:
    rows = []
    for flight, real in zip(as_json(report)["flights"], report.real, strict=True):
        shares = [f"{flight[f'p_{name}']:.2f}" for name in (*CLASS_NAMES, "body_contact")]
        times = [_time(flight["contact_s"]), _time(flight["contact_measured_s"])]
        rows.append([flight["name"], "" if real is None else real.value, *shares, *times])
    header = ["flight", "real", "four", "two", "none", "body contact", "contact, s", "measured, s"]
    return text_table(header, rows)


def _time(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def _dispersion(report: LandingReport) -> str:
    found = report.prepared.dispersion
    three = [
        ("velocity, m/s (world)", found.velocity),
        ("attitude, rad (body)", found.attitude),
        ("rate, rad/s (body)", found.rate),
    ]
    rows = [["distance to the ceiling, m", f"{found.height:.3f}"]]
    rows += [[name, ", ".join(f"{value:.3f}" for value in values)] for name, values in three]
    rows.append(["pitch acceleration of the flip, share", f"{found.pitch:.3f}"])
    rows.append(["roll acceleration per pitch acceleration", f"{found.roll:.3f}"])
    return table(["standard deviation, from these flights", ""], rows)


def _roll(found: RollEvidence) -> str:
    rows = [["measured", "", *(f"{v:+.3f} &plusmn; {s:.3f}" for v, s in found.measured.values()), ""]]
    for cause in found.causes:
        would = [
            f"{cause.predicted[name]:+.3f}" if name in cause.predicted else "" for name in found.measured
        ]
        verdict = "refuted by " + ", ".join(cause.refuted_by) if cause.refuted_by else "not refuted"
        rows.append([escape(cause.name), f"{cause.value:.3g} {escape(cause.unit)}", *would, escape(verdict)])
    return table(["cause", "size that it needs", *found.measured, ""], rows)
