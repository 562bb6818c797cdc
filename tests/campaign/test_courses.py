"""Campaigns of test flights: what their files mean, and that nothing is flown twice."""

import json
from contextlib import closing
from pathlib import Path

import pytest

from perchhw.campaign import CampaignError, CampaignFileError, CampaignStore
from perchhw.campaign.courses import FlightStore, fly_plan, has_flights, load_flight_plan
from perchhw.cli.main import run
from perchhw.flight.course import CourseRequest, CourseResult
from perchhw.record import RunRecorder

FILE = """
schema = "perchhw.campaign/1"
drone = "udp://127.0.0.1:19850"
mocap = "vicon://127.0.0.1:18801?subject=cf1"

[[flight]]
kind = "circles"
times = 2
radius = 0.5

[[flight]]
kind = "thrust_steps"
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(FILE)
    return path


def test_a_file_is_read(file: Path) -> None:
    assert has_flights(file)
    plan = load_flight_plan(file)
    assert plan.name == "small"
    assert [flight.kind for flight in plan.flights] == ["circles", "circles", "thrust_steps"]
    assert plan.flights[0].parameters == {"radius": 0.5}


def test_the_drone_that_is_asked_for_flies(file: Path) -> None:
    assert load_flight_plan(file, drones=["udp://127.0.0.1:2"]).setup.drone == "udp://127.0.0.1:2"
    with pytest.raises(CampaignFileError, match="key drone: test flights are flown by one drone"):
        load_flight_plan(file, drones=["udp://127.0.0.1:2", "udp://127.0.0.1:3"])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"circles"', '"loops"', r"key flight\[0\].kind: 'loops' is not one of thrust_steps"),
        ("radius = 0.5", "radius = 1.5", r"key flight\[0\].kind: circles: the course spans y"),
        ("radius = 0.5", "radius = 500", r"key flight\[0\].kind: circles: radius = 500 .* must be 0.2 to 20"),
        (
            "radius = 0.5",
            "diameter = 0.5",
            r"key flight\[0\].diameter: unknown; known are height, kind, radius, repeats, .*times",
        ),
        ("times = 2", "times = 0", r"key flight\[0\].times: 0 is less than 1"),
        ("times = 2", "times = 20000000000000000000", r"key flight\[0\].times: 2.* flights, more than 10000"),
        ("udp://127", "foo://127", "key drone: 'foo://127.0.0.1:19850' is not a drone address"),
        ("schema", "[grid]\nspeeds = [2.0]\n[stop]\nschema", "key schema: is missing"),
        ('drone = "udp', 'seed = 1\ndrone = "udp', "key seed: unknown"),
    ],
)
def test_errors_name_the_key(old: str, new: str, message: str, file: Path) -> None:
    file.write_text(file.read_text().replace(old, new, 1))
    with pytest.raises(CampaignFileError, match=message):
        load_flight_plan(file)


def test_of_an_unknown_kind_no_key_is_called_unknown(file: Path) -> None:
    file.write_text(file.read_text().replace('"circles"', '"loops"', 1))
    with pytest.raises(CampaignFileError) as caught:
        load_flight_plan(file)
    assert "'loops' is not one of" in str(caught.value)
    assert ": unknown;" not in str(caught.value)


class StandIn:
    """Flies nothing, but leaves the record of a flight; `fails` many of them are aborted first."""

    def __init__(self, fails: int = 0) -> None:
        self.flown: list[str] = []
        self.fails = fails

    def __call__(self, request: CourseRequest) -> CourseResult:
        self.flown.append(request.kind)
        aborted = None
        if self.fails:
            self.fails -= 1
            aborted = "battery_in_flight: 2.6 V"
        with RunRecorder(request.folder, {"flight": request.kind}) as recorder:
            recorder.close(outcome="aborted" if aborted else "flown", aborted_by=aborted)
        return CourseResult(aborted, request.folder, False)


def test_an_aborted_flight_stops_the_campaign_and_is_flown_again_on_resume(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rebooted: list[str] = []
    monkeypatch.setattr("perchhw.flight.turnaround.reboot", rebooted.append)
    monkeypatch.setattr("perchhw.flight.turnaround.ask_supervisor", lambda _drone: None)
    plan, folder, asked = load_flight_plan(file), tmp_path / "out", []
    first = StandIn(fails=1)
    rows = fly_plan(plan, folder, asked.append, fly=first)
    assert first.flown == ["circles"]
    assert [row.done for row in rows] == [False, False, False]
    assert "battery" in str(rows[0].aborted_by)
    assert (asked, rebooted) == ([], [])

    with pytest.raises(CampaignError, match="--resume"):
        fly_plan(plan, folder, asked.append, fly=first)

    second = StandIn()
    rows = fly_plan(plan, folder, asked.append, fly=second, resume=True)
    assert second.flown == ["circles", "circles", "thrust_steps"]
    assert all(row.done for row in rows)
    assert len(asked) == len(rebooted) == 3

    third = StandIn()
    assert fly_plan(plan, folder, asked.append, fly=third, resume=True) == rows
    assert third.flown == []

    changed = FILE.replace("radius = 0.5", "radius = 0.4")
    file.write_text(changed)
    with pytest.raises(CampaignError, match="changed since the start in flights"):
        fly_plan(load_flight_plan(file), folder, asked.append, fly=third, resume=True)


@pytest.fixture
def still(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody asks or reboots the drone."""
    monkeypatch.setattr("perchhw.flight.turnaround.reboot", lambda _drone: None)
    monkeypatch.setattr("perchhw.flight.turnaround.ask_supervisor", lambda _drone: None)


@pytest.mark.usefixtures("still")
def test_a_flight_whose_process_died_is_flown_again_and_one_that_had_ended_is_not(
    file: Path, tmp_path: Path
) -> None:
    plan, folder = load_flight_plan(file), tmp_path / "out"
    with closing(FlightStore.create(folder, plan)) as store:
        for number in range(2):
            row, record = store.rows()[number], folder / "attempts" / str(number)
            store.start(row, record)
            recorder = RunRecorder(record, {"flight": row.kind})
            if number == 0:
                recorder.close(outcome="flown")
    rest = StandIn()
    rows = fly_plan(plan, folder, lambda _request: None, fly=rest, resume=True)
    assert rest.flown == ["circles", "thrust_steps"]
    assert [(row.try_number, row.done) for row in rows] == [(1, True), (2, True), (1, True)]
    with closing(FlightStore.open(folder)) as store:
        assert [row.state for row in store.rows()] == ["done", "interrupted", "done", "done"]


@pytest.mark.usefixtures("still")
def test_an_interrupted_flight_is_kept_and_planned_again(file: Path, tmp_path: Path) -> None:
    plan, folder = load_flight_plan(file), tmp_path / "out"

    def interrupted(request: CourseRequest) -> CourseResult:
        result = StandIn(fails=1)(request)
        return CourseResult(result.aborted_by, result.record, True)

    with pytest.raises(KeyboardInterrupt):
        fly_plan(plan, folder, lambda _request: None, fly=interrupted)
    with closing(FlightStore.open(folder)) as store:
        assert [row.state for row in store.rows()] == ["interrupted", "planned", "planned", "planned"]


@pytest.mark.usefixtures("still")
def test_status_says_what_is_left_of_test_flights(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan, folder = load_flight_plan(file), tmp_path / "out"
    fly_plan(plan, folder, lambda _request: None, fly=StandIn(fails=1))
    assert run(["--json", "campaign", "status", str(folder)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["planned"], told["done"]) == (3, 0)
    assert [flight["kind"] for flight in told["flights"]] == ["circles", "circles", "thrust_steps"]
    assert "battery" in told["flights"][0]["aborted_by"]
    with pytest.raises(CampaignError, match="no campaign of landings"):
        CampaignStore.open(folder)


def test_all_that_is_wrong_is_told_at_once(file: Path) -> None:
    text = file.read_text().replace("udp://127", "foo://127").replace("radius = 0.5", "radius = 500")
    file.write_text(text.replace("times = 2", "times = 0"))
    with pytest.raises(CampaignFileError) as caught:
        load_flight_plan(file)
    told = [line.split(": ")[1] for line in str(caught.value).splitlines()]
    assert told == ["key drone", "key flight[0].times"]


@pytest.mark.parametrize(
    ("option", "why"),
    [
        ("--skip-unflyable", "is for campaigns with a [grid]"),
        ("--accept-mismatch", "is for campaigns with a [grid]"),
        ("--retry-aborted", "goes with --resume"),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(
    option: str, why: str, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["campaign", "run", str(file), "--yes", option]) == 2
    said = capsys.readouterr().err.replace("│", " ")
    assert f"{option} {why}" in " ".join(said.split())
