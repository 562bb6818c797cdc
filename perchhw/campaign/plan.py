"""The campaign file (TOML, ``schema = "perchhw.campaign/1"``): what is to be flown, in which order.

Its keys are described in ``docs/campaigns.md``; a key that is not is an error.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mocap_bridge.uri import parse_mocap_uri
from onboard.errors import InputError
from onboard.link import check_drone_uri
from onboard.policy.bundle import encode_bundle
from onboard.policy.files import find_policy, load_policy
from onboard.room import RoomGeometry
from onboard.toml_file import read_toml
from onboard.vehicle import load_vehicle
from perchhw.attempt import APPROACH_PARAMETERS, DEFAULT_POLICY, DEFAULT_VEHICLE
from perchhw.errors import FlightStackError

SCHEMA = "perchhw.campaign/1"
ORDERS = ("shuffled", "grid")


class CampaignFileError(FlightStackError, InputError):
    """A campaign file cannot be used; the message names file and key, and what would be right."""


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
        """What must not change when a campaign is resumed: everything but the URIs and the stop rule."""
        part = dataclasses.asdict(self)
        for key in ("drone", "mocap", "aborted_in_a_row"):
            del part[key]
        return part


def load_plan(path: Path) -> CampaignPlan:
    """Read and check a campaign file.

    Raises:
        CampaignFileError: missing, not TOML, with an unknown key or an unusable value, or naming a policy,
            vehicle or kind of address that does not exist.
    """
    root = _Table(path, "", read_toml(path, CampaignFileError))
    root.choice("schema", (SCHEMA,))
    grid, stop = root.table("grid"), root.table("stop", required=False)
    plan = CampaignPlan(
        name=root.text("name", default=path.stem),
        drone=root.text("drone"),
        mocap=root.text("mocap"),
        policy=root.text("policy", default=DEFAULT_POLICY),
        vehicle=root.text("vehicle", default=DEFAULT_VEHICLE),
        legs=root.text("legs", default="") or None,
        seed=root.integer("seed", default=0, minimum=0),
        order=root.choice("order", ORDERS, default="shuffled"),
        speeds=grid.numbers("speeds", lambda v: v > 0.0, "positive speeds in m/s"),
        angles_deg=grid.numbers("angles_deg", lambda v: 0.0 < v <= 90.0, "angles above 0 and up to 90 deg"),
        repeats=grid.integer("repeats", default=1, minimum=1),
        room=_room(root.table("room", required=False)),
        approach=_approach(root.table("approach", required=False)),
        aborted_in_a_row=stop.integer("aborted_in_a_row", default=3, minimum=1),
        attempts=stop.integer("attempts", default=0, minimum=0) or None,
    )
    for table in (root, grid, stop):
        table.refuse_unread()
    _check_what_is_named(plan, root)
    return plan


def _check_what_is_named(plan: CampaignPlan, root: "_Table") -> None:
    """URIs, policy and vehicle must be usable before the first attempt; nothing is connected."""
    checks: dict[str, Callable[[], object]] = {
        "drone": lambda: check_drone_uri(plan.drone),
        "mocap": lambda: parse_mocap_uri(plan.mocap),
        "policy": lambda: encode_bundle(load_policy(find_policy(plan.policy))),
        "vehicle": lambda: load_vehicle(plan.vehicle),
        "legs": lambda: load_vehicle(plan.vehicle, plan.legs),
    }
    for key, check in checks.items():
        try:
            check()
        except InputError as error:
            raise root.error(key, str(error)) from error


def _room(table: "_Table") -> RoomGeometry:
    defaults = RoomGeometry()
    values = {f.name: table.number(f.name, getattr(defaults, f.name)) for f in dataclasses.fields(defaults)}
    table.refuse_unread()
    if not (values["x_min"] < values["x_max"] and values["y_min"] < values["y_max"]):
        raise table.error("x_min", "the flight volume is empty: x_min < x_max and y_min < y_max are needed")
    if values["ceiling_z"] <= 0.0:
        raise table.error("ceiling_z", f"{values['ceiling_z']:g} is not a height above the floor")
    return RoomGeometry(**values)


def _approach(table: "_Table") -> dict[str, float]:
    values = {key: table.number(key, 0.0) for key in APPROACH_PARAMETERS if key in table.content}
    table.refuse_unread()
    return values


class _Table:
    """One table of the file while it is being read: remembers which keys were read, for unknown ones."""

    def __init__(self, path: Path, name: str, content: dict[str, Any]) -> None:
        self._path, self._name, self.content = path, name, content
        self._read: list[str] = []

    def error(self, key: str, problem: str) -> CampaignFileError:
        return CampaignFileError(f"{self._path}: key {self._full(key)}: {problem}")

    def _full(self, key: str) -> str:
        return f"{self._name}.{key}" if self._name else key

    def _get(self, key: str, kind: type | tuple[type, ...], expected: str, default: Any = None) -> Any:
        self._read.append(key)
        if key not in self.content:
            if default is None:
                raise self.error(key, f"missing; expected {expected}")
            return default
        value = self.content[key]
        if not isinstance(value, kind) or isinstance(value, bool):
            raise self.error(key, f"{value!r} is not {expected}")
        return value

    def table(self, key: str, required: bool = True) -> "_Table":
        content = self._get(key, dict, "a table", None if required else {})
        return _Table(self._path, self._full(key), content)

    def text(self, key: str, default: str | None = None) -> str:
        return str(self._get(key, str, "a text", default))

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        value = self.text(key, default)
        if value not in choices:
            raise self.error(key, f"{value!r} is not one of {', '.join(choices)}")
        return value

    def integer(self, key: str, default: int, minimum: int) -> int:
        value = self._get(key, int, "a whole number", default)
        if value < minimum:
            raise self.error(key, f"{value} is less than {minimum}")
        return int(value)

    def number(self, key: str, default: float) -> float:
        value = float(self._get(key, (int, float), "a number", default))
        if not math.isfinite(value):
            raise self.error(key, f"{value} is not finite")
        return value

    def numbers(self, key: str, fits: Callable[[float], bool], expected: str) -> tuple[float, ...]:
        """A list of numbers or a range ``"first:last:step"`` (both ends included)."""
        given = self._get(key, (list, str), f"a list or first:last:step of {expected}")
        values = self._range(key, given) if isinstance(given, str) else given
        if not values:
            raise self.error(key, f"empty; expected {expected}")
        for value in values:
            if not isinstance(value, int | float) or isinstance(value, bool) or not fits(float(value)):
                raise self.error(key, f"{value!r} is not among {expected}")
        if len(set(values)) != len(values):
            raise self.error(key, "a value stands twice; use grid.repeats for repeats")
        return tuple(sorted(float(v) for v in values))

    def _range(self, key: str, text: str) -> list[float]:
        try:
            first, last, step = (float(part) for part in text.split(":"))
        except ValueError:
            raise self.error(key, f"{text!r} is not a range first:last:step") from None
        if not (step > 0.0 and last >= first and math.isfinite(last)):
            raise self.error(key, f"{text!r} needs first <= last and a step above 0")
        count = math.floor((last - first) / step + 1e-9) + 1
        return [round(first + i * step, 9) for i in range(count)]

    def refuse_unread(self) -> None:
        unknown = [key for key in self.content if key not in self._read]
        if unknown:
            known = ", ".join(
                sorted(set(self._read) | (set(APPROACH_PARAMETERS) if self._name == "approach" else set()))
            )
            raise self.error(unknown[0], f"unknown; known are {known}")
