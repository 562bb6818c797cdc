"""The library motioncapture in its child: the same poses as ours, and no way to hang us."""

import contextlib
import importlib.util
import os
import sys
from pathlib import Path

import pytest

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.errors import SourceLost, SourceUnusable, UnknownSubject
from mocap_bridge.pose import open_pose_stream
from mocap_bridge.sources import motioncapture as source
from onboard.timebase import WALL
from sim_backend.room.settings import RoomFaults
from tests.mocap.moving_room import MovingRoom
from tests.patience import PATIENCE_S, until

needs_library = pytest.mark.skipif(
    importlib.util.find_spec("motioncapture") is None, reason="motioncapture is not installed"
)


def by_library(room: MovingRoom) -> str:
    return f"motioncapture+vicon://127.0.0.1:{room.vicon_port}?subject=cf1"


@needs_library
def test_it_gives_the_poses_that_our_own_client_gives() -> None:
    with MovingRoom() as room, open_pose_stream(by_library(room)) as theirs:
        with open_pose_stream(room.uri) as ours:
            own = {}
            while len(own) < 100:
                sample = ours.read(60.0)
                if sample.position is not None:
                    own[tuple(round(v, 5) for v in sample.position)] = sample
        seen = [theirs.read(60.0) for _ in range(150)]
        assert "cf1" in theirs.statistics().subjects
    matched = [
        own[key] for s in seen if s.position and (key := tuple(round(v, 5) for v in s.position)) in own
    ]
    assert len(matched) > 20
    assert all(s.capture_time == s.receipt_time for s in seen)


@needs_library
def test_an_occluded_body_is_occluded() -> None:
    faults = RoomFaults.parse({"mocap_occlude_at": "1000:1000"})
    with MovingRoom(faults=faults) as room, open_pose_stream(by_library(room)) as stream:
        room.start_time -= 1000.0  # The library's process takes its time to start.
        while not (sample := stream.read(60.0)).occluded:
            pass
    assert sample.position is None


@needs_library
def test_a_server_that_ends_leaves_no_child_behind_and_is_found_again() -> None:
    room = MovingRoom()
    with room:
        port = room.vicon_port
        bridge = PoseBridge(by_library(room), sink=None)
        bridge.start()
        assert bridge.wait_for(lambda status: status.health.good > 10, PATIENCE_S)
        until(lambda: len(child_processes()) == 1)  # none for a moment, when a busy machine lost the stream
        children, before = child_processes(), bridge.status().reconnects
    try:
        assert bridge.wait_for(lambda status: status.reconnects > before, PATIENCE_S)
        until(lambda: not children & child_processes())
        with MovingRoom(vicon_port=port):
            assert bridge.wait_for(lambda status: status.connected, PATIENCE_S)
    finally:
        bridge.stop()


def child_processes() -> set[str]:
    """Process ids of our children that run the library."""
    found = set()
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it has ended meanwhile
            parent = (process / "stat").read_text().rpartition(")")[2].split()[1]
            if parent == str(os.getpid()) and b"motioncapture_child" in (process / "cmdline").read_bytes():
                found.add(process.name)
    return found


@needs_library
def test_nobody_there_is_told_in_time_though_the_library_never_returns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(source, "OPEN_TIMEOUT_S", 1.0)
    begin = WALL()
    with pytest.raises(SourceLost, match="no frame within 1 s"):
        open_pose_stream("motioncapture+optitrack://127.0.0.1:9?subject=cf1")
    assert WALL() - begin < 30.0


@needs_library
def test_a_wrong_name_is_told_with_the_right_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "OPEN_TIMEOUT_S", 3.0)
    with MovingRoom() as room, pytest.raises(UnknownSubject, match="'cf1'"):
        open_pose_stream(by_library(room).replace("subject=cf1", "subject=cf9"))


def test_without_the_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    (tmp_path / "motioncapture.py").write_text("raise ImportError('No module named motioncapture')")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{':'.join(sys.path)}")
    with pytest.raises(SourceUnusable, match="pip install motioncapture"):
        open_pose_stream("motioncapture+vicon://127.0.0.1:9?subject=cf1")
