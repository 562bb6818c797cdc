import json
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from tests.patience import PATIENCE_S


@pytest.fixture(scope="module")
def lab() -> Iterator[SimulatedLab]:
    """A lab that waits for who watches."""
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP)) as served:
        yield served


def watch(*arguments: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [
        sys.executable,
        "-c",
        "from perchhw.cli.main import main; main()",
        "--json",
        "mocap",
        "watch",
        *arguments,
    ]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE_S, check=False, cwd=folder
    )


def test_a_good_source_as_one_json_document(lab: SimulatedLab):
    done = watch(lab.mocap[0], "--seconds", "1.5")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["verdict"] == "ok"
    assert result["ok"] is True
    assert result["rate_hz"] == pytest.approx(100.0, abs=2.0)
    assert result["missing_frames"] == 0
    assert result["subjects"] == ["cf1"]
    assert result["frame_period"] == pytest.approx(0.01)
    assert 0.003 < result["age_at_receipt"]["p50"] < 0.02
    assert result["last_pose"]["position"][2] == pytest.approx(0.07, abs=0.02)
    assert len(result["last_pose"]["quaternion"]) == 4


def test_the_poses_of_the_lab_file(lab: SimulatedLab) -> None:
    """Its address names the lab's clock, without which a lab in lock step stands still."""
    done = watch("--lab", str(lab.ready["lab"]), "--seconds", "0.5")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["uri"], result["verdict"], result["next"]) == (lab.mocap[0], "ok", None)


def test_an_address_without_the_labs_clock_is_told_of_it(lab: SimulatedLab) -> None:
    address = re.sub(r"&time=[^&]*", "", lab.mocap[0])
    done = watch(address, "--seconds", "0.3")
    result = json.loads(done.stdout)
    assert (done.returncode, result["frames"]) == (1, 0)
    assert "give the whole address, with time=HOST:PORT" in result["next"]


def test_nothing_to_watch(tmp_path: Path) -> None:
    done = watch("--seconds", "0.5", folder=tmp_path)
    assert done.returncode == 2
    assert "--lab: missing; give it, or what to watch instead" in done.stderr


def test_a_source_that_tells_nothing_of_time_has_no_age(lab: SimulatedLab):
    done = watch(lab.mocap[1], "--seconds", "0.5")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["age_at_receipt"] == {"p50": None, "p99": None, "max": None}
    assert result["frame_period"] is None
    assert result["rate_hz"] == pytest.approx(100.0, abs=4.0)


def test_no_source_is_exit_code_1_with_the_reason():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    done = watch(f"vicon://127.0.0.1:{port}?subject=cf1", "--seconds", "0.3")
    assert done.returncode == 1
    result = json.loads(done.stdout)
    assert result["verdict"] == "unknown"
    assert "no Vicon DataStream" in result["error"]
    assert result["last_pose"] is None


def test_a_bad_uri_is_exit_code_2():
    done = watch("vicon://host?subjct=cf1")
    assert done.returncode == 2
    assert "unknown option 'subjct'" in json.loads(done.stdout)["error"]
    assert "unknown option 'subjct'" in done.stderr


@pytest.mark.further
def test_a_person_gets_a_table(lab: SimulatedLab):
    command = [
        sys.executable,
        "-c",
        "from perchhw.cli.main import main; main()",
        "mocap",
        "watch",
        lab.mocap[0],
    ]
    done = subprocess.run(
        [*command, "--seconds", "0.5"], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "verdict" in done.stdout
    assert "cf1" in done.stdout
