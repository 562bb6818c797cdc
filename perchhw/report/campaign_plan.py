"""The plan of a campaign as a page: its grid as a picture, what does not fit, time and packs."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from calibration.report_style import (
    GREEN,
    INK,
    TRIGGER,
    by_width,
    new_figure,
    page,
    report_style,
    section,
    table,
)
from perchhw.campaign import CampaignPlan
from perchhw.campaign.forecast import CampaignForecast
from perchhw.campaign.grid_fit import GridFit
from perchhw.campaign.plan import ADAPTIVE, Misfit
from perchhw.campaign.plan_text import cost_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_campaign_plan(plan: CampaignPlan, fit: GridFit, cost: CampaignForecast, file: Path) -> Path:
    """Write the page to `file`; it loads nothing from elsewhere."""
    with report_style():
        body = section("The grid", _grid(plan, fit), "The number at a cross: the ceiling it needs, m.")
    body += misfit_section(fit.misfits)
    told = cost_text(cost, plan.day, at_most=plan.order == ADAPTIVE).splitlines()
    words = "".join(f"<p>{escape(line)}</p>" for line in told)
    planned = len(plan.conditions())
    subtitle = f"{planned - len(fit.misfits)} of {planned} conditions fit under {plan.room.ceiling_z:.2f} m"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(page(f"Plan of {plan.name}", subtitle, body + section("Time and packs", words)), "utf-8")
    return file


def misfit_section(misfits: Sequence[Misfit]) -> str:
    """What does not fit the room, and why; nothing where everything does."""
    rows = [
        [f"{m.speed:g}", f"{m.angle_deg:g}", f"{escape(m.remedy)}<br><small>{escape(m.reason)}</small>"]
        for m in misfits
    ]
    return section("What does not fit", table(["m/s", "deg", "remedy, and why"], rows)) if rows else ""


def _grid(plan: CampaignPlan, fit: GridFit) -> str:
    """A dot for what fits, a cross for what does not."""
    fitting, all_of_them = len(fit.approaches), len(fit.approaches) + len(fit.misfits)
    alt = f"Grid of speeds and approach angles: {fitting} of {all_of_them} conditions fit the room"
    return by_width(lambda broad: _grid_drawn(plan, fit, broad), alt)


def _grid_drawn(plan: CampaignPlan, fit: GridFit, broad: bool) -> "Figure":
    figure = new_figure(10.4 if broad else 5.2, 4.6)
    axes = figure.add_subplot()
    if fit.approaches:
        axes.plot(*zip(*fit.approaches, strict=True), "o", ms=9, color=GREEN, label="fits")
    for index, misfit in enumerate(fit.misfits):
        label = None if index else "does not fit"
        axes.plot(*misfit.condition, "x", ms=9, mew=2.5, color=TRIGGER, label=label)
        if misfit.ceiling is not None:
            axes.annotate(
                f"{misfit.ceiling:.2f}",
                misfit.condition,
                xytext=(0, 7),
                textcoords="offset points",
                ha="center",
                color=INK,
                fontsize=7.5,
            )
    axes.set(xlabel="speed (m/s)", ylabel="approach angle (deg)", xticks=plan.speeds, yticks=plan.angles_deg)
    axes.tick_params(axis="x", labelrotation=90 if len(plan.speeds) > (20 if broad else 10) else 0)
    axes.margins(0.12)
    axes.legend(frameon=False, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure
