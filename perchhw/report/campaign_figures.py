"""Figures of a campaign: landing rates with their intervals beside what was predicted, where the policy
fired, how attempts ended one after another, and what the batteries had left."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.measurement import wilson_interval
from calibration.report_style import BLUE, INK, MUTED, by_width, new_figure, svg
from onboard.policy.model import Policy
from perchhw.attempt import Outcome
from perchhw.diagnosis.flip import CUES
from perchhw.report.outcome_style import OUTCOME_COLOURS, OUTCOME_MARKERS
from perchhw.report.trigger_plane import draw_region

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Rates = Mapping[tuple[float, float], float]
"""Landing rates by speed (m/s) and angle (deg)."""
_MOST_LABELLED = 30
"""Conditions whose figures still fit beside their dots."""


@dataclass(frozen=True)
class ShownAttempt:
    """One finished attempt as the report shows it.

    Attributes:
        speed: commanded, m/s.
        angle_deg: commanded.
        outcome: how it ended.
        trigger: the trigger snapshot, or None.
        aborted_by: the rule that ended it, or None.
        record: its run folder, or None where the record cannot be read.
        minutes: since the first attempt began, or None.
        said: the diagnosis in a sentence, or None.
        battery: voltage before the take-off and the lowest in flight, V, or None.
    """

    speed: float
    angle_deg: float
    outcome: Outcome
    trigger: dict[str, Any] | None
    aborted_by: str | None
    record: Path | None
    minutes: float | None = None
    said: str | None = None
    battery: tuple[float, float] | None = None


def landing_rates(attempts: Sequence[ShownAttempt], predicted: Rates) -> str:
    """Landing rate at each condition with its interval; beside it what the simulation predicted.

    Attempts that were ended early say nothing of it, and are not counted.
    """
    flown = Counter((a.speed, a.angle_deg) for a in attempts if a.outcome is not Outcome.ABORTED)
    if not flown:
        return "<p>No attempt has come to its end yet.</p>"
    landed = Counter((a.speed, a.angle_deg) for a in attempts if a.outcome.success)
    labels = {c: _rate_words(landed[c], n) for c, n in flown.items()}
    rates = {c: landed[c] / n for c, n in flown.items()}
    wanted = {c: p for c, p in predicted.items() if c in rates}
    said = ", ".join(f"{s:g} m/s {a:g} deg {landed[s, a]} of {n}" for (s, a), n in sorted(flown.items())[:12])
    alt = f"Landing rates by speed and angle: {said}"
    panels = [("flown", rates, labels)]
    if wanted:
        panels.append(("predicted by the simulation", wanted, {c: f"{p:.0%}" for c, p in wanted.items()}))
    return by_width(lambda broad: _rates_drawn(panels, broad), alt)


def _rate_words(successes: int, trials: int) -> str:
    low, high = wilson_interval(successes, trials)
    return f"{successes} of {trials}\n{low:.0%} to {high:.0%}"


def _rates_drawn(panels: list[tuple[str, dict[Any, float], dict[Any, str]]], broad: bool) -> "Figure":
    count = len(panels)
    figure = new_figure(10.4 if broad else 5.2, 4.0 if broad else 4.0 * count)
    shape = (1, count) if broad else (count, 1)
    drawn: Any = None
    for axes, (title, rates, labels) in zip(figure.subplots(*shape, squeeze=False).flat, panels, strict=True):
        places = np.array(sorted(rates), np.float64)
        values = np.array([rates[tuple(place)] for place in places])
        drawn = axes.scatter(
            places[:, 0],
            places[:, 1],
            c=values,
            s=90,
            cmap="cividis",
            vmin=0.0,
            vmax=1.0,
            edgecolors=INK,
            lw=0.6,
        )
        if len(rates) <= _MOST_LABELLED:
            for place in places:
                axes.annotate(
                    labels[tuple(place)],
                    place,
                    xytext=(8, 0),
                    textcoords="offset points",
                    fontsize=7,
                    va="center",
                )
        axes.set(xlabel="speed (m/s)", ylabel="approach angle (deg)")
        axes.set_title(title, loc="left", fontsize=10)
        axes.margins(0.25)
    figure.colorbar(drawn, ax=figure.axes[:count], label="four legs, no body contact", shrink=0.8)
    return figure


def trigger_states(attempts: Sequence[ShownAttempt], policy: Policy | None) -> str | None:
    """Where the policy fired in optical flow, by outcome, on the region that it fires in."""
    fired = [a for a in attempts if a.trigger and set(CUES) <= a.trigger.keys()]
    if not fired:
        return None
    states = np.array([[float((a.trigger or {})[name]) for name in CUES] for a in fired])
    figure = new_figure(5.2, 4.2)
    axes = figure.add_subplot()
    middle = float(np.median(states[:, 2]))
    tau = (min(0.18, 0.9 * states[:, 0].min()), max(0.32, 1.1 * states[:, 0].max()))
    flow = (0.0, max(6.0, 1.2 * states[:, 1].max()))
    draw_region(axes, policy, middle, tau, flow)
    _by_outcome(axes, [a.outcome for a in fired], states[:, 0], states[:, 1])
    axes.set(xlabel=r"$\tau$ at the trigger (s)", ylabel=r"$\theta_x$ at the trigger (1/s)")
    axes.legend(frameon=False, fontsize=7.5)
    return svg(figure, f"Trigger states of {len(fired)} attempts on the trigger region, by outcome")


def _by_outcome(axes: "Axes", outcomes: Sequence[Outcome], x: Any, y: Any) -> None:
    """Dots with the colour and the shape of their outcome, and one line of the legend for each."""
    for outcome in Outcome:
        rows = [k for k, one in enumerate(outcomes) if one is outcome]
        if rows:
            axes.plot(
                np.asarray(x)[rows],
                np.asarray(y)[rows],
                OUTCOME_MARKERS[outcome],
                ms=8,
                mec="white",
                ls="none",
                color=OUTCOME_COLOURS[outcome],
                label=outcome.value.replace("_", " "),
            )


def order_of_events(attempts: Sequence[ShownAttempt]) -> str | None:
    """How the attempts ended, one after another."""
    if not attempts:
        return None
    timed = all(a.minutes is not None for a in attempts)
    x = [float(a.minutes or 0.0) if timed else float(k) for k, a in enumerate(attempts)]
    shown = [outcome for outcome in Outcome if any(a.outcome is outcome for a in attempts)]
    alt = f"Outcomes in the order of flying: {', '.join(a.outcome.value for a in attempts[:20])}"

    def drawn(broad: bool) -> "Figure":
        figure = new_figure(10.4 if broad else 5.2, 0.34 * len(shown) + 0.9)
        axes = figure.add_subplot()
        _by_outcome(axes, [a.outcome for a in attempts], x, [shown.index(a.outcome) for a in attempts])
        labels = [outcome.value.replace("_", " ") for outcome in shown]
        axes.set(yticks=range(len(shown)), yticklabels=labels, ylim=(len(shown) - 0.4, -0.6))
        axes.set(xlabel="minutes since the first attempt" if timed else "attempt")
        return figure

    return by_width(drawn, alt)


def batteries(attempts: Sequence[ShownAttempt]) -> str | None:
    """Voltage before each take-off and the lowest in flight, attempt after attempt."""
    known = [(k, a.battery) for k, a in enumerate(attempts) if a.battery is not None]
    if not known:
        return None
    from matplotlib.ticker import MaxNLocator

    number, pairs = np.array([k for k, _ in known]), np.array([pair for _, pair in known])
    figure = new_figure(5.2, 4.2)
    axes = figure.add_subplot()
    axes.vlines(number, pairs[:, 1], pairs[:, 0], color=MUTED, lw=1)
    axes.plot(number, pairs[:, 0], "o", color=BLUE, ms=5, label="before take-off")
    axes.plot(number, pairs[:, 1], "v", color=INK, ms=5, label="lowest in flight")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set(xlabel="attempt", ylabel="battery (V)")
    axes.legend(frameon=False, fontsize=8)
    return svg(figure, f"Batteries over {len(known)} attempts; lowest {pairs[:, 1].min():.2f} V")
