import json
import re
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from mocap_bridge.uri import SCHEMES, MocapScheme
from perchhw.cli.main import run
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab


@pytest.fixture(scope="module")
def lab() -> Iterator[SimulatedLab]:
    """A lab that waits for who watches."""
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP)) as served:
        yield served


class Watched(NamedTuple):
    """What a command line ended with, and said."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def watch(capsys: pytest.CaptureFixture[str]) -> Callable[..., Watched]:
    """Runs ``perchhw --json mocap watch`` in this process, which saves its start."""

    def run_here(*arguments: str) -> Watched:
        capsys.readouterr()
        return Watched(run(["--json", "mocap", "watch", *arguments]), *capsys.readouterr())

    return run_here


def test_a_good_source_as_one_json_document(lab: SimulatedLab, watch: Callable[..., Watched]):
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


def test_the_poses_of_the_lab_file(lab: SimulatedLab, watch: Callable[..., Watched]) -> None:
    """Its address names the lab's clock, without which a lab in lock step stands still."""
    done = watch("--lab", str(lab.ready["lab"]), "--seconds", "0.5")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["uri"], result["verdict"], result["next"]) == (lab.mocap[0], "ok", None)


def test_an_address_without_the_labs_clock_is_told_of_it(
    lab: SimulatedLab, watch: Callable[..., Watched]
) -> None:
    address = re.sub(r"&time=[^&]*", "", lab.mocap[0])
    done = watch(address, "--seconds", "0.3")
    result = json.loads(done.stdout)
    assert (done.returncode, result["frames"]) == (1, 0)
    assert "give the whole address, with time=HOST:PORT" in result["next"]


def test_a_source_of_ones_own_that_breaks_is_told_and_is_no_lab(
    watch: Callable[..., Watched], monkeypatch: pytest.MonkeyPatch
) -> None:
    scheme = MocapScheme("no_such_module.open_own", 4000, "own://?subject=cf1", needs_host=False)
    monkeypatch.setitem(SCHEMES, "own", scheme)
    done = watch("own://?subject=cf1", "--seconds", "0.1")
    result = json.loads(done.stdout)
    assert (done.returncode, result["verdict"], result["next"]) == (1, "unknown", None)
    assert "the source broke, which is a bug of it: ModuleNotFoundError: " in result["error"]


def test_nothing_to_watch(
    watch: Callable[..., Watched], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = watch("--seconds", "0.5")
    assert done.returncode == 2
    assert "--lab: missing; give it, or what to watch instead" in done.stderr


def test_a_source_that_tells_nothing_of_time_has_no_age(lab: SimulatedLab, watch: Callable[..., Watched]):
    done = watch(lab.mocap[1], "--seconds", "0.5")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["age_at_receipt"] == {"p50": None, "p99": None, "max": None}
    assert result["frame_period"] is None
    assert result["rate_hz"] == pytest.approx(100.0, abs=4.0)


def test_no_source_is_exit_code_1_with_the_reason(watch: Callable[..., Watched]):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    done = watch(f"vicon://127.0.0.1:{port}?subject=cf1", "--seconds", "0.3")
    assert done.returncode == 1
    result = json.loads(done.stdout)
    assert result["verdict"] == "unknown"
    assert "no Vicon DataStream" in result["error"]
    assert result["last_pose"] is None


def test_a_bad_uri_is_exit_code_2(watch: Callable[..., Watched]):
    done = watch("vicon://host?subjct=cf1")
    assert done.returncode == 2
    assert "unknown option 'subjct'" in json.loads(done.stdout)["error"]
    assert "unknown option 'subjct'" in done.stderr


@pytest.mark.further
def test_a_person_gets_a_table(lab: SimulatedLab, capsys: pytest.CaptureFixture[str]):
    assert run(["mocap", "watch", lab.mocap[0], "--seconds", "0.5"]) == 0
    said = capsys.readouterr().out
    assert "verdict" in said
    assert "cf1" in said
