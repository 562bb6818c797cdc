"""The demo: what it expects of its landings, and what it says of those that it flew."""

import csv
import dataclasses
import json
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import Effect, load_vehicle, vehicle_to_toml
from perchhw import lab_process
from perchhw.attempt import DEFAULT_VEHICLE, AttemptRequest, Outcome
from perchhw.campaign import AttemptRow
from perchhw.cli import exit_codes
from perchhw.cli.demo import ANGLES_DEG, FOUR_LEGS, PREDICTIONS, SPEEDS, demo_plan, exit_code, predicted_rates
from perchhw.cli.main import run
from perchhw.flight.mission import plan_attempt
from perchhw.lab_process import SimulatedLab
from perchhw.record import read_run
from sim_backend.engine_name import usable_engine
from tests.likely import assert_likely

CONDITIONS = set(product(SPEEDS, ANGLES_DEG))
ENGINE = usable_engine(None)


@pytest.mark.soak
def test_the_demo_flies_where_the_policy_is_predicted_to_land_best() -> None:
    """Better than any of its neighbours slower, flatter or steeper, in the mean."""
    here = np.mean(list(predicted_rates(CONDITIONS, 0, ENGINE).values()))
    assert here > 0.7
    for slower, steeper in ((0.5, 0.0), (0.0, 5.0), (0.5, 5.0), (0.0, -5.0)):
        moved = {(round(speed - slower, 2), angle + steeper) for speed, angle in CONDITIONS}
        assert np.mean(list(predicted_rates(moved, 0, ENGINE).values())) < here


@pytest.fixture
def few_predictions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight attempts behind a rate: what a test of something else needs."""
    monkeypatch.setattr("perchhw.cli.demo.PREDICTIONS", 8)


@pytest.mark.usefixtures("few_predictions")
def test_predictions_are_those_of_the_seed() -> None:
    one = {(SPEEDS[0], ANGLES_DEG[0])}
    assert predicted_rates(one, 4, ENGINE) == predicted_rates(one, 4, ENGINE)


def test_every_condition_fits_the_room() -> None:
    plan = demo_plan("udp://127.0.0.1:1", "vicon://127.0.0.1:1?subject=cf1", 9, 1)
    for index, (speed, angle_deg) in enumerate(sorted(CONDITIONS)):
        request = AttemptRequest(
            speed=speed,
            angle_deg=angle_deg,
            index=index,
            folder=Path("never"),
            drone=plan.drone,
            mocap=plan.mocap,
            policy=plan.policy,
            vehicle=plan.vehicle,
            room=RoomGeometry(),
            seed=0,
        )
        plan_attempt(request, 0)


def check_predictions(document: dict[str, Any], attempts: int) -> list[float]:
    """Each attempt has the prediction of its condition, which is also in the file of the report."""
    rows = document["attempts"]
    assert len(rows) == attempts
    with (Path(document["run"]) / "prediction.csv").open(encoding="utf-8", newline="") as stream:
        kept = {
            (float(row["speed_m_s"]), float(row["angle_deg"])): float(row["four_leg_rate"])
            for row in csv.DictReader(stream)
        }
    for row in rows:
        assert (row["speed"], row["angle_deg"]) in CONDITIONS
        assert row["p_four"] == pytest.approx(kept[row["speed"], row["angle_deg"]])
    return [row["p_four"] for row in rows]


def demo_as_typed(attempts: int, out: Path) -> dict[str, Any]:
    """The document of the command, which has to end well."""
    command = [
        sys.executable,
        "-m",
        "perchhw",
        "--json",
        "demo",
        "--attempts",
        str(attempts),
        "--out",
        str(out),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == exit_codes.DONE, done.stderr
    document: dict[str, Any] = json.loads(done.stdout)
    return document


@pytest.mark.soak  # .ci/run flies `make demo` as it is
def test_a_user_flies_the_demo_and_is_told_what_to_expect(tmp_path: Path) -> None:
    document = demo_as_typed(1, tmp_path)
    assert min(check_predictions(document, 1)) > 0.5
    assert all(row["triggered"] for row in document["attempts"])
    assert Path(document["report"]).is_file()


@pytest.mark.soak
def test_the_demo_lands_as_often_as_it_says(tmp_path: Path) -> None:
    """By the world's own chance, at the level of :mod:`tests.likely`."""
    document = demo_as_typed(20, tmp_path)
    landed = sum(row["outcome"] in FOUR_LEGS for row in document["attempts"])
    assert_likely(landed, check_predictions(document, 20), simulated=PREDICTIONS)


def demo_in(
    lab: tuple[str, ...], out: Path, attempts: int, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> tuple[int, dict[str, Any]]:  # fmt: skip
    """The demo in a lab with further arguments: exit code and document."""

    def opened(part: str, arguments: list[str]) -> SimulatedLab:
        return SimulatedLab(part, [*arguments, *lab])

    monkeypatch.setattr(lab_process, "SimulatedLab", opened)
    code = run(["--json", "demo", "--attempts", str(attempts), "--out", str(out)])
    return code, json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("outcome", Outcome)
def test_only_what_was_not_flown_is_an_error(outcome: Outcome) -> None:
    row = AttemptRow(
        id=1,
        slot=0,
        try_number=1,
        state="done",
        triggered=True,
        trigger=None,
        aborted_by=None,
        record=None,
        started_utc=None,
        ended_utc=None,
        speed=3.3,
        angle_deg=45.0,
        repeat=0,
        outcome=Outcome.FOUR_LEG,
    )
    flown = outcome is not Outcome.ABORTED
    wanted = exit_codes.DONE if flown else exit_codes.SAFETY
    assert exit_code([row, dataclasses.replace(row, outcome=outcome), row]) == wanted


@pytest.mark.soak  # what its outcome does to the exit code is asked above
def test_landings_that_fail_are_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a world whose pads hold nothing every landing fails, and every attempt was flown."""
    vehicle = load_vehicle(DEFAULT_VEHICLE)
    none = {"speed": Quantity(5.0, "m/s", 0.0, "test"), "spread": Quantity(0.0, "m/s", 0.0, "test")}
    others = tuple(effect for effect in vehicle.effects if effect.name != "pad_capture")
    slippery = dataclasses.replace(vehicle, effects=(*others, Effect(name="pad_capture", parameters=none)))
    file = tmp_path / "slippery.toml"
    file.write_text(vehicle_to_toml(slippery), encoding="utf-8")
    lab = ("--vehicle", str(file), "--flashed", DEFAULT_VEHICLE)
    code, document = demo_in(lab, tmp_path, 1, monkeypatch, capsys)
    assert [row["outcome"] for row in document["attempts"]] == ["failure"]
    assert min(check_predictions(document, 1)) > 0.5  # the demo does not know that world
    assert code == exit_codes.DONE


@pytest.mark.further
@pytest.mark.usefixtures("few_predictions")
def test_an_attempt_that_was_not_flown_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An empty pack: the checks refuse to fly, and the record shows that it never did."""
    code, document = demo_in(("--fault", "battery_voltage=3.6"), tmp_path, 1, monkeypatch, capsys)
    [row] = document["attempts"]
    assert (row["outcome"], row["triggered"]) == ("aborted", False)
    assert check_predictions(document, 1)[0] > 0.5
    assert code == exit_codes.SAFETY
    [record] = (info.parent for info in Path(document["run"]).rglob("run.json"))
    attempt = read_run(record)
    assert "battery_at_rest" in attempt.info["aborted_by"]
    assert attempt.info["diagnosis"]["code"] == "battery_low"
    phases = [event["phase"] for event in attempt.events if event["event"] == "phase"]
    assert phases[0] == "checking"
    assert "taking off" not in phases
    assert Path(document["report"]).is_file()
