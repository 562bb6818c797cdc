"""Figures of one flight beside its picture: the cues against the trigger region, the planned path, thrust and
battery, the phases. Each function gives inline SVG, or None when the record lacks what it would show."""

from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.flights import Flight
from calibration.report_style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    TRIGGER,
    Margins,
    by_width,
    new_figure,
    svg,
)
from onboard.app_interface import LandingState
from onboard.battery import FULL_RATIO
from onboard.policy.model import Policy
from onboard.record.run_record import RunRecord
from onboard.trajectory import ApproachPlan, sample_approach
from perchhw.diagnosis.flip import CUES, approach_cues, values_of
from perchhw.report.trigger_plane import draw_region

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BEFORE_S = 1.0
_PHASE_FILLS = ("#dce8f4", "#f0e6d6")


def trigger_region(flight: Flight, policy: Policy | None) -> str | None:
    """The way of the cues through optical flow, and the region in which the policy fires."""
    if not flight.has(*CUES):
        return None
    t, cues = approach_cues(flight)
    if flight.trigger is not None:
        cues = cues[(t <= flight.trigger.t + 0.02) & (t > flight.trigger.t - _BEFORE_S)]
    cues = cues[(cues[:, 0] > 0.0) & (cues[:, 0] < 1.0)]
    if not len(cues):
        return None
    seen = None if flight.trigger is None else flight.trigger.snapshot
    fired = seen if seen and all(name in seen for name in CUES) else None
    nearest = cues[-1] if policy is None else cues[int(np.argmax(values_of(policy, cues)))]
    at = nearest if fired is None else np.array([fired[name] for name in CUES])
    figure = new_figure(5.2, 4.0, Margins())
    axes = figure.add_subplot()
    tau = (0.9 * min(at[0], 0.2), 1.25 * max(at[0], 0.3))
    flow = (max(0.0, min(0.3, cues[:, 1].min() - 0.3)), max(6.0, 1.4 * at[1]))
    draw_region(axes, policy, float(at[2]), tau, flow)
    axes.plot(cues[:, 0], cues[:, 1], ".-", color=BLUE, ms=3, lw=1, label="cues")
    axes.plot(
        at[0], at[1], "D" if fired else "o", ms=7, mfc="none", mec=TRIGGER, mew=1.8,
        label="trigger" if fired else "nearest",
    )  # fmt: skip
    axes.set(xlabel=r"$\tau$ (s), time to contact", ylabel=r"$\theta_x$ (1/s), optical flow")
    axes.legend(frameon=False, fontsize=8)
    what = "the trigger" if fired else "the nearest state"
    return svg(
        figure, f"Cues against the trigger region; {what} at tau {at[0]:.3f} s, theta_x {at[1]:.2f} 1/s"
    )


def tracking(flight: Flight, approach: dict[str, Any] | None) -> str | None:
    """The planned approach against the flown one: height over time, and the distance between the two."""
    if not approach or not flight.has("x", "z", "landing_state"):
        return None
    state_t, state = flight.series("landing_state")
    begun = state_t[state[:, 0] == LandingState.APPROACH]
    if not begun.size:
        return None
    plan = ApproachPlan(**approach)
    end = float(begun[-1]) if flight.trigger is None else flight.trigger.t
    t, path = flight.series("x", "y", "z")
    during = (t >= begun[0]) & (t <= end)
    if during.sum() < 3:
        return None
    after = t[during] - begun[0]
    wanted = np.array([sample_approach(plan, float(s))[0] for s in after])
    distance = np.linalg.norm(path[during] - wanted, axis=1)
    figure = new_figure(5.2, 4.0, Margins())
    top, bottom = figure.subplots(2, 1, sharex=True)
    top.plot(after, wanted[:, 2], color=MUTED, lw=1.4, ls="--", label="planned height")
    top.plot(after, path[during, 2], color=BLUE, lw=1.3, label="flown")
    top.set(ylabel="z (m)")
    top.legend(frameon=False, fontsize=8)
    bottom.plot(after, 100.0 * distance, color=BLUE, lw=1.2)
    bottom.set(ylabel="distance (cm)", xlabel="time from the start of the approach (s)", ylim=(0.0, None))
    return svg(
        figure, f"Tracking: the flown path stays within {100 * distance.max():.0f} cm of the planned one"
    )


def power(flight: Flight) -> str | None:
    """Commands of the four motors and the battery's voltage over the flight."""
    if not flight.has("vbat"):
        return None
    zero = float(flight.t[0]) if flight.trigger is None else flight.trigger.t
    motors = flight.has("m1", "m2", "m3", "m4")
    figure = new_figure(5.2, 4.0 if motors else 2.6, Margins(top=0.3))
    panels = figure.subplots(2 if motors else 1, 1, sharex=True, squeeze=False)[:, 0]
    if motors:
        t, duty = flight.series("m1", "m2", "m3", "m4")
        looks = zip("1234", (BLUE, ORANGE, GREEN, INK), ("-", "--", "-.", ":"), strict=True)
        for k, (name, colour, line) in enumerate(looks):
            panels[0].plot(
                t - zero, duty[:, k] / FULL_RATIO * 100.0, line, color=colour, lw=1.0, label=f"motor {name}"
            )
        panels[0].set(ylabel="thrust command (%)", ylim=(0.0, 104.0))
        panels[0].legend(frameon=False, fontsize=7.5, ncols=4, loc="upper left", bbox_to_anchor=(-0.02, 1.18))
    t, volts = flight.series("vbat")
    panels[-1].plot(t - zero, volts[:, 0], color=GREEN, lw=1)
    panels[-1].set(ylabel="battery (V)", xlabel=_seconds(flight))
    if flight.trigger is not None:
        for axes in panels:
            axes.axvline(0.0, color=TRIGGER, lw=1.2)
    low = float(volts.min())
    return svg(figure, f"Motor commands and battery; lowest voltage {low:.2f} V")


def phases(run: RunRecord) -> str | None:
    """The supervisor's phases on a time line, numbered; the words stand in the table below it."""
    start = float(run.info.get("clock_at_start") or 0.0)
    changes = [(e["t"] - start, str(e.get("phase"))) for e in run.events if e["event"] == "phase"]
    firsts = [c for k, c in enumerate(changes) if k == 0 or changes[k - 1][1] != c[1]]
    if len(firsts) < 2:
        return None
    alt = "Time line: " + ", ".join(f"{phase} from {t:.1f} s" for t, phase in firsts)
    return by_width(lambda broad: _phases_drawn(firsts, broad), alt)


def _phases_drawn(firsts: list[tuple[float, str]], broad: bool) -> "Figure":
    rows = len(firsts) - 1
    figure = new_figure(10.4 if broad else 5.2, 0.27 * rows + 0.7, Margins(left=0.12))
    axes = figure.add_subplot()
    spans = zip(firsts, firsts[1:], cycle(_PHASE_FILLS), strict=False)
    for row, ((t, phase), (until, _), fill) in enumerate(spans):
        axes.barh(row, until - t, left=t, height=0.8, color=fill, edgecolor=MUTED, lw=0.6)
        axes.text(until, row, f"  {phase}, {until - t:.2f} s", va="center", fontsize=8, color=INK)
    axes.set(xlabel="time from the start of the record (s)", yticks=[], ylim=(rows - 0.4, -0.6))
    axes.set_xlim(0.0, firsts[-1][0] * (1.25 if broad else 1.6))
    return figure


def _seconds(flight: Flight) -> str:
    return "time from start (s)" if flight.trigger is None else "time from trigger (s)"
