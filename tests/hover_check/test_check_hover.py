"""``perchhw check hover`` at simulated drones: those that are the same, and those that are not."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from perchhw.cli.main import run
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from tests.hover_check.drones import FILE, GYRO_BIAS, LATE_POSES, WEAK_MOTOR, drone


class Mornings:
    """The command, morning after morning, with one folder of records."""

    def __init__(self, out: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.out, self._capsys = out, capsys

    def check(self, lab: SimulatedLab, *arguments: str) -> tuple[int, Any]:
        self._capsys.readouterr()
        where = ["--drone", lab.drones[0], "--mocap", lab.mocap[0], "--vehicle", FILE]
        code = run(["--json", "check", "hover", *where, "--out", str(self.out), "--yes", *arguments])
        return code, json.loads(self._capsys.readouterr().out)


def lab_of(vehicle: str, *arguments: str) -> SimulatedLab:
    """A drone whose firmware was built for the file, whatever the drone is."""
    return SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--vehicle", vehicle, "--flashed", FILE, *arguments))


@pytest.mark.soak
def test_twenty_mornings_of_drones_that_are_the_same_accuse_none_and_changed_ones_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mornings = Mornings(tmp_path / "runs", capsys)
    for seed in range(4):
        with lab_of(FILE, "--seed", str(seed)) as lab:
            for _ in range(5):
                code, found = mornings.check(lab, "--seconds", "10")
                assert (code, found["same"]) == (0, True), found
    assert found["checks_before"] == 19

    slow = {"time_constant_up": ("0.05", "0.1"), "time_constant_down": ("0.15", "0.3")}
    changed: dict[str, Callable[[], str]] = {
        "thrust": lambda: drone(tmp_path, mass=("38.1", "41.1")),
        "motor_2": lambda: drone(tmp_path, WEAK_MOTOR),
        "battery_resistance": lambda: drone(tmp_path, resistance=("0.23", "0.36")),
        "mocap_latency": lambda: drone(tmp_path, LATE_POSES),
        "motor_lag": lambda: drone(tmp_path, **slow),
        "gyro_bias_x": lambda: drone(tmp_path, GYRO_BIAS),
    }
    for what, vehicle in changed.items():
        with lab_of(vehicle()) as lab:
            code, found = mornings.check(lab, "--seconds", "10")
        assert (code, found["changed"]) == (1, [what]), found["verdict"]
    with lab_of(FILE, "--fault", "mocap_jitter_ms=20", "--fault", "mocap_drop=0.05") as lab:
        code, found = mornings.check(lab, "--seconds", "10")
    assert {"mocap_missing", "mocap_jitter"} <= set(found["changed"]), found["verdict"]
    assert all(name.startswith("mocap_") for name in found["changed"]), found["verdict"]
    with lab_of(drone(tmp_path, resistance=("0.23", "0.46"))) as lab:
        code, found = mornings.check(lab, "--seconds", "10")
    assert (code, found["aborted_by"].split(":")[0]) == (3, "battery_in_flight")
    (battery,) = found["lines"]
    assert (battery["what"], battery["verdict"]) == ("battery_resistance", "changed")
    assert abs(battery["measured"]["value"] - 0.46) < battery["measured"]["u95"]
