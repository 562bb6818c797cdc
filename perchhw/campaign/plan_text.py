"""A campaign's plan in words: a picture of the grid in text, what does not fit, time and packs."""

from collections import Counter
from collections.abc import Iterator
from itertools import groupby

from perchhw.campaign.courses import FlightPlan
from perchhw.campaign.forecast import CampaignForecast
from perchhw.campaign.grid_fit import GridFit, row_of
from perchhw.campaign.plan import ADAPTIVE, CampaignPlan, Day, Misfit
from perchhw.campaign.seats import drone_names

FITS, MISFIT = "o", "x"
_WIDTH = 78
_WIDE, _NARROW = 6, 2


def plan_text(plan: CampaignPlan, fit: GridFit, cost: CampaignForecast) -> str:
    """Everything that ``perchhw campaign plan`` tells a person."""
    planned = len(plan.conditions())
    grid = "1 condition" if planned == 1 else f"{planned} conditions"
    head = f"{plan.name}: {grid}, {_times(plan.repeats)} each, {plan.order}"
    turns = [f"in turn: {', '.join(f'{name} ({drone})' for drone, name in drone_names(plan.drones).items())}"]
    blocks = [head, *(turns if plan.others else []), *grid_picture(plan, fit)]
    if fit.misfits:
        rows = f"rows {row_of(plan.file, 'speeds')} and {row_of(plan.file, 'angles_deg')}"
        verb = "does" if len(fit.misfits) == 1 else "do"
        what = f"{len(fit.misfits)} of {planned} conditions {verb} not fit"
        blocks += ["", f"{plan.file}: {what} under {plan.room.ceiling_z:.2f} m ([grid], {rows}):"]
        blocks += [f"  {line}" for line in _by_speed(fit.misfits)]
        blocks += [*highest(fit), *(["fly the others with --skip-unflyable"] if fit.approaches else [])]
    if not fit.approaches:
        return "\n".join(blocks)
    return "\n".join([*blocks, "", cost_text(cost, plan.day, at_most=plan.order == ADAPTIVE)])


def flights_text(plan: FlightPlan, cost: CampaignForecast) -> str:
    """What ``perchhw campaign plan`` tells of test flights, each of which fits."""
    kinds = Counter(flight.kind for flight in plan.flights)
    lines = [f"  {kind}" + (f", {times} times" if times > 1 else "") for kind, times in kinds.items()]
    return "\n".join([f"{plan.name}: test flights, all of which fit", *lines, "", cost_text(cost, Day())])


def grid_picture(plan: CampaignPlan, fit: GridFit) -> list[str]:
    """The grid as lines of text: speeds to the right, angles upwards, a mark for each condition."""
    misfits = {misfit.condition for misfit in fit.misfits}
    wide = 8 + _WIDE * len(plan.speeds) <= _WIDTH
    width = _WIDE if wide else _NARROW
    lines = [f"  deg   {FITS} fits   {MISFIT} does not fit"]
    for angle in reversed(plan.angles_deg):
        marks = (MISFIT if (speed, angle) in misfits else FITS for speed in plan.speeds)
        lines.append(f"{angle:6g} |" + "".join(mark.rjust(width) for mark in marks))
    labels = [f"{speed:g}" for speed in plan.speeds]
    if wide:
        axis = "".join(label.rjust(width) for label in labels)
    else:
        axis = " " + labels[0] + labels[-1].rjust(width * len(labels) - len(labels[0]) - 1)
    return [*lines, f"{'':6} +{'-' * width * len(labels)}", f"{'':8}{axis} m/s"]


def highest(fit: GridFit) -> list[str]:
    """The ceiling under which everything fits that height can make fit, as a line."""
    ceilings = [misfit.ceiling for misfit in fit.misfits if misfit.ceiling is not None]
    return [f"under {max(ceilings):.2f} m all of these would fit"] if len(ceilings) > 1 else []


def cost_text(cost: CampaignForecast, day: Day, at_most: bool = False) -> str:
    """Attempts, time and packs."""
    flown, in_air = _duration(cost.duration), _duration(cost.air_time)
    most, several = "at most " if at_most else "", "" if cost.attempts == 1 else "s"
    lines = [
        f"{most}{cost.attempts} attempt{several} in {flown}, {in_air} of it in the air, "
        f"{day.turnaround_s:g} s between two flights",
        f"{cost.packs} battery pack{'' if cost.packs == 1 else 's'}",
    ]
    if cost.new_pack_before:
        lines[-1] += f"; a new one before attempt {', '.join(str(n + 1) for n in cost.new_pack_before)}"
    return "\n".join(lines)


def _by_speed(misfits: tuple[Misfit, ...]) -> Iterator[str]:
    """A line a speed where height is what is missing, else a line a condition."""
    for speed, group in groupby(misfits, key=lambda misfit: misfit.speed):
        several = list(group)
        short = [f"{m.angle_deg:g} deg {m.ceiling:.2f} m" for m in several if m.ceiling is not None]
        if short:
            yield f"{speed:g} m/s needs a ceiling of: {', '.join(short)}"
        for misfit in several:
            if misfit.ceiling is None:
                yield f"{speed:g} m/s at {misfit.angle_deg:g} deg: {misfit.reason}"


def _times(repeats: int) -> str:
    return "once" if repeats == 1 else f"{repeats} times"


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    hours, minutes = divmod(round(seconds / 60.0), 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min"
