"""How long a campaign takes, and how many battery packs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from onboard.manoeuvres import manoeuvre
from onboard.trajectory import ApproachPlan
from onboard.vehicle import load_vehicle
from perchhw.campaign.packs import TO_THE_START, PackModel, air_time
from perchhw.campaign.plan import ADAPTIVE, CampaignPlan, Condition, Day
from perchhw.lab import limits_of
from perchhw.supervisor import Timing

if TYPE_CHECKING:
    from perchhw.campaign.courses import FlightPlan

CONNECTING = 3.0
"""s, from the start of an attempt to its first check: link, parameters, logs (docs/link.md)."""
UPLOADING = 1.5
"""s, from the checks to the motors: upload, read-back and arming, as seen in the simulated lab."""
AROUND_A_COURSE = TO_THE_START + Timing().land
"""s in the air before and after a test flight's course."""


@dataclass(frozen=True)
class CampaignForecast:
    """What a campaign costs, as planned.

    Attributes:
        attempts: how many are flown; at most, where the campaign may end earlier.
        duration: from the first connection to the end of the last attempt, s.
        air_time: of it with motors turning, s.
        packs: battery packs, all drones together, that are full when put in.
        new_pack_before: attempts (from 0) before which one is put in, beyond the first of each drone.
    """

    attempts: int
    duration: float
    air_time: float
    packs: int
    new_pack_before: tuple[int, ...]


def forecast(plan: CampaignPlan, approaches: Mapping[Condition, ApproachPlan]) -> CampaignForecast:
    """What the attempts of `plan` cost, of which every condition is in `approaches`."""
    flights, model = _air_times(plan, approaches), PackModel.for_plan(plan)
    return _cost(flights, model, plan.day, drones=min(len(plan.drones), len(flights)))


def forecast_courses(plan: "FlightPlan") -> CampaignForecast:
    """What the test flights of `plan` cost."""
    setup = plan.setup
    courses = (manoeuvre(f.kind).course(f.parameters, setup.room) for f in plan.flights)
    limits = limits_of(setup.lab, setup.room, setup.drone)
    model = PackModel.of(load_vehicle(setup.vehicle, setup.legs), limits, climb=0.0)
    return _cost([course.duration + AROUND_A_COURSE for course in courses], model, Day(), drones=1)


def _cost(flights: Sequence[float], model: PackModel, day: Day, drones: int) -> CampaignForecast:
    """What flights cost of which each takes so many seconds in the air, and the warm-ups before them."""
    hover = day.warm_up_s + AROUND_A_COURSE if day.warm_up_s > 0.0 else 0.0
    hovers = drones if day.warm_up_s > 0.0 else 0
    changes = _changes(flights, model, drones, hover)
    timing = Timing()
    ground = CONNECTING + timing.checks_hold + UPLOADING + timing.settle + timing.disarm_hold
    air_time, starts = sum(flights) + hovers * hover, len(flights) + hovers
    between = day.turnaround_s * max(0, starts - 1) + day.new_pack_s * len(changes)
    return CampaignForecast(
        attempts=len(flights),
        duration=air_time + ground * starts + between,
        air_time=air_time,
        packs=drones + len(changes),
        new_pack_before=tuple(changes),
    )


def _air_times(plan: CampaignPlan, approaches: Mapping[Condition, ApproachPlan]) -> list[float]:
    """Of all attempts in flying order, s; the mean of the grid for each that is chosen on the day."""
    if plan.order != ADAPTIVE:
        return [air_time(approaches[slot.condition]) for slot in plan.slots()]
    each = [air_time(approaches[condition]) for condition in plan.conditions()]
    return [sum(each) / len(each)] * plan.most_attempts if each else []


def _changes(flights: Sequence[float], model: PackModel, drones: int, hover: float) -> list[int]:
    """Attempts before which the drone whose turn it is needs a new pack; each hovered for `hover` s first."""
    at_rest = [model.after(model.full, hover)] * drones
    changes = []
    for number, seconds in enumerate(flights):
        drone = number % drones
        if not model.enough(at_rest[drone]):
            changes.append(number)
            at_rest[drone] = model.full
        at_rest[drone] = model.after(at_rest[drone], seconds)
    return changes
