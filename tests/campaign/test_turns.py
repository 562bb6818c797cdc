"""Several drones in turn, their packs by the voltage model, their warm-ups, what the operator is asked."""

import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from perchhw.attempt import AttemptRequest, AttemptResult, Outcome
from perchhw.campaign import (
    CampaignFileError,
    CampaignPlan,
    CampaignStopped,
    CampaignStore,
    fit_grid,
    load_plan,
    run_campaign,
)
from perchhw.campaign.forecast import forecast
from perchhw.campaign.packs import PackModel
from perchhw.campaign.plan_text import plan_text
from perchhw.campaign.run import request_of
from perchhw.campaign.seats import Seat, drone_names
from perchhw.campaign.table import attempts_table
from perchhw.campaign.turns import PackUse, Turns, pack_use
from perchhw.cli.main import run
from perchhw.flight.course import CourseRequest, CourseResult
from perchhw.flight.turnaround import attempt_after_attempt
from perchhw.record import RunRecorder
from tests.campaign.stand_in import fly

HEAD, GRID = (
    'schema = "perchhw.campaign/1"\norder = "grid"\n',
    "[grid]\nspeeds = [2.0, 2.5]\nangles_deg = [40, 50]\n",
)
FIRST, SECOND = "udp://127.0.0.1:19850", "udp://127.0.0.1:19851"
DRONES = f"""
[[drones]]
uri = "{FIRST}"
mocap = "vicon://127.0.0.1:18801?subject=cf1"

[[drones]]
uri = "{SECOND}"
mocap = "vicon://127.0.0.1:18801?subject=cf2"
"""


def plan_of(folder: Path, text: str, *drones: str) -> CampaignPlan:
    file = folder / "turns.toml"
    file.write_text(HEAD + text)
    return load_plan(file, drones=drones)


class Packs:
    """Flies nothing, but records packs that fall by `fall` (V) an attempt, and that a new one is full."""

    def __init__(self, full: float, fall: float) -> None:
        self.full, self.fall = full, fall
        self.volts: dict[str, float] = {}
        self.requests: list[AttemptRequest] = []

    def __call__(self, request: AttemptRequest) -> AttemptResult:
        self.requests.append(request)
        before = self.full if request.new_pack else self.volts.get(request.drone, self.full)
        self.volts[request.drone] = after = before - self.fall
        config = {"drone": request.drone, "mocap": request.mocap}
        with RunRecorder(request.folder, config, clock=lambda: 0.0) as recorder:
            for t, volts in ((0.0, before), (4.0, before - 0.8), (9.0, after), (9.4, after)):
                recorder.write("motors", t, dict.fromkeys(("m1", "m2", "m3", "m4"), 3e4 * (t == 4.0)))
                recorder.write("power", t, {"vbat": volts})
            recorder.close(outcome=Outcome.TWO_LEG, triggered=True, trigger=None)
        return AttemptResult(Outcome.TWO_LEG, True, None, None, request.folder)


def test_drones_fly_in_turn_each_with_its_own_poses_and_pack(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, GRID + "repeats = 3\n" + DRONES)
    model = PackModel.for_plan(plan)
    flights = Packs(model.full, fall=(model.full - model.least) / 3.5)
    run_campaign(plan, tmp_path / "c", flights)
    seats = [(request.drone, request.mocap[-3:]) for request in flights.requests]
    assert seats == [(FIRST, "cf1"), (SECOND, "cf2")] * 6
    asked = [request.index for request in flights.requests if request.new_pack]
    assert asked == [8, 9]  # after four flights each
    assert "V, and an attempt needs 3.82 V" in str(flights.requests[8].new_pack)


def test_who_flew_what_is_said_by_the_names_of_the_subjects(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = plan_of(tmp_path, GRID + DRONES)
    flights = Packs(4.2, fall=0.01)

    def stopped(request: AttemptRequest) -> AttemptResult:
        if len(flights.requests) == 3:
            raise KeyboardInterrupt
        return flights(request)

    with pytest.raises(KeyboardInterrupt):
        run_campaign(plan, tmp_path / "c", stopped)
    with closing(CampaignStore.open(tmp_path / "c")) as store:
        shown = attempts_table(store.rows(), store.planned)
    (column,) = [one for one in shown.columns if one.header == "drone"]
    assert list(column.cells) == ["cf1", "cf2", "cf1", ""]
    assert run(["campaign", "status", str(tmp_path / "c"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["attempts"]
    assert [one["drone"] for one in told] == [FIRST, SECOND, FIRST, None]
    cost = forecast(plan, fit_grid(plan).approaches)
    assert f"in turn: cf1 ({FIRST}), cf2 ({SECOND})" in plan_text(plan, fit_grid(plan), cost)


def test_outcomes_are_whole_in_80_columns(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, GRID + DRONES)

    def contact(request: AttemptRequest) -> AttemptResult:
        return replace(fly(request), outcome=Outcome.FOUR_LEG_BODY_CONTACT)

    rows = run_campaign(plan, tmp_path / "c", contact)
    told = StringIO()
    Console(file=told, width=80).print(attempts_table(rows, len(rows)))
    _title, *lines = told.getvalue().splitlines()
    assert sum(f" {Outcome.FOUR_LEG_BODY_CONTACT.value} " in line for line in lines) == len(rows)
    assert max(map(len, lines)) <= 80


def test_a_drone_without_a_name_of_its_own_is_called_by_its_address() -> None:
    poses = "vicon://127.0.0.1?subject=cf1"
    assert drone_names([Seat(FIRST, poses)] * 2) == {}
    asked = [Seat(f"{FIRST}?time=127.0.0.1:9", poses), Seat(SECOND, poses)]
    assert list(drone_names(asked).values()) == [FIRST, SECOND]
    assert list(drone_names([Seat(FIRST, "mavlink://127.0.0.1"), Seat(SECOND, poses)]).values()) == [
        FIRST,
        "cf1",
    ]


def test_packs_are_remembered_over_a_stop(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, GRID + DRONES, FIRST)
    model = PackModel.for_plan(plan)
    flights = Packs(model.full, fall=(model.full - model.least) / 1.5)

    def stopped(request: AttemptRequest) -> AttemptResult:
        if len(flights.requests) == 2:
            raise KeyboardInterrupt
        return flights(request)

    with pytest.raises(KeyboardInterrupt):
        run_campaign(plan, tmp_path / "c", stopped)
    run_campaign(plan, tmp_path / "c", flights, resume=True)
    assert [bool(request.new_pack) for request in flights.requests] == [False, False, True, False]
    assert {request.drone for request in flights.requests} == {FIRST}


def test_a_pack_is_measured_at_rest_or_reckoned(tmp_path: Path) -> None:
    assert pack_use(tmp_path / "none") is None
    RunRecorder(tmp_path / "empty", {"drone": FIRST}, clock=lambda: 0.0).close()
    assert pack_use(tmp_path / "empty") is None
    with RunRecorder(tmp_path / "landed", {"drone": FIRST}, clock=lambda: 0.0) as recorder:
        for t in range(1, 11):
            recorder.write("motors", float(t), dict.fromkeys(("m1", "m2", "m3", "m4"), 3e4))
            recorder.write("power", t + 0.05, {"vbat": 3.4})
        recorder.close()
    assert pack_use(tmp_path / "landed") == PackUse(FIRST, 9.0, None)  # no reading without load

    plan = plan_of(tmp_path, GRID + DRONES)
    model, turns = PackModel.for_plan(plan), Turns(plan, [tmp_path / "landed"] * 40)
    slot = plan.slots()[0]
    asked = turns.prepared(request_of(plan, slot, tmp_path / "next", 1), slot).new_pack
    assert f"rests at {model.after(model.full, 40 * 9.0):.2f} V" in str(asked)


@pytest.mark.parametrize(
    ("text", "drones", "message"),
    [
        ('drone = "udp://127.0.0.1:1"\n' + GRID + DRONES, (), "key drones: stands beside drone"),
        (GRID + DRONES.replace(":19851", ":19850"), (), "key drones: names a drone twice"),
        (
            GRID + DRONES.replace("udp://127.0.0.1:19851", "cf2"),
            (),
            r"key drones\[1\].uri: 'cf2' is not a drone",
        ),
        (GRID + DRONES + "policy = 1\n", (), r"key drones\[1\].policy: unknown; known are mocap, uri"),
        (
            'mocap = "vicon://127.0.0.1?subject=a"\n' + GRID,
            (FIRST, SECOND),
            "key mocap: belongs to one drone",
        ),
        (GRID, (FIRST,), "key mocap: missing; give it, or a lab file"),
    ],
)
def test_drones_that_cannot_take_turns_are_refused(
    text: str, drones: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    with pytest.raises(CampaignFileError, match=message):
        plan_of(tmp_path, text, *drones)


Runner = Callable[[AttemptRequest], AttemptResult]


@pytest.fixture
def hovers(monkeypatch: pytest.MonkeyPatch) -> list[CourseRequest]:
    """The runner of campaigns without flights: hovers are noted, attempts and reboots are none."""
    flown: list[CourseRequest] = []

    def hover(request: CourseRequest, **_options: object) -> CourseResult:
        flown.append(request)
        return CourseResult("tilt: 40 deg" if len(flown) == 2 else None, request.folder, False)

    def attempt(request: AttemptRequest, **_options: object) -> AttemptResult:
        return AttemptResult(Outcome.TWO_LEG, True, None, None, request.folder)

    monkeypatch.setattr("perchhw.flight.course.fly_course", hover)
    monkeypatch.setattr("perchhw.flight.turnaround.fly_attempt", attempt)
    monkeypatch.setattr("perchhw.flight.turnaround.reboot", lambda _drone: None)
    monkeypatch.setattr("perchhw.flight.turnaround.ask_supervisor", lambda _drone: None)
    return flown


def test_a_drone_warms_up_before_its_first_attempt(hovers: list[CourseRequest], tmp_path: Path) -> None:
    plan = plan_of(tmp_path, GRID + DRONES + "\n[day]\nwarm_up_s = 20\n")
    asked: list[str] = []
    runner = attempt_after_attempt(asked.append, names=drone_names(plan.drones))
    with pytest.raises(CampaignStopped, match=r"hover was aborted by tilt: 40 deg .* continue with --resume"):
        run_campaign(plan, tmp_path / "c", runner)
    assert [(hover.drone, hover.parameters["seconds"]) for hover in hovers] == [(FIRST, 20.0), (SECOND, 20.0)]
    assert hovers[0].folder.parent == tmp_path / "c" / "warm-ups"
    assert asked == [
        "Put cf1 upright on its start mark facing +x",
        "Take cf1 out of the room, put cf2 upright on its start mark facing +x",
    ]
    rows = run_campaign(plan, tmp_path / "c", runner, resume=True)
    assert [(row.state, row.try_number) for row in rows] == [("done", 1)] * 4
    assert [hover.drone for hover in hovers[2:]] == [SECOND, FIRST]


def test_the_operator_is_told_of_a_new_pack(hovers: list[CourseRequest], tmp_path: Path) -> None:
    plan = plan_of(tmp_path, GRID + DRONES)
    asked: list[str] = []
    runner: Runner = attempt_after_attempt(asked.append)

    def low(request: AttemptRequest) -> AttemptResult:
        return runner(replace(request, drone=FIRST, new_pack="its pack rests at 3.70 V"))

    run_campaign(plan, tmp_path / "c", low)
    where = "Put the drone upright on its start mark facing +x (it may hang from the ceiling)"
    assert asked == [f"{where}, with a charged battery (its pack rests at 3.70 V)"] * 4
    assert hovers == []


def test_a_warm_up_that_does_not_fit_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(CampaignFileError, match=r"key day.warm_up_s: long_discharge: seconds = 2"):
        plan_of(tmp_path, GRID + DRONES + "\n[day]\nwarm_up_s = 2\n")
