"""Whose turn it is, and what is done first: the drones of a campaign, their packs and their warm-ups."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from calibration.flights.run_folder import RunFolderError, is_run_folder, read_info, read_run
from perchhw.attempt import AttemptRequest
from perchhw.campaign.packs import PackModel
from perchhw.campaign.plan import CampaignPlan, Slot

_AT_REST = 0.5
"""s at the end of a record, after the motors were cut, in which the pack recovers and is measured."""


class Turns:
    """What each attempt of one run of a campaign is asked beside its condition.

    Args:
        plan: the campaign.
        records: what it has flown so far, in flying order: the packs are still in the drones.
    """

    def __init__(self, plan: CampaignPlan, records: Iterable[Path] = ()) -> None:
        self._plan, self._model = plan, PackModel.for_plan(plan)
        self._at_rest: dict[str, float] = {}
        self._warm: set[str] = set()
        for record in records:
            self._measure(record)

    def prepared(self, request: AttemptRequest, slot: Slot) -> AttemptRequest:
        """The request with the drone whose turn it is, its warm-up, and a new pack where it needs one."""
        seats = self._plan.drones
        seat = seats[slot.number % len(seats)]
        at_rest = self._at_rest.get(seat.drone, self._model.full)
        new_pack = None
        if not self._model.enough(at_rest):
            new_pack = f"its pack rests at {at_rest:.2f} V, and an attempt needs {self._model.least:.2f} V"
        warm_up = 0.0 if seat.drone in self._warm else self._plan.day.warm_up_s
        return replace(request, drone=seat.drone, mocap=seat.mocap, new_pack=new_pack, warm_up_s=warm_up)

    def flown(self, request: AttemptRequest) -> None:
        """The attempt of `request` is over; its record tells how its pack is."""
        self._warm.add(request.drone)
        if request.new_pack is not None:
            self._at_rest.pop(request.drone, None)
        self._measure(request.folder)

    def _measure(self, record: Path) -> None:
        at_rest = pack_at_rest(record)
        if at_rest is not None:
            self._at_rest[at_rest[0]] = at_rest[1]


def pack_at_rest(record: Path) -> tuple[str, float] | None:
    """Drone, and voltage (V) of its pack at the end of a flight; None where the record does not tell it."""
    if not is_run_folder(record):
        return None
    try:
        drone = read_info(record / "run.json")["config"].get("drone")
        power = read_run(record).series.get("power")
    except RunFolderError:
        return None
    if drone is None or power is None or not power.t.size:
        return None
    voltage = power.numbers("vbat")[power.t >= power.t[-1] - _AT_REST]
    voltage = voltage[np.isfinite(voltage)]
    return (str(drone), float(np.median(voltage))) if voltage.size else None
