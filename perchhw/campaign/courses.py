"""A campaign of test flights: ``[[flight]]`` tables instead of a grid of landings.

They are kept as landings are (:mod:`perchhw.campaign.tries`); one that was aborted is flown again on resume.
"""

import json
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from onboard.lab_file import LabFile
from onboard.manoeuvres import MANOEUVRES
from onboard.outcome import Outcome
from onboard.record.folder import make_folder, new_run_folder
from onboard.room import RoomGeometry
from onboard.toml_file import read_toml
from perchhw.campaign.database import decoded, kept_in, numbers
from perchhw.campaign.file_table import (
    SCHEMA,
    CampaignFileError,
    FileTable,
    check_names,
    check_vehicle,
    nobody,
    room_of,
    setup_of,
    vehicle_sha256,
)
from perchhw.campaign.plan import MOST_ATTEMPTS
from perchhw.campaign.run import ATTEMPTS, only_one
from perchhw.campaign.tries import Try, TryStore
from perchhw.flight.course import FLOWN, CourseRequest, CourseResult, fly_course
from perchhw.flight.turnaround import Turnaround
from perchhw.lab import FlightSetup

ON_THE_MARK = "Put the drone upright on its start mark facing +x, with a charged battery"


@dataclass(frozen=True)
class PlannedFlight:
    """One test flight of a campaign: its kind and the parameters that its table gives."""

    kind: str
    parameters: dict[str, float]


@dataclass(frozen=True)
class FlightPlan:
    """A campaign of test flights as its file says.

    Attributes:
        name: used in folder names and titles.
        setup: who flies where; no flight needs its policy.
        flights: in their order.
        operator, note: who flies, and what is to be remembered of it; kept with every flight.
    """

    name: str
    setup: FlightSetup
    flights: tuple[PlannedFlight, ...]
    operator: str | None = None
    note: str | None = None

    def request(self, number: int, folder: Path) -> CourseRequest:
        """What is flown as flight `number`, from 0."""
        flight = self.flights[number]
        request = CourseRequest.of(self.setup, flight.kind, flight.parameters, folder)
        return replace(request, operator=self.operator, note=self.note)

    def fixed_part(self) -> dict[str, Any]:
        """What must not change when a campaign is resumed."""
        return {
            "name": self.name,
            "vehicle": self.setup.vehicle,
            "legs": self.setup.legs,
            "vehicle_sha256": vehicle_sha256(self.setup.vehicle, self.setup.legs),
            "room": asdict(self.setup.room),
            "flights": [asdict(flight) for flight in self.flights],
        }


@dataclass(frozen=True, kw_only=True)
class FlightRow(Try):
    """One try of one test flight: its kind and the parameters that its table gives."""

    kind: str
    parameters: dict[str, float]

    @property
    def done(self) -> bool:
        """The flight came to its end."""
        return self.state == "done" and self.outcome == FLOWN


class FlightStore(TryStore[FlightRow]):
    """The rows of one campaign of test flights."""

    PLANNED: ClassVar = {"kind": "TEXT", "parameters": "TEXT"}
    ENDS = (FLOWN,)
    WHAT = "test flights"

    @classmethod
    def create(cls, folder: Path, plan: FlightPlan) -> "FlightStore":
        """Start a campaign: all flights planned.

        Raises:
            CampaignError: the folder already holds a campaign.
        """
        slots = (
            (number, flight.kind, json.dumps(flight.parameters)) for number, flight in enumerate(plan.flights)
        )
        return cls._created(folder, plan, {}, slots)

    def last_tries(self) -> list[FlightRow]:
        """Where each flight of the campaign stands, in their order: its last try."""
        return list({row.slot: row for row in self.rows()}.values())

    def _row(self, values: sqlite3.Row) -> FlightRow:
        what = f"parameters of flight {values['slot'] + 1}"
        parameters = decoded(self.folder, values["parameters"], what, numbers)
        return FlightRow(**self._tried(values), kind=values["kind"], parameters=parameters)


Fly = Callable[[CourseRequest], CourseResult]


def has_flights(path: Path) -> bool:
    """Whether the file is a campaign of test flights.

    Raises:
        CampaignFileError: missing, or not TOML.
    """
    return "flight" in read_toml(path, CampaignFileError)


def load_flight_plan(path: Path, lab: LabFile | None = None, drones: Sequence[str] = ()) -> FlightPlan:
    """Read and check a campaign file with ``[[flight]]`` tables; every course must fit the room.

    What it leaves out of drone, mocap, vehicle, legs and room is as in the lab file. One drone of `drones`
    flies instead of the one that it names.

    Raises:
        CampaignFileError: the message names file and key.
        LabRequired: it is to be flown on hardware, and there is no lab file.
    """
    root = FileTable(path, "", read_toml(path, CampaignFileError))
    root.schema(SCHEMA)
    tables = root.tables("flight")
    if len(drones) > 1:
        root.complain("drone", f"test flights are flown by one drone, not by {' and '.join(drones)}")
    setup = setup_of(root, lab, drone=drones[0] if drones else None) or nobody(root)
    setup = replace(setup, room=room_of(root.table("room", required=False), setup.room))
    flights = tuple(flight for table in tables for flight in _flights(table, setup.room))
    name = root.text("name", default=path.stem)
    root.refuse_unread()
    check_vehicle(root, setup)
    root.settle()
    setup.check()
    return FlightPlan(name, setup, flights)


def _flights(table: FileTable, room: RoomGeometry) -> list[PlannedFlight]:
    """The flights of one table, its ``times`` many, whose course must fit the room."""
    kind = table.choice("kind", tuple(MANOEUVRES))
    times = table.integer("times", default=1, minimum=1)
    if times > MOST_ATTEMPTS:
        table.complain("times", f"{times} flights, more than {MOST_ATTEMPTS}: is that meant?")
        times = 1
    rules = MANOEUVRES[kind].rules
    parameters = {key: table.number(key, 0.0) for key in rules if key in table.content}
    if table.content.get("kind") == kind:  # else nobody knows which keys are right
        table.refuse_unread(tuple(rules))
    if table.sound:
        check_names(table, {"kind": partial(MANOEUVRES[kind].course, parameters, room)})
    return [PlannedFlight(kind, parameters)] * times


def fly_plan(
    plan: FlightPlan,
    folder: Path,
    confirm: Callable[[str], None],
    *,
    resume: bool = False,
    on_change: Callable[[list[FlightRow]], None] = lambda rows: None,
    fly: Fly = fly_course,
) -> list[FlightRow]:
    """Fly what is left of a plan, in its order; the first flight that is aborted ends it.

    Args:
        plan: the campaign.
        folder: where its database and records live.
        confirm: asks the operator to put the drone back.
        resume: continue a campaign that is there already (one that is not is started).
        on_change: called with all rows after each flight, for a display.
        fly: flies one of them.

    Raises:
        CampaignError: the folder holds a campaign and `resume` is not given, the plan is not the one that it
            was started with, or another process flies it.
        DroneStopped: somebody stopped the drone between two flights.
        PerchhwError: the drone cannot be reached.
        KeyboardInterrupt: the operator interrupted; the drone has landed.
    """
    make_folder(folder)
    with only_one(folder), closing(_store(plan, folder, resume)) as store, kept_in(folder):
        turnaround = Turnaround(plan.setup.drone, confirm, ON_THE_MARK)
        while (row := store.next_planned()) is not None:
            if any(other.record is not None for other in store.rows()):
                turnaround.put_back()
            else:
                turnaround.put_back_if_needed()
            record = new_run_folder(folder / ATTEMPTS, f"{row.slot:03d}-{row.kind}")
            with store.settled(record):
                store.start(row, record)
                result = fly(plan.request(row.slot, record))
                if result.interrupted:
                    raise KeyboardInterrupt
                outcome = FLOWN if result.aborted_by is None else Outcome.ABORTED
                store.finish(row, outcome, result.aborted_by)
            on_change(store.last_tries())
            if result.aborted_by is not None:
                break
        return store.last_tries()


def _store(plan: FlightPlan, folder: Path, resume: bool) -> FlightStore:
    if resume and FlightStore.exists(folder):
        return FlightStore.resumed(folder, plan, retry_aborted=True)
    return FlightStore.create(folder, plan)
