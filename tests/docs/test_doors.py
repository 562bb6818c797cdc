"""The pages of the doors to other people's tools: what they show is run as it stands."""

import re
from pathlib import Path

import pytest

from perchhw.cli.main import run as perchhw
from perchhw.record import RunRecorder
from tests.conftest import REPOSITORY
from tests.docs.test_documented_commands import synopses
from tests.mavlink.ground import Listener

DOCS = REPOSITORY / "docs"
ELSEWHERE = {
    "fly": "tests/mavlink/test_flight.py",
    "campaign run": "tests/mavlink/test_flight.py",
    "mocap calibrate": "tests/room_calibration",
    "mavlink serve --drone": "tests/mavlink/test_serve.py",
}
"""What on these pages needs a drone, and the tests that give it one."""
LINES = [
    line
    for name, verbs in (("mavlink.md", ""), ("mocap.md", ""), ("records.md", "log export"))
    for line in synopses(DOCS / name)
    if verbs in line and not any(line.startswith(f"perchhw {verb} ") for verb in ELSEWHERE)
]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of 2 s with poses and estimates at 100 Hz."""
    folder = tmp_path_factory.mktemp("doors") / "run"
    config = {"mocap": "vicon://127.0.0.1:801?subject=cf1", "drone": "udp://127.0.0.1:19850"}
    level = {"qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}
    with RunRecorder(folder, config) as recorder:
        for i in range(200):
            t, at = 10.0 + 0.01 * i, {"x": 1e-3 * i, "y": 2.0, "z": 0.5}
            recorder.write("pose", t, {**at, **level, "frame": i, "verdict": "OK", "capture_time": t})
            recorder.write("estimate", t, {**at, "vx": 0.1, "vy": 0.0, "vz": 0.0, "drone_time_ms": 10 * i})
            recorder.write("estimate", t, {**level, "drone_time_ms": 10 * i})
        recorder.event("phase", 12.0, phase="done", aborted_by=None)
    return folder


def test_the_lines_are_found() -> None:
    verbs = {" ".join(line.split()[1:3]) for line in LINES}
    assert verbs == {"mavlink serve", "mocap send", "log export"}
    assert all((REPOSITORY / place).exists() for place in ELSEWHERE.values())


@pytest.mark.parametrize("line", LINES)
def test_every_line(line: str, run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with Listener() as station:
        words = re.sub(r"[\[\]]", "", line).split()[1:]
        meant = {"RUN": str(run), "S": "0.4", "HZ": "50", "csv|parquet": "csv", "URI": f"file://{run}"}
        place = f"mavlink://127.0.0.1:{station.port}"
        command = [place if word.startswith("mavlink://") else meant.get(word, word) for word in words]
        assert perchhw(command) == 0, capsys.readouterr().err
        told = {message.get_type() for message in station.messages(0.2)} if "--to" in line else set()
    if "mavlink" in line:
        assert told & {"HEARTBEAT", "ODOMETRY"}


def test_watching_and_reading_poses(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = (DOCS / "mocap.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"`perchhw (mocap watch URI --seconds) 5`", page)
    (snippet,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert perchhw([*shown.replace("URI", f"file://{run}").split(), "1"]) == 0, capsys.readouterr().err
    names: dict[str, object] = {}
    exec(snippet.replace("vicon://192.168.1.10?subject=cf1", f"file://{run}"), names)
    assert names["sample"].position == (0.0, 2.0, 0.5)  # type: ignore[attr-defined]
