"""The campaign file (TOML, ``schema = "perchhw.campaign/1"``): what is to be flown, in which order.

Its keys are described in ``docs/campaigns.md``; a key that is not is an error.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from onboard.lab_file import LabFile
from onboard.manoeuvres import HOVER, manoeuvre
from onboard.policy.bundle import encode_bundle, policy_crc32
from onboard.policy.files import find_policy, load_policy
from onboard.room import RoomGeometry
from onboard.toml_file import read_toml
from onboard.trajectory import ANGLE_MIN_DEG, SPEED_MAX
from perchhw.attempt import APPROACH_PARAMETERS, SHAPE
from perchhw.campaign.file_table import (
    SCHEMA,
    CampaignFileError,
    FileTable,
    check_names,
    check_vehicle,
    nobody,
    room_of,
    vehicle_sha256,
)
from perchhw.campaign.seats import Seat, setups_of
from perchhw.diagnosis.rules import AbortKind

ADAPTIVE = "adaptive"
ORDERS = ("shuffled", "grid", ADAPTIVE)

Condition = tuple[float, float]
"""A speed (m/s) and an angle (deg)."""
MOST_ATTEMPTS = 10_000
"""Of a grid, or of one test flight: years of flights; one more is a slip of the pen."""

_MAY_CHANGE = (
    "drone",
    "mocap",
    "others",
    "lab",
    "file",
    "day",
    "aborted_in_a_row",
    "aborts",
    "map_error",
    "operator",
    "note",
    "accept_mismatch",
)
"""Of a plan, when its campaign is resumed."""


@dataclass(frozen=True)
class Slot:
    """One planned attempt: `number` is its place in the flying order, from 0."""

    number: int
    speed: float
    angle_deg: float
    repeat: int

    @property
    def condition(self) -> Condition:
        """Speed and angle."""
        return self.speed, self.angle_deg


@dataclass(frozen=True)
class Misfit:
    """A condition that cannot be flown.

    Attributes:
        speed: m/s.
        angle_deg: deg.
        reason: why, with numbers.
        ceiling: height of the lowest ceiling (m, to a centimetre) under which it fits in this room; None: no
            ceiling that a room may have would do.
    """

    speed: float
    angle_deg: float
    reason: str
    ceiling: float | None

    @property
    def condition(self) -> Condition:
        """Speed and angle."""
        return self.speed, self.angle_deg

    @property
    def remedy(self) -> str:
        """What would let it fly, in a few words."""
        return self.reason if self.ceiling is None else f"needs a ceiling of {self.ceiling:.2f} m"


@dataclass(frozen=True)
class Day:
    """How the flights of a campaign follow each other: what a person does between them, and for how long.

    The defaults are engineering estimates of one person beside the cage.

    Attributes:
        turnaround_s: from the end of a flight to the next one, s: fetch the drone, put it on its mark.
        new_pack_s: as much longer with a new battery pack, s.
        warm_up_s: hover for so long before the first attempt of each drone, in every run of the campaign, s.
    """

    turnaround_s: float = 60.0
    new_pack_s: float = 60.0
    warm_up_s: float = 0.0


@dataclass(frozen=True)
class CampaignPlan:
    """A campaign as its file says.

    Attributes:
        name: used in folder names and titles.
        drone, mocap: URIs.
        policy: policy file or name of a shipped policy.
        vehicle, legs: vehicle file or name; leg design or None.
        seed: seed of the order and of the attempts.
        order: ``shuffled`` (by the seed), ``grid`` (angles within speeds within repeats), or ``adaptive``
            (each where it tells most; see :mod:`perchhw.campaign.adaptive`).
        speeds: m/s, ascending, no value twice.
        angles_deg: deg, likewise.
        repeats: attempts per condition; where the order is adaptive, their mean at most.
        room: ceiling and flight volume.
        approach: further parameters of the approach.
        aborted_in_a_row: that many aborted attempts in a row stop the campaign.
        aborts: so many of a kind (:class:`perchhw.diagnosis.rules.AbortKind`) in one run stop it as well.
        attempts: fly only so many, from the beginning of the order; None for all.
        map_error: an adaptive campaign is done when the expected error of its map is as small.
        lab: the lab file, or None.
        file: where it was read.
        skipped: what of the grid is left out, because it does not fit.
        day: how its flights follow each other.
        others: further drones, which fly in turn with the first.
        operator, note: who flies, and what is to be remembered of it; kept with every attempt.
        accept_mismatch: fly policy, vehicle, room and drone also where they do not belong together.
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
    map_error: float = 0.0
    lab: LabFile | None = None
    file: Path = Path()
    skipped: tuple[Misfit, ...] = ()
    day: Day = Day()
    others: tuple[Seat, ...] = ()
    aborts: Mapping[str, int] = field(default_factory=dict)
    operator: str | None = None
    note: str | None = None
    accept_mismatch: bool = False

    @property
    def drones(self) -> tuple[Seat, ...]:
        """All drones, in the order of their turns."""
        return Seat(self.drone, self.mocap), *self.others

    def conditions(self) -> list[Condition]:
        """What of the grid is to be flown: angles within speeds."""
        skipped = {misfit.condition for misfit in self.skipped}
        grid = [(speed, angle) for speed in self.speeds for angle in self.angles_deg]
        return [condition for condition in grid if condition not in skipped]

    @property
    def most_attempts(self) -> int:
        """So many attempts are flown, or fewer where the order is adaptive."""
        every = len(self.conditions()) * self.repeats
        return every if self.attempts is None else min(every, self.attempts)

    def slots(self) -> list[Slot]:
        """All attempts in flying order, each condition `repeats` times; none where that is adaptive."""
        if self.order == ADAPTIVE:
            return []
        conditions = [
            (*condition, repeat) for repeat in range(1, self.repeats + 1) for condition in self.conditions()
        ]
        if self.order == "shuffled":
            order = np.random.default_rng(self.seed).permutation(len(conditions))
            conditions = [conditions[i] for i in order]
        return [Slot(number, *condition) for number, condition in enumerate(conditions[: self.attempts])]

    def attempt_seed(self, slot: int, try_number: int) -> int:
        """Seed of one try of one attempt."""
        return int(np.random.SeedSequence([self.seed, slot, try_number]).generate_state(1)[0])

    def fixed_part(self) -> dict[str, Any]:
        """What must not change when a campaign is resumed: everything but the URIs, the stop rules, the
        day, who flies, and what of the lab file is not the room; of policy and vehicle also what their files
        hold.
        """
        part = dataclasses.asdict(dataclasses.replace(self, lab=None))
        for key in _MAY_CHANGE:
            del part[key]
        part["policy_crc32"] = f"{policy_crc32(load_policy(find_policy(self.policy))):08x}"
        part["vehicle_sha256"] = vehicle_sha256(self.vehicle, self.legs)
        part["skipped"] = [misfit.condition for misfit in self.skipped]
        for key in [key for key in ("skipped",) if not part[key]]:
            del part[key]  # as it was written before there was such a thing
        return part


def load_plan(path: Path, lab: LabFile | None = None, drones: Sequence[str] = ()) -> CampaignPlan:
    """Read and check a campaign file; what it leaves out of drone, mocap, vehicle, legs, policy and room is
    as in the lab file. `drones` are flown instead of those that it names.

    Raises:
        LabRequired: it is to be flown on hardware, and there is no lab file.
        CampaignFileError: missing, not TOML, with an unknown key or an unusable value, or naming a policy,
            vehicle or kind of address that does not exist; with all that is wrong, a line each.
    """
    root = FileTable(path, "", read_toml(path, CampaignFileError))
    root.schema(SCHEMA)
    grid, stop = root.table("grid"), root.table("stop", required=False)
    day = root.table("day", required=False)
    setup, *others = setups_of(root, lab, drones) or [nobody(root)]
    plan = CampaignPlan(
        name=root.text("name", default=path.stem),
        drone=setup.drone,
        mocap=setup.mocap,
        policy=setup.policy,
        vehicle=setup.vehicle,
        legs=setup.legs,
        seed=root.integer("seed", default=0, minimum=0),
        order=root.choice("order", ORDERS, default="shuffled"),
        speeds=grid.numbers(
            "speeds", lambda v: 0.0 < v < SPEED_MAX, f"positive speeds below {SPEED_MAX:g} m/s", "m/s"
        ),
        angles_deg=grid.numbers(
            "angles_deg",
            lambda v: ANGLE_MIN_DEG < v <= 90.0,
            f"angles above {ANGLE_MIN_DEG:.2f} and up to 90 deg",
            "deg",
        ),
        repeats=grid.integer("repeats", default=1, minimum=1),
        room=room_of(root.table("room", required=False), setup.room),
        approach=_approach(root.table("approach", required=False)),
        aborted_in_a_row=stop.integer("aborted_in_a_row", default=3, minimum=1),
        attempts=stop.integer("attempts", default=0, minimum=0) or None,
        map_error=_map_error(root, stop),
        others=tuple(Seat(other.drone, other.mocap) for other in others),
        aborts=_aborts(stop.table("aborts", required=False)),
        lab=lab,
        file=path,
        day=Day(
            turnaround_s=day.at_least("turnaround_s", Day.turnaround_s, 0.0),
            new_pack_s=day.at_least("new_pack_s", Day.new_pack_s, 0.0),
            warm_up_s=day.at_least("warm_up_s", Day.warm_up_s, 0.0),
        ),
    )
    for table in (root, grid, stop, day):
        table.refuse_unread()
    if (every := len(plan.speeds) * len(plan.angles_deg) * plan.repeats) > MOST_ATTEMPTS:
        grid.complain("repeats", f"{every} attempts in all, more than {MOST_ATTEMPTS}: is that meant?")
    check_names(root, {"policy": lambda: encode_bundle(load_policy(find_policy(plan.policy)))})
    check_vehicle(root, setup)
    if plan.day.warm_up_s > 0.0:
        hover = partial(manoeuvre(HOVER).course, {"seconds": plan.day.warm_up_s}, plan.room)
        check_names(day, {"warm_up_s": hover})
    root.settle()
    for each in (setup, *others):
        each.check()
    return plan


def _aborts(table: FileTable) -> dict[str, int]:
    limits = {kind.value: table.integer(kind, 0, 0) for kind in AbortKind}
    table.refuse_unread()
    return {kind: limit for kind, limit in limits.items() if limit}


def _map_error(root: FileTable, stop: FileTable) -> float:
    if "map_error" in stop.content and root.content.get("order") != ADAPTIVE:
        stop.complain("map_error", f'only a campaign with order = "{ADAPTIVE}" ends by it')
    return stop.at_least("map_error", 0.0, 0.0)


def _approach(table: FileTable) -> dict[str, float]:
    values = {key: table.number(key, 0.0) for key in APPROACH_PARAMETERS if key in table.content}
    table.refuse_unread(APPROACH_PARAMETERS)
    missing = [key for key in SHAPE if key not in values]
    if 0 < len(missing) < len(SHAPE):
        table.complain(missing[0], f"missing; give all of {', '.join(SHAPE)}, or none")
    return values
