"""The drones of a campaign: ``drone`` for one, ``[[drones]]`` or ``--drone`` for several that fly in turn."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from onboard.lab_file import LabFile, split_subject
from onboard.link.exclusive import hold
from onboard.record.run_record import RunFolderError, is_run_folder, read_info
from perchhw.campaign.file_table import FileTable, check_addresses, completed, setup_of
from perchhw.lab import FlightSetup


class Seat(NamedTuple):
    """A drone of a campaign: its address, and that of its poses."""

    drone: str
    mocap: str


def drone_names(seats: Iterable[Seat]) -> dict[str, str]:
    """What people call the drones at these addresses, where there are several; nothing for one alone.

    That is the subject of its poses, which every drone in a room has for itself; without one, its address.
    """
    named = {seat.drone: split_subject(seat.mocap)[1] or seat.drone.partition("?")[0] for seat in seats}
    if len(set(named.values())) < len(named):
        named = {drone: drone.partition("?")[0] for drone in named}
    return named if len(named) > 1 else {}


def seat_of(record: Path | None) -> Seat | None:
    """Who flew a record; None where it does not tell."""
    if record is None or not is_run_folder(record):
        return None
    try:
        config = read_info(record)["config"]
    except RunFolderError:
        return None
    drone, mocap = config.get("drone"), config.get("mocap")
    return Seat(drone, mocap) if isinstance(drone, str) and isinstance(mocap, str) else None


class _Asked(NamedTuple):
    """A drone as the file names it: its address, that of its poses (None: the lab file's), and its table."""

    drone: str
    mocap: str | None
    table: FileTable


def setups_of(root: FileTable, lab: LabFile | None, drones: Sequence[str] = ()) -> list[FlightSetup]:
    """Who flies where, for every drone in the order of their turns; each checked, none connected. `root` is
    told what the file does not say, which addresses cannot be used, and which drones are not alike; those
    that it does not say are left out.

    Args:
        root: the file.
        lab: completes what it leaves out.
        drones: addresses that are flown instead of those in the file.
    """
    policy, asked = root.optional_text("policy"), _asked(root, drones)
    if asked is None:
        return []
    if not asked:
        setups, tables = [setup_of(root, lab, policy)], [root]
    else:
        for each in asked:
            check_addresses(each.table, each.drone, each.mocap, _drone_key(each.table, root))
        setups = [_setup(root, lab, policy, each, single=len(asked) == 1) for each in asked]
        tables = [each.table for each in asked]
    said = [(setup, table) for setup, table in zip(setups, tables, strict=True) if setup is not None]
    for setup, table in said:
        _check_like(setup, said[0][0], table, _drone_key(table, root))
    return [setup for setup, _ in said]


@contextmanager
def hold_all(seats: Iterable[Seat]) -> Iterator[None]:
    """Within it no other process talks to these drones.

    Raises:
        DroneInUse: one does already.
    """
    with ExitStack() as stack:
        for seat in seats:
            stack.enter_context(hold(seat.drone))
        yield


def _drone_key(table: FileTable, root: FileTable) -> str:
    return "drone" if table is root else "uri"


def _check_like(setup: FlightSetup, first: FlightSetup, table: FileTable, drone_key: str) -> None:
    ours, theirs = ((s.vehicle, s.legs, s.policy) for s in (setup, first))
    if ours != theirs:
        difference = ", ".join(str(mine) for mine, other in zip(ours, theirs, strict=True) if mine != other)
        table.complain(
            drone_key,
            f"{setup.drone} is not like {first.drone}: {difference}; give it its own campaign",
        )


def _asked(root: FileTable, drones: Sequence[str]) -> list[_Asked] | None:
    """The drones that are named one by one; none where ``drone`` or the lab file names the only one. None
    where the file does not say it.
    """
    tables = root.tables("drones") if "drones" in root.content else []
    if tables and "drone" in root.content:
        root.complain("drones", "stands beside drone; give one of the two")
    named = [_Asked(table.text("uri"), table.optional_text("mocap"), table) for table in tables]
    for table in tables:
        table.refuse_unread()
    if not all(table.sound for table in tables):
        return None
    if drones:
        root.optional_text("drone")
        known = {each.drone: each for each in named}
        named = [known.get(uri, _Asked(uri, None, root)) for uri in drones]
    if len({each.drone for each in named}) < len(named):
        root.complain("drones", "names a drone twice")
    return named


def _setup(
    root: FileTable, lab: LabFile | None, policy: str | None, asked: _Asked, single: bool
) -> FlightSetup | None:
    shared = root.optional_text("mocap")
    if shared is not None and asked.mocap is None and not single:
        root.complain("mocap", "belongs to one drone; name each under [[drones]], or give a lab file")
        return None
    return completed(root, lab, asked.drone, asked.mocap or shared, policy)
