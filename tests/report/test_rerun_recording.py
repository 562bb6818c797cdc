"""The Rerun recording holds the flight."""

import subprocess
import sys
from pathlib import Path

from onboard.vehicle import Vehicle
from perchhw.view.rerun_recording import write_rrd


def test_what_is_in_the_file(runs: Path, vehicle: Vehicle, tmp_path: Path) -> None:
    path = write_rrd(runs / "run-0", vehicle, tmp_path / "sub" / "flight.rrd")
    command = [sys.executable, "-m", "rerun", "rrd", "print", str(path)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=250, check=True)
    text = result.stdout + result.stderr
    for entity in (
        "/world/drone",
        "/world/drone/legs",
        "/world/ceiling",
        "/world/trail",
        "/world/trigger",
        "/plots/cues/tau",
        "/plots/policy/trigger_value",
        "/plots/rates/gy",
        "/plots/battery/vbat",
        "/events",
    ):
        assert entity in text, entity
    assert path.read_bytes()[:4] == b"RRF2"
