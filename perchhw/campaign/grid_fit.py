"""Which conditions of a campaign fit the room, and the ceiling that would let the others fly.

Nothing is connected: an approach fits when it can be planned.
"""

import re
from dataclasses import dataclass, replace
from pathlib import Path

from onboard.errors import InputError
from onboard.lab_file import CEILING_HEIGHT, room_problem
from onboard.trajectory import ApproachPlan
from perchhw.campaign.file_table import CampaignFileError
from perchhw.campaign.plan import CampaignPlan, Condition, Misfit, Slot
from perchhw.campaign.run import request_of

_STEP = 0.01
"""m. Ceilings are built, and measured, to a centimetre."""


@dataclass(frozen=True)
class GridFit:
    """A campaign's grid held against its room.

    Attributes:
        approaches: what is flown at each condition that fits.
        misfits: the others, by speed and angle.
    """

    approaches: dict[Condition, ApproachPlan]
    misfits: tuple[Misfit, ...]


def fit_grid(plan: CampaignPlan) -> GridFit:
    """Plan the approach of every condition of the grid.

    Raises:
        CampaignFileError: nothing can be flown in this room at all.
    """
    unusable = room_problem(plan.room)
    if unusable is not None:
        raise CampaignFileError(f"{plan.file}: room: {unusable}")
    approaches: dict[Condition, ApproachPlan] = {}
    misfits = []
    for condition in plan.conditions():
        found = _approach(plan, condition)
        if isinstance(found, ApproachPlan):
            approaches[condition] = found
        else:
            misfits.append(Misfit(*condition, str(found), _lowest_ceiling(plan, condition)))
    return GridFit(approaches, tuple(misfits))


def check_approaches(plan: CampaignPlan) -> None:
    """See that every approach of the grid fits the room, before the first one is flown.

    Raises:
        CampaignFileError: names file, keys, rows and every condition that does not fit.
    """
    fit = fit_grid(plan)
    misfits = fit.misfits
    if misfits:
        others = ", or fly the others with --skip-unflyable" if fit.approaches else ""
        verb = "does" if len(misfits) == 1 else "do"
        each = "\n".join(f"  {m.speed:g} m/s at {m.angle_deg:g} deg: {m.remedy}" for m in misfits)
        keys = " and ".join(f"grid.{key} (row {row_of(plan.file, key)})" for key in ("speeds", "angles_deg"))
        raise CampaignFileError(
            f"{plan.file}: {len(misfits)} of {len(plan.conditions())} conditions of key {keys} {verb} not "
            f"fit the room, whose ceiling is at {plan.room.ceiling_z:.2f} m:\n{each}\n"
            f"take them out of the grid{others}"
        )


def flyable_part(plan: CampaignPlan) -> CampaignPlan:
    """The campaign without what does not fit the room.

    Raises:
        CampaignFileError: nothing is left.
    """
    fit = fit_grid(plan)
    if not fit.approaches:
        check_approaches(plan)
    return replace(plan, skipped=fit.misfits)


def row_of(file: Path, key: str) -> int:
    """Number of the line, from 1, on which `key` of ``[grid]`` stands in a campaign file; 0: on none."""
    table = ""
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1):
        head = re.match(r"\s*\[+\s*([\w.]+)\s*\]", line)
        table = head[1] if head else table
        if re.match(rf"\s*{'' if table == 'grid' else 'grid.'}{key}\s*=", line):
            return number
    return 0


def _approach(plan: CampaignPlan, condition: Condition) -> ApproachPlan | InputError:
    from perchhw.flight.mission import plan_attempt

    request = request_of(plan, Slot(0, *condition, 1), Path(), try_number=1)
    try:
        return plan_attempt(request, policy_crc=0).approach
    except InputError as problem:
        return problem


def _lowest_ceiling(plan: CampaignPlan, condition: Condition) -> float | None:
    """By bisection: what fits under one ceiling fits under any higher one."""

    def fits(steps: int) -> bool:
        room = replace(plan.room, ceiling_z=steps * _STEP)
        return isinstance(_approach(replace(plan, room=room), condition), ApproachPlan)

    low, high = int(plan.room.ceiling_z / _STEP), round(CEILING_HEIGHT.most / _STEP)
    if not fits(high):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high * _STEP
