"""A recorded flight as a source of poses: at its own pace, torn or whole, never to fly by."""

import json
import math
from pathlib import Path

import pytest

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.errors import MocapUriError, PoseTimeout, SourceLost, SourceUnusable
from mocap_bridge.pose import PoseStream, open_pose_stream
from mocap_bridge.uri import parse_mocap_uri
from onboard.timebase import WallTime
from perchhw.cli.main import run
from perchhw.record import RunRecorder

PERIOD_S = 0.01


class MovedTime(WallTime):
    """Goes on by whatever is waited."""

    def __init__(self) -> None:
        self.now = 500.0
        super().__init__(lambda: self.now)

    def event(self):
        moved = self

        class Skip:
            def wait(self, timeout: float) -> bool:
                moved.now += timeout
                return False

        return Skip()


def frame_of(stream: PoseStream) -> int | None:
    try:
        return stream.read(1.0).frame
    except SourceLost:
        return None


def record(folder: Path, count: int = 50, occluded: int = 7) -> Path:
    with RunRecorder(folder, {}) as recorder:
        for i in range(count):
            t = 20.0 + PERIOD_S * i
            x = None if i == occluded else 0.001 * i
            recorder.write(
                "pose",
                t,
                {
                    **{"x": x, "y": 1.0, "z": 0.5, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0},
                    "frame": 100 + i,
                    "verdict": "OK",
                    "capture_time": t - 0.004,
                },
            )
            recorder.write("power", t, {"vbat": 4.0})
    return folder


def test_poses_come_at_the_pace_at_which_they_were_recorded(tmp_path: Path) -> None:
    clock = MovedTime()
    with open_pose_stream(f"file://{record(tmp_path / 'run')}", clock) as stream:
        samples = [stream.read(1.0) for _ in range(50)]
        with pytest.raises(SourceLost, match=r"has ended$"):
            stream.read(1.0)
    assert [sample.frame for sample in samples] == list(range(100, 150))
    for i, sample in enumerate(samples):
        assert sample.receipt_time == pytest.approx(500.0 + PERIOD_S * i)
        assert sample.receipt_time - sample.capture_time == pytest.approx(0.004)
        assert sample.occluded == (i == 7)
        assert sample.position == (None if i == 7 else (pytest.approx(0.001 * i), 1.0, 0.5))
    assert clock.now == pytest.approx(500.0 + PERIOD_S * 49)


def test_a_pose_that_is_not_due_is_waited_for_no_longer_than_asked(tmp_path: Path) -> None:
    clock = MovedTime()
    with open_pose_stream(f"file://{record(tmp_path / 'run')}", clock) as stream:
        stream.read(1.0)
        with pytest.raises(PoseTimeout):
            stream.read(0.004)
        assert clock.now == pytest.approx(500.004)
        assert stream.read(1.0).frame == 101


def test_a_torn_record_is_played_up_to_its_tear(tmp_path: Path) -> None:
    series = record(tmp_path / "run") / "series.mcap"
    whole = series.read_bytes()
    counts = []
    for kept in range(len(whole) // 2, len(whole) // 2 + 2000, 37):
        series.write_bytes(whole[:kept])
        with open_pose_stream(f"file://{series}", MovedTime()) as stream:
            frames = list(iter(lambda: frame_of(stream), None))
            with pytest.raises(SourceLost, match=f"has ended; .* cut off at byte {kept}"):
                stream.read(1.0)
        assert frames == list(range(100, 100 + len(frames)))
        counts.append(len(frames))
    assert counts == sorted(counts)
    assert counts[-1] > counts[0] > 20


def test_what_is_no_record_says_so(tmp_path: Path) -> None:
    with pytest.raises(MocapUriError, match="there is no"):
        open_pose_stream(f"file://{tmp_path}/nothing")
    with RunRecorder(tmp_path / "empty", {}):
        pass
    with pytest.raises(SourceUnusable, match="no poses"):
        open_pose_stream(f"file://{tmp_path}/empty")
    (tmp_path / "x.mcap").write_bytes(b"not an mcap file at all, whatever it says")
    with pytest.raises(SourceUnusable, match="is not an MCAP file"):
        open_pose_stream(f"file://{tmp_path}/x.mcap")
    series = record(tmp_path / "damaged") / "series.mcap"
    content = bytearray(series.read_bytes())
    content[len(content) // 2] ^= 1
    series.write_bytes(content)
    with pytest.raises(SourceUnusable, match=r"series\.mcap byte \d+: "):
        open_pose_stream(f"file://{series}")
    with pytest.raises(MocapUriError, match="path of a file is missing"):
        parse_mocap_uri("file://")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"schema": "perchhw.run/0"}', "older than what this perchhw reads"),
        ("{}", "is missing"),
        ("[]", "is missing"),
        ("{", "cannot be read"),
    ],
)
def test_poses_of_a_record_of_another_version_are_not_played(text: str, why: str, tmp_path: Path) -> None:
    folder = record(tmp_path / "run")
    (folder / "run.json").write_text(text)
    for place in (folder, folder / "series.mcap"):
        with pytest.raises(MocapUriError, match=why) as refused:
            open_pose_stream(f"file://{place}")
        assert str(folder / "run.json") in str(refused.value)


def test_the_address_comes_back_as_it_was(tmp_path: Path) -> None:
    uri = parse_mocap_uri("file:///my%20runs/a%3Fb?subject=cf2")
    assert (uri.path, uri.subject) == ("/my runs/a?b", "cf2")
    assert parse_mocap_uri(str(uri)) == uri
    assert parse_mocap_uri("file://runs/last").path == "runs/last"


def test_the_bridge_judges_a_recording_as_it_judges_a_room(tmp_path: Path) -> None:
    record(tmp_path / "run", count=200)
    with PoseBridge(f"file://{tmp_path / 'run'}", sink=None) as bridge:
        assert bridge.wait_for(lambda status: status.health.good > 20, 60.0)
        assert bridge.wait_for(lambda status: status.error is not None, 60.0)
        assert "ended" in (bridge.status().error or "")


def test_watch_shows_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is played in real time: how fresh its last pose is hangs on how busy this machine is."""
    record(tmp_path / "run", count=2000)
    code = run(["--json", "mocap", "watch", f"file://{tmp_path / 'run'}", "--seconds", "1"])
    seen = json.loads(capsys.readouterr().out)
    assert code == (0 if seen["ok"] else 1)
    assert (seen["connected"], seen["error"], seen["duplicates"]) == (True, None, 0)
    assert seen["frames"] > 0
    assert math.isclose(seen["last_pose"]["position"][1], 1.0)
