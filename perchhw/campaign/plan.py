"""The campaign file (TOML, ``schema = "perchhw.campaign/1"``): what is to be flown, in which order.

Its keys are described in ``docs/campaigns.md``; a key that is not is an error.
"""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mocap_bridge.uri import parse_mocap_uri
from onboard.lab_file import LabFile
from onboard.link import check_drone_uri
from onboard.policy.bundle import encode_bundle
from onboard.policy.files import find_policy, load_policy
from onboard.room import RoomGeometry
from onboard.toml_file import read_toml
from onboard.vehicle import load_vehicle
from perchhw.attempt import APPROACH_PARAMETERS
from perchhw.campaign.file_table import SCHEMA, CampaignFileError, FileTable, check_names, room_of, setup_of

ORDERS = ("shuffled", "grid")


@dataclass(frozen=True)
class Slot:
    """One planned attempt: `number` is its place in the flying order, from 0."""

    number: int
    speed: float
    angle_deg: float
    repeat: int


@dataclass(frozen=True)
class CampaignPlan:
    """A campaign as its file says.

    Attributes:
        name: used in folder names and titles.
        drone, mocap: URIs.
        policy: policy file or name of a shipped policy.
        vehicle, legs: vehicle file or name; leg design or None.
        seed: seed of the order and of the attempts.
        order: ``shuffled`` (by the seed) or ``grid`` (angles within speeds within repeats).
        speeds: m/s, ascending, no value twice.
        angles_deg: deg, likewise.
        repeats: attempts per condition.
        room: ceiling and flight volume.
        approach: further parameters of the approach.
        aborted_in_a_row: that many aborted attempts in a row stop the campaign.
        attempts: fly only so many, from the beginning of the order; None for all.
        lab: the lab file, or None.
    """

    name: str
    drone: str
    mocap: str
    policy: str
    vehicle: str
    legs: str | None
    seed: int
    order: str
    speeds: tuple[float, ...]
    angles_deg: tuple[float, ...]
    repeats: int
    room: RoomGeometry
    approach: dict[str, float]
    aborted_in_a_row: int
    attempts: int | None = None
    lab: LabFile | None = None

    def slots(self) -> list[Slot]:
        """All attempts in flying order: each condition `repeats` times."""
        conditions = [
            (speed, angle, repeat)
            for repeat in range(1, self.repeats + 1)
            for speed in self.speeds
            for angle in self.angles_deg
        ]
        if self.order == "shuffled":
            order = np.random.default_rng(self.seed).permutation(len(conditions))
            conditions = [conditions[i] for i in order]
        return [Slot(number, *condition) for number, condition in enumerate(conditions[: self.attempts])]

    def attempt_seed(self, slot: int, try_number: int) -> int:
        """Seed of one try of one attempt."""
        return int(np.random.SeedSequence([self.seed, slot, try_number]).generate_state(1)[0])

    def fixed_part(self) -> dict[str, Any]:
        """What must not change when a campaign is resumed: everything but the URIs, the stop rule and
        what of the lab file is not the room.
        """
        part = dataclasses.asdict(dataclasses.replace(self, lab=None))
        for key in ("drone", "mocap", "aborted_in_a_row", "lab"):
            del part[key]
        return part


def load_plan(path: Path, lab: LabFile | None = None) -> CampaignPlan:
    """Read and check a campaign file; what it leaves out of drone, mocap, vehicle, legs, policy and room is
    as in the lab file.

    Raises:
        LabRequired: it is to be flown on hardware, and there is no lab file.
        CampaignFileError: missing, not TOML, with an unknown key or an unusable value, or naming a policy,
            vehicle or kind of address that does not exist.
    """
    root = FileTable(path, "", read_toml(path, CampaignFileError))
    root.choice("schema", (SCHEMA,))
    grid, stop = root.table("grid"), root.table("stop", required=False)
    setup = setup_of(root, lab, root.optional_text("policy"))
    plan = CampaignPlan(
        name=root.text("name", default=path.stem),
        drone=setup.drone,
        mocap=setup.mocap,
        policy=setup.policy,
        vehicle=setup.vehicle,
        legs=setup.legs,
        seed=root.integer("seed", default=0, minimum=0),
        order=root.choice("order", ORDERS, default="shuffled"),
        speeds=grid.numbers("speeds", lambda v: v > 0.0, "positive speeds in m/s"),
        angles_deg=grid.numbers("angles_deg", lambda v: 0.0 < v <= 90.0, "angles above 0 and up to 90 deg"),
        repeats=grid.integer("repeats", default=1, minimum=1),
        room=room_of(root.table("room", required=False), setup.room),
        approach=_approach(root.table("approach", required=False)),
        aborted_in_a_row=stop.integer("aborted_in_a_row", default=3, minimum=1),
        attempts=stop.integer("attempts", default=0, minimum=0) or None,
        lab=lab,
    )
    for table in (root, grid, stop):
        table.refuse_unread()
    check_names(
        root,
        {
            "drone": lambda: check_drone_uri(plan.drone),
            "mocap": lambda: parse_mocap_uri(plan.mocap),
            "policy": lambda: encode_bundle(load_policy(find_policy(plan.policy))),
            "vehicle": lambda: load_vehicle(plan.vehicle),
            "legs": lambda: load_vehicle(plan.vehicle, plan.legs),
        },
    )
    setup.check()
    return plan


def _approach(table: FileTable) -> dict[str, float]:
    values = {key: table.number(key, 0.0) for key in APPROACH_PARAMETERS if key in table.content}
    table.refuse_unread()
    return values
