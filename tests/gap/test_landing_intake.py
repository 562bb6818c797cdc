"""What a lab's own day may hold: flights that cannot be judged say why, and do not spoil the others."""

import json
import re
import shutil
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.flights import Flight, flight_files, open_flights
from calibration.gap.landings.outcomes import (
    PreparedLandings,
    forecast,
    landing_report,
    lost_labels,
    prepare,
    read_labels,
    require_searchable,
    tables,
)
from calibration.gap.landings.outcomes.document import TooFewFlightsError
from calibration.gap.landings.outcomes.labels import LabelsFileError
from calibration.gap.landings.outcomes.search import LEAST_NAMING
from calibration.gap.landings.outcomes.vehicles import WITHOUT, bare_parameters, shapes
from onboard.json_file import as_json
from onboard.outcome import Outcome
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from perchhw.cli.main import run
from sim_backend.physics.parameters import physics_parameters
from tests.patience import PATIENCE_S, until
from tests.truth.landings.drone import Drone
from tests.truth.landings.judge import VEHICLE
from tests.truth.landings.outcomes import write_outcomes


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> list[Flight]:
    """Eight flights as a lab would log them."""
    folder: Path = tmp_path_factory.mktemp("day")
    write_outcomes(Drone(), 8, 7, folder / "f", folder / "answer.json")
    flights, _ = open_flights(flight_files([folder / "f"]))
    return flights


def prepared(flights: list[Flight]) -> PreparedLandings:
    return prepare(flights, load_vehicle(VEHICLE), np.random.default_rng(0), 2)


def changed(flight: Flight, change: Callable[[np.ndarray], np.ndarray], *channels: str) -> Flight:
    """A flight with other numbers in some channels."""
    return replace(flight, data={**flight.data, **{name: change(flight.data[name]) for name in channels}})


@pytest.mark.further
def test_a_jolt_before_the_trigger_is_no_contact(day: list[Flight]) -> None:
    """A gust in the approach: the flip, whose time begins with the trigger, would have had less than none."""
    flight = day[3]
    assert flight.trigger is not None
    before = (flight.t <= flight.trigger.t) & (flight.t > flight.trigger.t - 0.28)
    pitching = np.where(before, 1.2, flight.data["gy"])
    pitching[np.flatnonzero(before)[8]] = 8.0
    ready = prepared([changed(flight, lambda _: pitching, "gy")])
    assert ready.starts[0].contact is None
    assert ready.contact(0) is None


SCALED = {
    "deg/s": (("gx", "gy", "gz"), np.degrees(1.0)),
    "N mm": (("a_rot",), 1e3),
    "a negative a_rot and a negative gy are nose up": (("a_rot",), -1.0),
    "mm or cm": (("x", "y", "z"), 1e3),
    "d_ceil seems to be in mm": (("d_ceil",), 1e3),
    "percent": (("m1", "m2", "m3", "m4"), 1.0 / 655.35),
    "vbat in V": (("vbat",), 1e3),
}
"""What a flight is told, by channels and factor."""


@pytest.mark.parametrize("words", SCALED)
def test_numbers_in_another_unit_are_no_gap_of_the_vehicle(day: list[Flight], words: str) -> None:
    channels, factor = SCALED[words]
    flight = changed(day[0], lambda values: factor * values, *channels)
    if "d_ceil" in channels:
        assert flight.ceiling_z is not None
        flight = replace(flight, ceiling_z=flight.ceiling_z * factor)
    ready = prepared([flight])
    assert not ready.starts
    assert words in ready.unused[0].reason


def test_flights_in_si_units_are_all_taken(day: list[Flight]) -> None:
    assert prepared(day).unused == ()


def raised(flight: Flight, by: float, folder: str) -> Flight:
    """The same flight in a room that is `by` (m) higher."""
    higher = changed(flight, lambda values: values + by, "z")
    assert flight.ceiling_z is not None
    return replace(higher, ceiling_z=flight.ceiling_z + by, session=folder)


@pytest.mark.parametrize("folder", ["here", "there"])
def test_a_room_is_judged_by_its_own_contacts(day: list[Flight], folder: str) -> None:
    """Half of the flights in a room that is 0.5 m higher, in the same folder or in another."""
    low = [replace(flight, session="here") for flight in day[:4]]
    high = [raised(flight, 0.5, folder) for flight in day[4:]]
    alone = [prepared(low).ceilings, prepared(high).ceilings]
    together = prepared([*low, *high]).ceilings
    np.testing.assert_allclose(together, np.concatenate(alone), atol=1e-9)


def test_days_of_one_room_are_folders(day: list[Flight]) -> None:
    """Rooms differ by some centimetres from day to day: less than what tells two rooms apart."""
    moved = [raised(flight, 0.06, "tuesday") for flight in day[4:]]
    monday = [replace(flight, session="monday") for flight in day[:4]]
    together = prepared([*monday, *moved]).ceilings
    np.testing.assert_allclose(together[4:], prepared(moved).ceilings, atol=1e-9)
    assert {Path(flight.session) for flight in day} == {day[0].source.parent}


def without(flight: Flight, *channels: str) -> Flight:
    """The flight without some channels."""
    kept = flight.data.keys() - set(channels)
    return replace(
        flight,
        data={name: flight.data[name] for name in kept},
        valid={name: flight.valid[name] for name in kept},
    )


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        (("gx",), "lacks pose and gyro"),
        (("m1", "m2"), "lacks motor commands"),
        (("vbat",), "m1 to m4 with vbat"),
        (("a_rot",), r"lacks the flip's moment \(a_rot\)$"),
    ],
)
def test_what_a_start_lacks_is_named(day: list[Flight], channels: tuple[str, ...], words: str) -> None:
    ready = prepared([without(day[0], *channels), replace(day[1], ceiling_z=None)])
    assert not ready.starts
    assert re.search(words, ready.unused[0].reason)
    assert ready.unused[1].reason == "lacks the distance to the ceiling (d_ceil)"


def test_a_trigger_that_was_guessed_from_the_tilt_starts_no_flip(day: list[Flight], tmp_path: Path) -> None:
    """It is 0.1 s late: the simulation would flip again from 60 deg of tilt."""
    lines = [line.split(",") for line in day[0].source.read_text().splitlines()]
    column = lines[0].index("triggered")
    table = "\n".join(",".join(cell for i, cell in enumerate(line) if i != column) for line in lines)
    (tmp_path / "untold.csv").write_text(table + "\n")
    ready = prepared(open_flights([tmp_path / "untold.csv"])[0])
    assert not ready.starts
    assert "when the policy fired (triggered)" in ready.unused[0].reason


def test_a_copy_of_a_landing_does_not_count_twice(day: list[Flight]) -> None:
    copy = replace(day[2], name="again", source=Path("again.csv"), t=day[2].t + 3.0)
    assert day[2].trigger is not None
    copy = replace(copy, trigger=replace(day[2].trigger, t=day[2].trigger.t + 3.0))
    ready = prepared([*day, copy])
    assert [start.name for start in ready.starts] == [flight.name for flight in day]
    assert [(one.name, str(day[2].source) in one.reason) for one in ready.unused] == [("again", True)]


def test_labels_that_name_no_flight_are_told(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).touch()
    rows = ["a.csv,four_leg", "B.csv,two_leg", "c.csv,", *(f"{n}.csv.gz,failure" for n in range(4))]
    (tmp_path / "labels.csv").write_text("\n".join(["file,outcome", *rows]) + "\n")
    sources = [tmp_path / "a.csv", tmp_path / "b.csv"]
    assert read_labels(sources) == {tmp_path / "a.csv": Outcome.FOUR_LEG}
    (lost,) = lost_labels(sources)
    assert lost.reason == "names flights that are not beside it: B.csv, 0.csv.gz, 1.csv.gz and 2 more"


def test_a_table_of_which_no_name_fits_is_an_error_that_says_what_to_do(tmp_path: Path) -> None:
    """What the data show would take its place, and nobody would know."""
    (tmp_path / "a.csv.gz").touch()
    (tmp_path / "labels.csv").write_text("file,outcome\na.csv,four_leg\nb.csv,two_leg\n")
    with pytest.raises(LabelsFileError, match=r"a.csv, b.csv.* are called a.csv.gz: write them so"):
        read_labels([tmp_path / "a.csv.gz"])


def test_a_table_above_the_flights_is_named(tmp_path: Path) -> None:
    """Not where the flights have their own, nor where it belongs to flights that are there."""
    sources = [tmp_path / "day" / "a.csv", tmp_path / "b.csv"]
    (tmp_path / "day").mkdir()
    for file in sources:
        file.touch()
    above = tmp_path / "labels.csv"
    above.write_text("file,outcome\nb.csv,four_leg\n")
    assert read_labels(sources[:1]) == {}
    (lost,) = lost_labels(sources[:1])
    assert lost.name == str(above)
    assert lost.reason == f"is not beside the flights, and so not read: put it into {tmp_path / 'day'}"
    assert lost_labels(sources) == ()
    (tmp_path / "day" / "labels.csv").write_text("file,outcome\na.csv,four_leg\n")
    assert lost_labels(sources[:1]) == ()


def test_a_flip_that_is_far_beside_its_trigger_is_told(day: list[Flight]) -> None:
    """60 ms: the search for the clock ends before, and its ceiling would be wrong without a word."""
    flight = day[3]
    assert flight.trigger is not None
    early = replace(flight, trigger=replace(flight.trigger, t=flight.trigger.t - 0.06))
    ready = prepared([day[2], early])
    assert [flip.clock_at_bound for flip in ready.flips] == [False, True]
    parameters = physics_parameters(load_vehicle(VEHICLE), RoomGeometry())
    real = [Outcome.FOUR_LEG, Outcome.TWO_LEG]
    report = landing_report(
        ready, forecast(ready, parameters), real, [True, False], load_vehicle(VEHICLE), seed=0
    )
    *_, whose, clock, ceiling = report.words
    assert whose == "outcomes: 1 from labels.csv, 1 from the flights' own data"
    assert f"1 of 2 flights is 40 ms or more beside its trigger ({early.name})" in clock
    assert "or the flip of this vehicle file is wrong" in clock
    assert "too few to know it" in ceiling
    assert [one["real_from"] for one in as_json(report)["flights"]] == ["labels.csv", "flight"]


def test_a_flight_that_is_classified_twice_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "labels.csv").write_text("file,outcome\na.csv,four_leg\na.csv,failure\n")
    with pytest.raises(LabelsFileError, match=r"row 3 column 'file': a.csv was classified in a row above"):
        read_labels([tmp_path / "a.csv"])


def test_the_command_says_once_what_all_flights_lack(
    day: list[Flight], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for flight in day[:3]:
        rows = flight.source.read_text().splitlines()
        (tmp_path / flight.source.name).write_text("\n".join(row.rsplit(",", 1)[0] for row in rows) + "\n")
    assert run(["gap", "landings", "--data", str(tmp_path), "--vehicle", VEHICLE]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert told.count("lacks the distance to the ceiling (d_ceil)") == 1
    assert "landing-00 and 2 more" in told


def test_flights_that_nobody_classified_are_told_where_to_say_it(
    day: list[Flight], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for flight in day[:2]:
        shutil.copy(flight.source, tmp_path)
    command = ["gap", "landings", "--data", str(tmp_path), "--vehicle", VEHICLE, "--draws", "20"]
    assert run([*command, "--json"]) == 0
    said, whose, ceiling = json.loads(capsys.readouterr().out)["says"]
    assert "outcomes: 0 from labels.csv, 0 from the flights' own data, 2 unknown" in whose
    assert f"ceiling of {tmp_path}: 2 contacts, too few to know it" in ceiling
    assert "of 2 flights are classified, and a score needs 4" in said
    assert "labels.csv" in said
    assert run([*command, "--search"]) == 2
    told = capsys.readouterr().err
    assert "a name needs at least 12; add flights" in " ".join(told.split())
    assert "simulating" not in told, "it is refused before minutes of work"


def test_a_search_needs_enough_flights_of_which_the_outcome_is_known() -> None:
    """Those that nobody classified do not count."""
    few = [Outcome.FOUR_LEG, Outcome.FAILURE] * (LEAST_NAMING // 2)
    require_searchable([*few, None])
    with pytest.raises(TooFewFlightsError, match=f"{LEAST_NAMING - 1} classified flights .*add flights"):
        require_searchable([*few[1:], None, None])


@pytest.mark.further
def test_a_search_that_is_interrupted_leaves_the_forecast(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @contextmanager
    def ctrl_c_while_searching(what: str) -> Iterator[Callable[[float, float], None]]:
        if what == "searching":
            signal.raise_signal(signal.SIGINT)
        yield lambda *_: None

    monkeypatch.setattr("perchhw.cli.gap_landings.share_done", ctrl_c_while_searching)
    flown, shown = tmp_path / "f", tmp_path / "shown"
    write_outcomes(Drone(), LEAST_NAMING, 7, flown, tmp_path / "answer.json")
    command = ["--json", "gap", "landings", "--data", str(flown), "--vehicle", VEHICLE, "--draws", "20"]
    assert run([*command, "--search", "--out", str(tmp_path / "out"), "--pictures", str(shown)]) == 130
    assert {file.stem for file in shown.iterdir()} == {file.stem for file in flown.glob("*.csv")} - {"labels"}
    told = capsys.readouterr()
    said = json.loads(told.out)
    assert len(said["flights"]) == LEAST_NAMING
    assert json.loads((tmp_path / "out" / "landings.json").read_text()) == said
    assert f"drawing {tmp_path / 'out' / 'landings.html'}" in " ".join(told.err.split())
    assert "the search, which was not finished" in told.err


def test_who_interrupts_a_search_waits_for_no_landing_and_none_are_begun_afterwards(
    day: list[Flight], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first vehicle is done, the second is at the first of two flights, and more are to come."""
    ready, parameters = prepared(day[:2]), bare_parameters(load_vehicle(VEHICLE))
    land, begun = tables.land, []
    at_second, released = threading.Event(), threading.Event()

    def held_at_the_second_vehicle(*given: Any) -> int:
        begun.append(threading.current_thread())
        if len(begun) > 2:
            at_second.set()
            released.wait(PATIENCE_S)
        return int(land(*given))

    def ctrl_c(share: float) -> None:
        until(at_second.is_set)
        raise KeyboardInterrupt

    monkeypatch.setattr(tables, "WORKERS", 1)
    monkeypatch.setattr(tables, "land", held_at_the_second_vehicle)
    vehicles = [WITHOUT._replace(**shape) for shape in shapes(parameters) if "side_damping" in shape]
    try:
        with pytest.raises(KeyboardInterrupt):
            tables.tabulate(ready, parameters, vehicles, ctrl_c)
    finally:
        released.set()
    begun[-1].join(PATIENCE_S)
    assert len(begun) == 3
