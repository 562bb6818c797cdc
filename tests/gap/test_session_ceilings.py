"""Where the ceiling was: sessions of too few contacts, frames that differ, heights that were corrected."""

import gzip
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import Flight, flight_files, open_flights
from calibration.gap.landings.outcomes import (
    LandingReport,
    PreparedLandings,
    forecast,
    landing_report,
    prepare,
    read_labels,
)
from onboard.json_file import as_json
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters
from tests.truth.landings.drone import Drone
from tests.truth.landings.judge import VEHICLE
from tests.truth.landings.outcomes import RECKONED, write_outcomes

AUTHORS = "crazyflie21-upgraded"


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> list[Flight]:
    """Twelve flights whose drone reckons its ceiling RECKONED too low."""
    folder: Path = tmp_path_factory.mktemp("day")
    write_outcomes(Drone(), 12, 7, folder / "f", folder / "answer.json")
    flights, _ = open_flights(flight_files([folder / "f"]))
    told = {"commanded_speed": 2.5, "commanded_angle_deg": 45.0}
    return [replace(flight, session="monday", **told) for flight in flights]


def report(flights: list[Flight]) -> LandingReport:
    """Flights of a lab, two draws each."""
    return _report(flights, VEHICLE, 2)


def _report(flights: list[Flight], name: str, draws: int) -> LandingReport:
    vehicle = load_vehicle(name)
    ready = prepare(flights, vehicle, np.random.default_rng(0), draws)
    labels = read_labels([flight.source for flight in flights])
    real = [labels.get(start.flight.source) for start in ready.starts]
    found = forecast(ready, physics_parameters(vehicle, RoomGeometry()))
    return landing_report(ready, found, real, [True] * len(real), vehicle, seed=0)


def in_frame(flight: Flight, up: float) -> Flight:
    """The same flight in a frame whose zero is `up` (m) lower: height and ceiling read so much more."""
    return _reckoned(replace(flight, data={**flight.data, "z": flight.data["z"] + up}), up)


def corrected(flight: Flight, by: float) -> Flight:
    """The same flight of a drone that was told a ceiling `by` (m) higher: its distance to it reads more."""
    moved = {**flight.data, "d_ceil": flight.data["d_ceil"] + by}
    assert flight.trigger is not None
    stored = {
        name: value + (by if name == "d_ceil" else 0.0) for name, value in flight.trigger.snapshot.items()
    }
    return _reckoned(replace(flight, data=moved, trigger=replace(flight.trigger, snapshot=stored)), by)


def _reckoned(flight: Flight, by: float) -> Flight:
    assert flight.ceiling_z is not None
    return replace(flight, ceiling_z=flight.ceiling_z + by)


def above(ready: PreparedLandings) -> np.ndarray:
    """How far (m) the triggers are below the ceilings."""
    return ready.ceilings - [start.state["position"][0, 2] for start in ready.starts]


def test_too_few_contacts_are_told_and_widen_nothing(day: list[Flight]) -> None:
    """Three flights of another day, whose drone reckons its ceiling 0.11 m too high."""
    monday, tuesday = day[:9], [replace(corrected(one, 0.13), session="tuesday") for one in day[9:]]
    alone, both = report(monday), report([*monday, *tuesday])
    assert both.prepared.dispersion.height == pytest.approx(alone.prepared.dispersion.height, abs=1e-12)
    assert both.launch is not None
    assert both.launch.flights == 12
    assert (both.launch.sessions, both.launch.ceiling_flights) == (1, 9)
    assert both.launch.ceiling == pytest.approx(RECKONED, abs=0.006)
    np.testing.assert_array_equal(
        both.prepared.ceilings[9:], [start.reckoned_ceiling for start in both.prepared.starts[9:]]
    )
    told = [
        sentence for sentence in both.words if sentence.startswith("ceiling of tuesday: 3 contacts, too few")
    ]
    assert len(told) == 1
    assert "as the drone reckoned, in 3 flights" in told[0]
    assert not any("too few to know it" in sentence for sentence in alone.words)
    document = as_json(both)
    assert document["unknown_ceilings"] == [{"session": "tuesday", "contacts": 3, "flights": 3}]
    assert [one["ceiling_contacts"] for one in document["flights"]] == [8] * 9 + [2] * 3


def test_a_ceiling_that_no_session_knows_is_no_number(day: list[Flight]) -> None:
    found = report([replace(one, session=f"day {index // 3}") for index, one in enumerate(day[:6])]).launch
    assert found is not None
    assert (found.ceiling, found.ceiling_spread, found.sessions, found.ceiling_flights) == (None, None, 0, 0)


@pytest.mark.parametrize("every", [2, 4])
def test_what_a_frame_calls_zero_changes_no_distance(day: list[Flight], every: int) -> None:
    """Every second or fourth flight reads 0.12 m more, height and reckoned ceiling alike."""
    moved = [in_frame(one, 0.12) if k % every == 0 else one for k, one in enumerate(day)]
    ready = report(moved).prepared
    np.testing.assert_allclose(above(ready), above(report(day).prepared), atol=1e-9)


def test_a_room_stays_where_it_is_when_its_height_is_corrected(day: list[Flight]) -> None:
    """Somebody told the drone 6 cm more after half of the flights."""
    moved = [corrected(one, 0.06) if k >= 6 else one for k, one in enumerate(day)]
    ready = report(moved).prepared
    np.testing.assert_allclose(ready.ceilings, report(day).prepared.ceilings, atol=1e-9)


def test_drones_of_two_rooms_err_on_their_own(day: list[Flight]) -> None:
    """One folder: a second room, 0.5 m higher, whose drone reckons 6 cm more than is there."""
    low, high = day[:6], [corrected(in_frame(one, 0.5), 0.06) for one in day[6:]]
    alone = np.concatenate([report(low).prepared.ceilings, report(high).prepared.ceilings])
    np.testing.assert_allclose(report([*low, *high]).prepared.ceilings, alone, atol=1e-9)


def _half(folder: Path, source: Path, files: list[Path]) -> None:
    rows = (source / "labels.csv").read_text().splitlines()
    names = {file.name for file in files[::2]}
    (folder / "labels.csv").write_text("\n".join(r for r in rows if r.split(",")[0] in {"file", *names}))
    for file in files[::2]:
        shutil.copy(file, folder)


def _raised(folder: Path, source: Path, files: list[Path]) -> None:
    shutil.copy(source / "labels.csv", folder)
    for number, file in enumerate(files):
        rows = [line.split(",") for line in gzip.decompress(file.read_bytes()).decode().splitlines()]
        column = rows[0].index("z")
        for row in rows[1:] if number % 2 else []:
            if len(row) > column and row[column] not in ("", "--"):
                row[column] = f"{float(row[column]) + 0.12:.3f}"
        text = "\n".join(",".join(row) for row in rows) + "\n"
        (folder / file.name).write_bytes(gzip.compress(text.encode(), compresslevel=1))


@pytest.mark.further
@pytest.mark.parametrize(("make", "flights", "brier"), [(_half, 12, 0.58), (_raised, 28, 0.46)])
def test_real_flights_of_few_contacts_or_two_frames_turn_no_verdict(
    shared_data: Path,
    tmp_path: Path,
    make: Callable[[Path, Path, list[Path]], None],
    flights: int,
    brier: float,
) -> None:
    """The authors' flights: half of them, with three contacts on a day; all, half in another frame."""
    source = shared_data / "habas2022" / "flights"
    make(tmp_path, source, sorted(source.glob("*.csv.gz")))
    files = [file for file in flight_files([tmp_path]) if file.name != "labels.csv"]
    found = _report(open_flights(files)[0], AUTHORS, 100)
    assert found.score is not None
    assert found.score.flights == flights
    assert found.verdict == "no_gap"
    assert found.score.brier == pytest.approx(brier, abs=0.03)
    assert found.prepared.dispersion.height < 0.03
