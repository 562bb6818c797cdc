"""The room as a process: one that does not come is killed, and nothing of it is left."""

import asyncio
import threading
from pathlib import Path

import pytest

from sim_backend import room_process
from sim_backend.room_process import RoomProcess, RoomProcessError, RoomRequest

ANY_ROOM = RoomRequest(("cf1",), vicon_port=0, vicon_udp_port=0, seed=1, faults={})


def children() -> list[str]:
    """Processes that this thread has started and that are not gone; also those that nobody has waited for."""
    return Path(f"/proc/self/task/{threading.get_native_id()}/children").read_text().split()


def test_a_room_that_does_not_come_in_time_is_gone_when_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left of a process when its loop is closed says so in a traceback."""
    monkeypatch.setattr(room_process, "START_TIMEOUT_S", 0.0)

    async def start() -> None:
        with pytest.raises(RoomProcessError, match="did not start within 0 s"):
            await RoomProcess.start(ANY_ROOM)

        assert children() == before

    before = children()
    asyncio.run(start())


def test_a_room_that_ends_at_once_says_with_which_code(capfd: pytest.CaptureFixture[str]) -> None:
    refused = RoomRequest(("cf1",), 0, 0, 1, {"no_such_fault": "1"})

    async def start() -> None:
        with pytest.raises(RoomProcessError, match="ended with code 2"):
            await RoomProcess.start(refused)

    asyncio.run(start())
    assert "no_such_fault" in capfd.readouterr().err
