"""``perchhw campaign plan``: what a campaign will fly, what does not fit, how long it takes."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.cli import exit_codes
from perchhw.cli.options import Drones, Lab
from perchhw.cli.output import emit

SCHEMA = "perchhw.campaign_plan/1"
"""Of the JSON document."""

if TYPE_CHECKING:
    from perchhw.campaign import CampaignPlan
    from perchhw.campaign.forecast import CampaignForecast
    from perchhw.campaign.grid_fit import GridFit


def plan(
    file: Annotated[Path, typer.Argument(help="Campaign file (TOML).")],
    lab: Lab = None,
    drone: Drones = None,
    out: Annotated[Path | None, typer.Option(help="Page to write (HTML), of a grid.")] = None,
) -> int:
    """Show what a campaign will fly: the grid, all that does not fit, duration, packs. Connects to nothing.

    Exit codes: 0 everything fits, 1 something does not, or policy, vehicle and room do not belong together,
    2 the file cannot be used.
    """
    from perchhw.campaign import fit_grid, forecast, load_plan
    from perchhw.campaign.courses import has_flights
    from perchhw.campaign.plan_text import plan_text
    from perchhw.lab import find_lab

    if has_flights(file):
        return _plan_flights(file, lab, drone or ())
    campaign = load_plan(file, find_lab(lab), drone or ())
    fit = fit_grid(campaign)
    cost = forecast(replace(campaign, skipped=fit.misfits), fit.approaches)
    text, document = plan_text(campaign, fit, cost), _document(campaign, fit, cost)
    if out is not None:
        from perchhw.report.campaign_plan import write_campaign_plan

        document["page"] = write_campaign_plan(campaign, fit, cost, out)
        text += f"\npage: {out}"
    mismatch = _mismatch(campaign)
    document["mismatch"] = mismatch
    emit(document, text if mismatch is None else f"{text}\n\n{mismatch}")
    return exit_codes.FAILED if fit.misfits or mismatch else exit_codes.DONE


def _mismatch(campaign: "CampaignPlan") -> str | None:
    """What of policy, vehicle and room does not belong together, so that ``campaign run`` would refuse it."""
    from perchhw.campaign.plan import Slot
    from perchhw.campaign.run import request_of
    from perchhw.flight.fit import Mismatch, check_fit

    first = Slot(0, campaign.speeds[0], campaign.angles_deg[0], 1)
    try:
        check_fit(request_of(campaign, first, Path(), try_number=1))
    except Mismatch as error:
        return str(error)
    return None


def _plan_flights(file: Path, lab: Path | None, drones: Sequence[str]) -> int:
    """The plan of a campaign of test flights; one that does not fit is an error of the file."""
    from perchhw.campaign.courses import load_flight_plan
    from perchhw.campaign.forecast import forecast_courses
    from perchhw.campaign.plan_text import flights_text
    from perchhw.lab import find_lab

    campaign = load_flight_plan(file, find_lab(lab), drones)
    cost = forecast_courses(campaign)
    head = {"schema": SCHEMA, "campaign": campaign.name, "file": file, "drones": [campaign.setup.drone]}
    emit({**head, "misfits": [], **_cost(cost)}, flights_text(campaign, cost))
    return exit_codes.DONE


def _cost(cost: "CampaignForecast") -> dict[str, Any]:
    return {
        "attempts": cost.attempts,
        "duration_s": cost.duration,
        "air_time_s": cost.air_time,
        "packs": cost.packs,
        "new_pack_before": cost.new_pack_before,
    }


def _document(campaign: "CampaignPlan", fit: "GridFit", cost: "CampaignForecast") -> dict[str, Any]:
    from perchhw.campaign.grid_fit import row_of

    rows = {f"grid.{key}": row_of(campaign.file, key) for key in ("speeds", "angles_deg")}
    return {
        "schema": SCHEMA,
        "campaign": campaign.name,
        "file": campaign.file,
        "order": campaign.order,
        "drones": [seat.drone for seat in campaign.drones],
        "ceiling_m": campaign.room.ceiling_z,
        "conditions": [
            {
                "speed": speed,
                "angle_deg": angle,
                "fits": (speed, angle) in fit.approaches,
                "repeats": campaign.repeats,
            }
            for speed, angle in campaign.conditions()
        ],
        "misfits": [
            {
                "speed": misfit.speed,
                "angle_deg": misfit.angle_deg,
                "keys": rows,
                "reason": misfit.reason,
                "ceiling_m": misfit.ceiling,
            }
            for misfit in fit.misfits
        ],
        **_cost(cost),
    }
