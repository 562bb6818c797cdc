"""A campaign of test flights: ``[[flight]]`` tables instead of a grid of landings.

What was flown is told by the records alone: a flight is done when its record says that it came to its end.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from calibration.flights.run_folder import RunFolderError, is_run_folder, read_info
from mocap_bridge.uri import parse_mocap_uri
from onboard.lab_file import LabFile
from onboard.link import check_drone_uri
from onboard.manoeuvres import MANOEUVRES
from onboard.toml_file import read_toml
from onboard.vehicle import load_vehicle
from perchhw.campaign.file_table import SCHEMA, CampaignFileError, FileTable, check_names, room_of, setup_of
from perchhw.campaign.run import only_one
from perchhw.campaign.store import CampaignError
from perchhw.flight.course import FLOWN, CourseRequest, CourseResult, fly_course
from perchhw.flight.turnaround import Turnaround
from perchhw.lab import FlightSetup
from perchhw.record.folder import make_folder, new_run_folder, slug

ATTEMPTS = "attempts"
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


@dataclass(frozen=True)
class FlightRow:
    """Where one flight of a campaign stands.

    Attributes:
        number: its place in the file, from 0.
        kind: of the library.
        record: run folder of the flight that came to its end, else of the last try; None before the first.
        aborted_by: why the last try ended early, or None.
        diagnosis: of that record, as in its ``run.json``, or None.
    """

    number: int
    kind: str
    record: Path | None
    aborted_by: str | None
    diagnosis: dict[str, Any] | None = None

    @property
    def done(self) -> bool:
        """The flight came to its end."""
        return self.record is not None and self.aborted_by is None


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
        raise root.error("drone", f"test flights are flown by one drone, not by {' and '.join(drones)}")
    setup = setup_of(root, lab, drone=drones[0] if drones else None)
    setup = replace(setup, room=room_of(root.table("room", required=False), setup.room))
    flights = tuple(flight for table in tables for flight in _flights(table))
    plan = FlightPlan(root.text("name", default=path.stem), setup, flights)
    root.refuse_unread()
    check_names(
        root,
        {
            "drone": lambda: check_drone_uri(setup.drone),
            "mocap": lambda: parse_mocap_uri(setup.mocap),
            "vehicle": lambda: load_vehicle(setup.vehicle),
            "legs": lambda: load_vehicle(setup.vehicle, setup.legs),
        },
    )
    setup.check()
    for table in tables:
        flight = _flights(table)[0]
        check_names(table, {"kind": partial(MANOEUVRES[flight.kind].course, flight.parameters, setup.room)})
    return plan


def _flights(table: FileTable) -> list[PlannedFlight]:
    """The flights of one table: its ``times`` many."""
    kind = table.choice("kind", tuple(MANOEUVRES))
    times = table.integer("times", default=1, minimum=1)
    rules = MANOEUVRES[kind].rules
    parameters = {key: table.number(key, 0.0) for key in rules if key in table.content}
    table.refuse_unread()
    return [PlannedFlight(kind, parameters)] * times


def flight_rows(plan: FlightPlan, folder: Path) -> list[FlightRow]:
    """Where each flight of the plan stands, by the records in the campaign's folder."""
    return [_row(number, flight, folder) for number, flight in enumerate(plan.flights)]


def _row(number: int, flight: PlannedFlight, folder: Path) -> FlightRow:
    row = FlightRow(number, flight.kind, None, None)
    for record in sorted((folder / ATTEMPTS).glob(f"*-{number:03d}-{slug(flight.kind)}*")):
        if not is_run_folder(record):
            continue
        try:
            info = read_info(record)
        except RunFolderError as error:
            row = FlightRow(number, flight.kind, record, str(error))
            continue
        if info["closed"] and info.get("outcome") == FLOWN:
            return FlightRow(number, flight.kind, record, None, info.get("diagnosis"))
        ended = info.get("aborted_by") or "its process ended"
        row = FlightRow(number, flight.kind, record, ended, info.get("diagnosis"))
    return row


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
        folder: where its records live.
        confirm: asks the operator to put the drone back.
        resume: continue in a folder that holds records already.
        on_change: called with all rows after each flight, for a display.
        fly: flies one of them.

    Raises:
        CampaignError: the folder holds records and `resume` is not given, or another process flies it.
        DroneStopped: somebody stopped the drone between two flights.
        PerchhwError: the drone cannot be reached.
        KeyboardInterrupt: the operator interrupted; the drone has landed.
    """
    make_folder(folder)
    with only_one(folder):
        rows = flight_rows(plan, folder)
        if not resume and any(row.record is not None for row in rows):
            raise CampaignError(
                f"{folder} holds flights already: continue with --resume, or give another --out"
            )
        turnaround = Turnaround(plan.setup.drone, confirm, ON_THE_MARK)
        for row in rows:
            if row.done:
                continue
            if any(other.record is not None for other in flight_rows(plan, folder)):
                turnaround.put_back()
            else:
                turnaround.put_back_if_needed()
            record = new_run_folder(folder / ATTEMPTS, f"{row.number:03d}-{row.kind}")
            result = fly(plan.request(row.number, record))
            on_change(flight_rows(plan, folder))
            if result.interrupted:
                raise KeyboardInterrupt
            if result.aborted_by is not None:
                break
        return flight_rows(plan, folder)
