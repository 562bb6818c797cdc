"""``perchhw vehicle``: what scripts and people get from it."""

import dataclasses
import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from onboard.quantity import Quantity
from onboard.vehicle import Effect, load_vehicle, vehicle_to_toml
from onboard.vehicle.file_format import parse_vehicle
from perchhw.cli.main import run


def document(capsys: pytest.CaptureFixture[str]) -> Any:
    return json.loads(capsys.readouterr().out)


def test_list_names_everything_that_ships(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--json", "vehicle", "list"]) == 0
    result = document(capsys)
    names = [vehicle["name"] for vehicle in result["vehicles"]]
    assert {"crazyflie21-stock", "crazyflie21-upgraded", "crazyflie21plus"} <= set(names)
    assert len(result["legs"]) == 6
    assert {"wind", "ceiling_effect", "gyro_bias"} <= set(result["effects"])
    assert run(["vehicle", "list"]) == 0
    assert "semi-narrow-long" in capsys.readouterr().out


def test_show_gives_quantities_in_si(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--json", "vehicle", "show", "crazyflie21-upgraded", "--legs", "wide-long"]
    assert run(arguments) == 0
    result = document(capsys)
    assert result["legs"] == "wide-long"
    mass = result["quantities"]["body.mass"]
    assert mass["value"] == pytest.approx(0.0381)
    assert (mass["unit"], set(mass)) == ("kg", {"value", "unit", "sigma", "source"})
    assert result["quantities"]["legs.angle_deg"]["value"] == 60.0


def test_show_for_a_person_and_as_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["vehicle", "show", "crazyflie21plus"]) == 0
    assert "body.mass" in capsys.readouterr().out
    assert run(["vehicle", "show", "crazyflie21plus", "--legs", "wide-short", "--toml"]) == 0
    copy = parse_vehicle(tomllib.loads(capsys.readouterr().out), "copy")
    assert copy == load_vehicle("crazyflie21plus", legs="wide-short")


def test_check_of_a_good_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(vehicle_to_toml(load_vehicle("crazyflie21-stock")), encoding="utf-8")
    assert run(["--json", "vehicle", "check", str(path)]) == 0
    result = document(capsys)
    assert (result["usable"], result["problems"]) == (True, [])


def test_check_says_the_margins_of_the_attitude_loop(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--json", "vehicle", "check", "crazyflie21-upgraded"]) == 0
    result = document(capsys)
    margins, limits = result["attitude_margins"], result["attitude_margins"]["limits"]
    assert (limits["phase_deg"], limits["delay_s"]) == (35.0, 0.015)
    assert [row["lag_s"] for row in margins["by_lag"]] == [0.05, 0.075, 0.1, 0.125, 0.15]
    for row in [margins["own"], *margins["by_lag"]]:
        assert row["phase_deg"] >= 35.0
        assert row["delay_s"] >= 0.015
    assert result["warnings"] == []
    assert run(["vehicle", "check", "crazyflie21-upgraded"]) == 0
    assert "wanted 35 deg and 15 ms" in " ".join(capsys.readouterr().out.split())


def test_check_warns_of_motors_that_are_too_slow_for_the_law(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "slow.toml"
    vehicle = load_vehicle("crazyflie21-upgraded")
    slow = dataclasses.replace(vehicle.motors.time_constant_down, value=0.4)
    motors = dataclasses.replace(vehicle.motors, time_constant_down=slow)
    path.write_text(vehicle_to_toml(dataclasses.replace(vehicle, motors=motors)), encoding="utf-8")
    assert run(["--json", "vehicle", "check", str(path)]) == 0
    warnings = document(capsys)["warnings"]
    assert len(warnings) == 1
    assert "with the motor lag of the file" in warnings[0]
    assert run(["vehicle", "check", str(path)]) == 0
    assert "warning: the attitude loop" in " ".join(capsys.readouterr().out.split())


def test_check_takes_the_delay_of_the_file_to_every_motor_lag(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """4 ms are little for its own motors, and too much for the fastest and the slowest."""
    path = tmp_path / "late.toml"
    delay = Effect(name="command_delay", parameters={"delay": Quantity(0.004, "s", 0.0, "test case")})
    vehicle = dataclasses.replace(load_vehicle("crazyflie21-stock"), effects=(delay,))
    path.write_text(vehicle_to_toml(vehicle), encoding="utf-8")
    assert run(["--json", "vehicle", "check", str(path)]) == 0
    result = document(capsys)
    assert result["attitude_margins"]["by_lag"][0]["delay_s"] == pytest.approx(0.0137, abs=1e-4)
    fastest, slowest = result["warnings"]
    assert "a motor lag of 50 ms" in fastest
    assert "a motor lag of 150 ms" in slowest


@pytest.mark.parametrize("as_json", [True, False])
def test_check_of_a_bad_file_names_file_and_key(
    as_json: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    text = vehicle_to_toml(load_vehicle("crazyflie21-stock"))
    path.write_text(text.replace("mass =", "maas ="), encoding="utf-8")
    assert run([*(["--json"] if as_json else []), "vehicle", "check", str(path)]) == 2
    shown = capsys.readouterr().out
    if as_json:
        result = json.loads(shown)
        assert (result["usable"], len(result["problems"])) == (False, 2)
        assert all(problem.startswith(f"{path}: ") for problem in result["problems"])
    told = " ".join(shown.split())
    assert "mine.toml" in told
    assert "body.maas: unknown key" in told
    assert "body.mass: is missing" in told


@pytest.mark.parametrize(
    "arguments",
    [
        ["vehicle", "show", "no-such-vehicle"],
        ["vehicle", "show", "crazyflie21-stock", "--legs", "four"],
        ["vehicle", "check", "no/such/file.toml"],
        ["vehicle", "diff", "crazyflie21-stock"],
        ["vehicle", "fly"],
    ],
)
def test_wrong_usage_exits_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(arguments) == 2


def test_diff_says_what_changed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = vehicle_to_toml(load_vehicle("crazyflie21-stock"))
    changed = tmp_path / "measured.toml"
    changed.write_text(text.replace("mass = { value = 0.03,", "mass = { value = 0.031,"), encoding="utf-8")
    assert parse_vehicle(tomllib.loads(changed.read_text()), "measured").body.mass.value == 0.031
    assert run(["--json", "vehicle", "diff", "crazyflie21-stock", str(changed)]) == 0
    (row,) = document(capsys)["differences"]
    assert row["key"] == "body.mass"
    assert (row["first"]["value"], row["second"]["value"]) == (0.03, 0.031)
    assert run(["--json", "vehicle", "diff", "crazyflie21-stock", "crazyflie21-upgraded"]) == 0
    rows = {row["key"]: row for row in document(capsys)["differences"]}
    assert rows["legs.length"]["first"] is None
    assert run(["vehicle", "diff", "crazyflie21-stock", "crazyflie21-stock"]) == 0
    assert "no difference" in capsys.readouterr().out
