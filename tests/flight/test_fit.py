"""Policy, vehicle, legs, room and drone belong together: refused with both sides, or accepted and kept."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from onboard.errors import InputError, PerchhwError, SafetyStop
from onboard.policy.files import find_policy, load_policy
from onboard.policy.model import Policy
from onboard.record import recorder
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle, known_leg_designs, load_vehicle
from perchhw.attempt import STORED_VEHICLE
from perchhw.cli.main import run
from perchhw.flight import check_attempt, fly_attempt
from perchhw.flight.fit import Fit, fit_of
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.learning.setup import LearningSetup, trained_on
from perchhw.record import read_run
from perchhw.record.listing import summarise_run
from perchhw.report.run_report import write_run_report
from perchhw.trained_for import TRAINED_FOR, trained_for_of
from tests.flight.unflown import REQUEST


def shipped(**provenance: Any) -> Policy:
    """The shipped policy; with a provenance of its own where one is given."""
    policy = load_policy(find_policy("default"))
    return replace(policy, provenance=provenance) if provenance else policy


def fit(vehicle: str | Vehicle, legs: str | None = None, policy: Policy | None = None, **changes: Any) -> Fit:
    known = load_vehicle(vehicle, legs) if isinstance(vehicle, str) else vehicle
    return fit_of(replace(REQUEST, **changes), policy or shipped(), known)


@pytest.mark.parametrize("vehicle", ["crazyflie21-upgraded", STORED_VEHICLE])
def test_the_shipped_policy_flies_the_vehicle_that_it_was_trained_for(vehicle: str) -> None:
    assert fit(vehicle) == Fit((), ())


@pytest.mark.parametrize("legs", sorted(set(known_leg_designs()) - {"semi-narrow-long"}))
def test_other_legs_are_named_with_both_sides_and_what_to_do(legs: str) -> None:
    (sentence,) = fit("crazyflie21-upgraded", legs).mismatches
    assert "trained for semi-narrow-long legs" in sentence
    assert f"has {legs} ones" in sentence
    assert "give --legs semi-narrow-long" in sentence


def test_a_vehicle_without_legs_and_of_another_mass_hears_both() -> None:
    bare, other = fit("crazyflie21-stock").mismatches
    assert "crazyflie21-stock has no legs" in bare
    assert "trained with a mass of 38.1 g, flown with 30 g" in other
    assert "learn all --vehicle crazyflie21-stock --legs semi-narrow-long" in other, "bare, it cannot learn"


def test_a_measured_vehicle_of_the_same_kind_is_no_other() -> None:
    vehicle = load_vehicle("crazyflie21-upgraded")
    heavier = replace(vehicle.body.mass, value=vehicle.body.mass.value + 1.2e-3, sigma=0.0)
    assert not fit(replace(vehicle, body=replace(vehicle.body, mass=heavier))).mismatches
    too_heavy = replace(heavier, value=heavier.value + 1e-3)
    assert fit(replace(vehicle, body=replace(vehicle.body, mass=too_heavy))).mismatches


def test_a_ceiling_that_is_not_there_is_a_mismatch() -> None:
    (sentence,) = fit("crazyflie21-upgraded", room=RoomGeometry(ceiling_z=2.5)).mismatches
    assert "at 2.5 m" in sentence
    assert "the simulated room's is at 2.1 m" in sentence


def test_a_policy_that_does_not_say_what_for_is_said_to_and_still_needs_legs() -> None:
    silent = fit("crazyflie21-upgraded", policy=shipped(method="by hand"))
    assert not silent.mismatches
    assert "does not say what vehicle" in silent.unknown[0]
    assert "has no legs" in fit("crazyflie21-stock", policy=shipped(method="by hand")).mismatches[0]


def test_what_a_new_policy_keeps_is_read_back_as_it_was() -> None:
    setup = LearningSetup(legs="wide-short", leg_length_m=0.06)
    trained = trained_on(setup.describe())
    assert trained is not None
    kept = json.loads(json.dumps(trained.document()))
    policy = shipped(**{TRAINED_FOR: kept})
    read = trained_for_of(policy)
    assert read is not None
    assert read.document() == trained.document()
    assert not read.other_than("p", setup.load_vehicle())
    assert read.other_than("p", load_vehicle("crazyflie21-upgraded"))


def test_an_older_policy_of_legs_of_its_own_is_held_against_these() -> None:
    older = shipped(
        sweep={"settings": {"vehicle": "crazyflie21-upgraded", "legs": None, "leg_angle_deg": 45}}
    )
    assert "custom legs" in fit("crazyflie21-upgraded", policy=older).mismatches[0]


def test_nobody_is_asked_before_it_fits(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no legs.*\n.*\n.*--accept-mismatch"):
        fly_attempt(replace(REQUEST, vehicle="crazyflie21-stock", folder=tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_nobody_is_asked_where_the_record_has_no_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "SPACE", 10**17)
    with pytest.raises(SafetyStop, match=r"disk_free: \d+ MB, need at least"):
        check_attempt(replace(REQUEST, folder=tmp_path / "not made" / "run"))


@pytest.mark.usefixtures("own_drone_files")
def test_what_was_checked_is_what_flies_whatever_becomes_of_its_file(tmp_path: Path) -> None:
    file = Path(shutil.copy(find_policy("default"), tmp_path / "mine.policy.json"))
    request = replace(REQUEST, policy=str(file), folder=tmp_path / "run")
    checked = check_attempt(request)
    file.write_text("{}")
    with pytest.raises(PerchhwError, match=r"127\.0\.0\.1:9"):  # on to the drone, that nobody serves
        fly_attempt(request, checked=checked)
    with pytest.raises(InputError, match=r"mine\.policy\.json"):
        fly_attempt(replace(request, folder=tmp_path / "again"))


def test_a_campaign_is_refused_before_its_folder_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "c.toml", tmp_path / "out"
    where = f'drone = "{REQUEST.drone}"\nmocap = "{REQUEST.mocap}"\nlegs = "wide-long"'
    file.write_text(f'schema = "perchhw.campaign/1"\n{where}\n[grid]\nspeeds = [2.5]\nangles_deg = [50.0]\n')
    assert run(["campaign", "run", str(file), "--out", str(out), "--yes"]) == 2
    assert "trained for semi-narrow-long legs" in capsys.readouterr().err
    assert not out.exists()


@pytest.fixture(scope="module")
def stock_lab() -> Any:
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--vehicle", "crazyflie21-stock")) as lab:
        yield lab


@pytest.mark.further
def test_an_accepted_mismatch_is_kept_and_a_passed_dry_run_is_no_abort(
    stock_lab: SimulatedLab, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--json", "fly", "--drone", stock_lab.drones[0], "--mocap", stock_lab.mocap[0]]
    arguments += [
        "--speed",
        "2.5",
        "--angle",
        "50",
        "--dry-run",
        "--legs",
        "wide-long",
        "--out",
        str(tmp_path),
    ]
    assert run([*arguments, "--accept-mismatch"]) == 0
    said = json.loads(capsys.readouterr().out)
    policy_to_legs, firmware_to_vehicle = said["accepted_mismatches"]
    assert "wide-long" in policy_to_legs
    assert "built for another vehicle" in firmware_to_vehicle
    record = Path(said["record"])
    assert read_run(record).info["accepted_mismatches"] == said["accepted_mismatches"]
    assert summarise_run(record).outcome == "dry_run_passed"
    assert "built for another vehicle" in write_run_report(record).read_text()


def test_a_drone_that_was_flashed_for_another_vehicle_does_not_pass_the_checks(
    stock_lab: SimulatedLab, tmp_path: Path
) -> None:
    drone, nobody = stock_lab.drones[0], stock_lab.mocap[0].replace("subject=", "subject=not-")
    request = replace(REQUEST, folder=tmp_path / "run", drone=drone, mocap=nobody)
    result = fly_attempt(request, dry_run=True)
    why = str(result.aborted_by)
    assert "built for another vehicle" in why
    assert "crazyflie21-upgraded" in why
    assert "pose: " in why, "every rule that fails is named"
