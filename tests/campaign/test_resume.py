"""A campaign neither loses nor repeats an attempt, however its process dies."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from onboard.link.errors import DroneStopped
from onboard.policy.files import find_policy, load_policy, save_policy
from onboard.vehicle import load_vehicle, vehicle_to_toml
from perchhw.attempt import AttemptInterrupted, AttemptRequest, AttemptResult, Outcome
from perchhw.campaign import (
    AttemptRow,
    CampaignError,
    CampaignStopped,
    CampaignStore,
    load_plan,
    run_campaign,
)
from perchhw.campaign.run import only_one
from perchhw.campaign.seats import hold_all
from perchhw.cli.main import run
from perchhw.errors import FlightStackError
from perchhw.record import read_run
from perchhw.record.listing import kept_sentence
from tests.campaign.stand_in import expected_outcome, fly

STAND_IN = Path(__file__).with_name("stand_in.py")
REPOSITORY = STAND_IN.parents[2]


def rows_of(folder: Path) -> list[AttemptRow]:
    with closing(CampaignStore.open(folder)) as store:
        return store.rows()


def run_process(file: Path, folder: Path, point: str, count: int) -> int:
    command = [sys.executable, "-m", "tests.campaign.stand_in", str(file), str(folder), point, str(count)]
    return subprocess.run(command, timeout=250, cwd=REPOSITORY, check=False).returncode


@pytest.mark.parametrize(
    "kills",
    [
        # The three points once: below they come too, in another order and again.
        pytest.param([("before", 1), ("inside", 1), ("closed", 1)], marks=pytest.mark.soak),
        [("inside", 3), ("closed", 2), ("before", 2), ("inside", 1)],
        pytest.param([("closed", 8)], marks=pytest.mark.further),
    ],
)
def test_every_slot_ends_exactly_once_as_done_after_sigkill(
    campaign_file: Path, tmp_path: Path, kills: list[tuple[str, int]]
) -> None:
    folder = tmp_path / "campaign"
    inside = 0
    for point, count in kills:
        assert run_process(campaign_file, folder, point, count) == -signal.SIGKILL
        inside += point == "inside"
    assert run_process(campaign_file, folder, "never", 0) == 0

    rows = rows_of(folder)
    done = [r for r in rows if r.state == "done"]
    plan = load_plan(campaign_file)
    assert [(r.slot, r.speed, r.angle_deg, r.repeat) for r in done] == [
        (s.number, s.speed, s.angle_deg, s.repeat) for s in plan.slots()
    ]
    assert all(r.outcome is expected_outcome(r.slot) for r in done)
    # An attempt whose record was closed is not flown again; one killed inside is kept beside its repetition.
    interrupted = [r for r in rows if r.state == "interrupted"]
    assert len(interrupted) == inside
    assert {r.state for r in rows} <= {"done", "interrupted"}
    records = sorted((folder / "attempts").iterdir())
    assert records == sorted(r.record for r in rows if r.record is not None)
    for row in interrupted:
        assert row.record is not None
        assert len(read_run(row.record).series["pose"].t) == 11
        assert "was killed" in (kept_sentence(row.record) or "")


def test_status_tells_a_campaign_that_was_killed_from_one_that_runs(
    campaign_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "campaign"
    assert run_process(campaign_file, folder, "inside", 1) == -signal.SIGKILL

    def told() -> tuple[bool, bool]:
        assert run(["campaign", "status", str(folder), "--json"]) == 0
        left_alone = json.loads(capsys.readouterr().out)["left_alone"]
        assert run(["campaign", "status", str(folder)]) == 0
        return left_alone, "go on with --resume" in capsys.readouterr().out

    assert told() == (True, True)
    with only_one(folder):
        assert told() == (False, False)
    run_campaign(load_plan(campaign_file), folder, fly, resume=True)
    assert told() == (False, False)


def test_trigger_and_outcome_survive_the_way_into_the_database(campaign_file: Path, tmp_path: Path) -> None:
    rows = run_campaign(load_plan(campaign_file), tmp_path / "c", fly)
    assert rows == rows_of(tmp_path / "c")
    assert [r.state for r in rows] == ["done"] * 8
    assert all(r.trigger is not None and r.trigger["d_ceil"] == 0.45 for r in rows)
    seeds = {r.trigger["seed"] for r in rows if r.trigger is not None}
    assert len(seeds) == 8


def test_interrupt_during_an_attempt_plans_it_again(campaign_file: Path, tmp_path: Path) -> None:
    flown: list[AttemptRequest] = []

    def interrupted(request: AttemptRequest) -> AttemptResult:
        flown.append(request)
        if len(flown) == 3:
            (request.folder / "run.json").write_text("{")
            raise KeyboardInterrupt
        return fly(request)

    plan, folder = load_plan(campaign_file), tmp_path / "c"
    with pytest.raises(KeyboardInterrupt):
        run_campaign(plan, folder, interrupted)
    assert Counter(r.state for r in rows_of(folder)) == {"done": 2, "interrupted": 1, "planned": 6}
    rows = run_campaign(plan, folder, interrupted, resume=True)
    assert [r.index for r in flown] == [0, 1, 2, 2, 3, 4, 5, 6, 7]
    assert flown[3].try_number == 2
    assert flown[3].seed != flown[2].seed
    assert sum(r.state == "done" for r in rows) == 8


def test_aborted_attempts_in_a_row_stop_the_campaign(campaign_file: Path, tmp_path: Path) -> None:
    class NoLinkError(FlightStackError):
        """No drone."""

    def aborts(request: AttemptRequest) -> AttemptResult:
        if request.index in (0, 1, 3, 4):
            return AttemptResult(Outcome.ABORTED, False, None, "battery_low", request.folder)
        if request.index == 5:
            raise NoLinkError("no answer from udp://127.0.0.1:19850")
        return fly(request)

    plan, folder = load_plan(campaign_file), tmp_path / "c"
    with pytest.raises(CampaignStopped, match="3 attempts in a row were aborted, the last one by no answer"):
        run_campaign(plan, folder, aborts)
    rows = rows_of(folder)
    assert [r.state for r in rows] == ["done"] * 6 + ["planned"] * 2
    assert rows[5].aborted_by == "no answer from udp://127.0.0.1:19850"
    assert [r.state for r in run_campaign(plan, folder, aborts, resume=True)] == ["done"] * 8


def test_a_drone_that_a_person_must_look_at_is_not_flown_again_by_itself(
    campaign_file: Path, tmp_path: Path
) -> None:
    def stopped(request: AttemptRequest) -> AttemptResult:
        result = fly(request)
        return replace(result, halt="somebody stopped it") if request.index == 2 else result

    plan, folder = load_plan(campaign_file), tmp_path / "c"
    with pytest.raises(CampaignStopped, match="somebody stopped it, then continue with --resume"):
        run_campaign(plan, folder, stopped)
    assert [r.state for r in rows_of(folder)] == ["done"] * 3 + ["planned"] * 5

    def stopped_in_the_air(request: AttemptRequest) -> AttemptResult:
        result = stopped(request)
        return replace(result, outcome=Outcome.ABORTED) if result.halt is not None else result

    with pytest.raises(CampaignStopped, match=r"continue with --resume \(and --retry-aborted, to fly"):
        run_campaign(plan, tmp_path / "in-the-air", stopped_in_the_air)


def test_a_landing_that_was_labelled_counts_though_the_operator_then_interrupted(
    campaign_file: Path, tmp_path: Path
) -> None:
    def interrupted(request: AttemptRequest) -> AttemptResult:
        result = fly(request)
        if request.index == 1:
            raise AttemptInterrupted(result)
        return result

    plan, folder = load_plan(campaign_file), tmp_path / "c"
    with pytest.raises(KeyboardInterrupt):
        run_campaign(plan, folder, interrupted)
    assert [r.state for r in rows_of(folder)] == ["done"] * 2 + ["planned"] * 6
    assert rows_of(folder)[1].outcome is expected_outcome(1)


def test_a_stop_between_two_attempts_ends_the_campaign_and_costs_none(
    campaign_file: Path, tmp_path: Path
) -> None:
    def stopped(request: AttemptRequest) -> AttemptResult:
        if request.index == 2:
            raise DroneStopped("somebody stopped it")
        return fly(request)

    plan, folder = load_plan(campaign_file), tmp_path / "c"
    with pytest.raises(DroneStopped):
        run_campaign(plan, folder, stopped)
    assert [r.state for r in rows_of(folder)] == ["done"] * 2 + ["planned"] * 6
    run_campaign(plan, folder, fly, resume=True)
    assert [r.state for r in rows_of(folder)] == ["done"] * 8


def test_aborted_attempts_are_flown_again_when_asked(campaign_file: Path, tmp_path: Path) -> None:
    def aborts_first_try(request: AttemptRequest) -> AttemptResult:
        if request.index % 3 == 0 and request.try_number == 1:
            return AttemptResult(Outcome.ABORTED, False, None, "drone_state: locked", request.folder)
        return fly(request)

    plan, folder = load_plan(campaign_file), tmp_path / "c"
    run_campaign(plan, folder, aborts_first_try)
    rows = run_campaign(plan, folder, aborts_first_try, resume=True)
    assert sum(r.outcome is Outcome.ABORTED for r in rows) == 3  # by default they stay as they are
    rows = run_campaign(plan, folder, aborts_first_try, resume=True, retry_aborted=True)
    done = [r for r in rows if r.state == "done"]
    assert [r.slot for r in done] == list(range(8))
    assert all(r.outcome is expected_outcome(r.slot) for r in done)
    assert [(r.slot, r.aborted_by) for r in rows if r.state == "interrupted"] == [
        (slot, "drone_state: locked") for slot in (0, 3, 6)
    ]


def test_a_campaign_is_not_started_twice_by_accident(campaign_file: Path, tmp_path: Path) -> None:
    plan, folder = load_plan(campaign_file), tmp_path / "c"

    def second(request: AttemptRequest) -> AttemptResult:
        running = rf"already running, by process {os.getpid()} \(.*\) since .*perchhw view"
        with pytest.raises(CampaignError, match=running):
            run_campaign(plan, folder, fly, resume=True)
        return fly(request)

    run_campaign(plan, folder, second)
    with pytest.raises(CampaignError, match="continue it with --resume"):
        run_campaign(plan, folder, fly)
    campaign_file.write_text(campaign_file.read_text().replace("seed = 7", "seed = 8"))
    with pytest.raises(CampaignError, match="changed since the start in seed"):
        run_campaign(load_plan(campaign_file), folder, fly, resume=True)
    campaign_file.write_text(
        campaign_file.read_text().replace("seed = 8", "seed = 7").replace("19850", "19999")
    )
    assert len(run_campaign(load_plan(campaign_file), folder, fly, resume=True)) == 8


def test_a_campaign_goes_on_with_the_policy_that_it_began_with(campaign_file: Path, tmp_path: Path) -> None:
    """A policy that is learned anew is written to the same file."""
    policy, folder = tmp_path / "mine.policy.json", tmp_path / "c"
    first = load_policy(find_policy("default"))
    save_policy(first, policy)
    campaign_file.write_text(f'policy = "{policy}"\n{campaign_file.read_text()}')
    run_campaign(load_plan(campaign_file), folder, fly)
    save_policy(replace(first, intercept=first.intercept - 0.01), policy)
    with pytest.raises(CampaignError, match="changed since the start in policy_crc32: undo that"):
        run_campaign(load_plan(campaign_file), folder, fly, resume=True)
    with closing(sqlite3.connect(folder / "campaign.db")) as database, database:  # begun before it was kept
        (plan,) = database.execute("SELECT value FROM facts WHERE key = 'plan'").fetchone()
        older = {key: value for key, value in json.loads(plan).items() if key != "policy_crc32"}
        database.execute("UPDATE facts SET value = ? WHERE key = 'plan'", (json.dumps(older),))
    assert len(run_campaign(load_plan(campaign_file), folder, fly, resume=True)) == 8


def test_a_vehicle_file_that_was_written_anew_is_another_vehicle(campaign_file: Path, tmp_path: Path) -> None:
    file, folder = tmp_path / "mine.toml", tmp_path / "campaign"
    vehicle = load_vehicle("crazyflie21-upgraded", "semi-narrow-long")
    file.write_text(vehicle_to_toml(vehicle))
    campaign_file.write_text(f'vehicle = "{file}"\n{campaign_file.read_text()}')
    run_campaign(load_plan(campaign_file), folder, fly)
    file.write_text(vehicle_to_toml(replace(vehicle, description="as it was flown")))
    run_campaign(load_plan(campaign_file), folder, fly, resume=True)
    heavier = replace(vehicle.body.mass, value=1.1 * vehicle.body.mass.value)
    file.write_text(vehicle_to_toml(replace(vehicle, body=replace(vehicle.body, mass=heavier))))
    with pytest.raises(CampaignError, match="changed since the start in vehicle_sha256: undo that"):
        run_campaign(load_plan(campaign_file), folder, fly, resume=True)


@pytest.mark.usefixtures("own_drone_files")
def test_whoever_starts_a_campaign_that_runs_hears_of_it_and_not_of_its_drone(
    campaign_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "c"
    folder.mkdir()
    with only_one(folder), hold_all(load_plan(campaign_file).drones):
        assert run(["campaign", "run", str(campaign_file), "--resume", "--out", str(folder)]) == 2
    said = capsys.readouterr().err
    assert f"{folder}: this campaign is already running, by process {os.getpid()}" in said
