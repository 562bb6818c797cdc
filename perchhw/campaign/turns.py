"""Whose turn it is, and what is done first: the drones of a campaign, their packs and their warm-ups."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from onboard.record.run_record import RunFolderError, is_run_folder, read_info
from perchhw.attempt import AttemptRequest
from perchhw.campaign.packs import PackModel
from perchhw.campaign.plan import CampaignPlan, Slot
from perchhw.record.run import read_run

_RECOVERY = 1.0
"""s after the motors' last command: propellers coast, and the voltage comes back as they slow down."""
_READINGS = 2
"""So many say what the voltage is at rest."""
_LOOKED_BACK = 20
"""Records of each drone: more attempts than a pack is good for."""
_MOTORS = ("m1", "m2", "m3", "m4")


class Turns:
    """What each attempt of one run of a campaign is asked beside its condition.

    Args:
        plan: the campaign.
        records: what it has flown so far, in flying order: the packs are still in the drones.
    """

    def __init__(self, plan: CampaignPlan, records: Sequence[Path] = ()) -> None:
        self._plan, self._model = plan, PackModel.for_plan(plan)
        self._at_rest: dict[str, float] = {}
        self._warm: set[str] = set()
        for use in _since_measured(records, {seat.drone for seat in plan.drones}):
            self._note(use)

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
        use = pack_use(request.folder)
        if use is not None:
            self._note(use)

    def _note(self, use: "PackUse") -> None:
        before = self._at_rest.get(use.drone, self._model.full)
        self._at_rest[use.drone] = (
            self._model.after(before, use.air_time) if use.at_rest is None else use.at_rest
        )


class PackUse(NamedTuple):
    """What a record says of a pack.

    Attributes:
        drone: whose it is.
        air_time: how long the motors turned, s.
        at_rest: its voltage afterwards, V; None: the record ends too early.
    """

    drone: str
    air_time: float
    at_rest: float | None


def _since_measured(records: Sequence[Path], drones: set[str]) -> list[PackUse]:
    """The last flights of each of `drones`, in their order, from one on after which its pack was measured."""
    uses: list[PackUse] = []
    for record in islice(reversed(records), _LOOKED_BACK * len(drones)):
        use = pack_use(record)
        if use is not None:
            uses.insert(0, use)
        if drones <= {use.drone for use in uses if use.at_rest is not None}:
            break
    return uses


def pack_use(record: Path) -> PackUse | None:
    """How a flight used its pack; None where the record does not tell it."""
    if not is_run_folder(record):
        return None
    try:
        drone = read_info(record)["config"].get("drone")
        series = read_run(record).series
    except RunFolderError:
        return None
    if drone is None or "power" not in series:
        return None
    turning = np.zeros(0)
    if "motors" in series:
        motors = series["motors"]
        turning = motors.t[np.any([motors.numbers(name) > 0.0 for name in _MOTORS], axis=0)]
    power = series["power"]
    since = turning[-1] + _RECOVERY if turning.size else -np.inf
    voltage = power.numbers("vbat")[power.t >= since]
    voltage = voltage[np.isfinite(voltage)]
    return PackUse(
        str(drone),
        float(np.ptp(turning)) if turning.size else 0.0,
        float(np.median(voltage)) if voltage.size >= _READINGS else None,
    )
