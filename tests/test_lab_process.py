"""The simulated lab as a child process: it comes with its parent and goes with it."""

import json
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from perchhw.lab_process import LabNotReady, SimulatedLab
from tests.patience import PATIENCE_S, until

PORTS = ["--drone-port", "0", "--vicon-port", "0", "--vicon-udp-port", "0"]


def test_serves_while_open_and_is_gone_afterwards() -> None:
    with SimulatedLab("lab", PORTS) as lab:
        pids = list(lab.ready["processes"].values())
        assert lab.drones[0].startswith("udp://127.0.0.1:")
        assert lab.mocap[0].startswith("vicon://127.0.0.1:")
        watches = [os.pidfd_open(pid) for pid in pids]
        folder = Path(lab.ready["lab"]).parent
        assert folder.is_dir()
    assert not folder.exists(), "the temporary folder of its lab file goes with the lab"
    try:
        for watch in watches:
            assert select.select([watch], [], [], 120.0)[0], "a process of the lab outlived it"
    finally:
        for watch in watches:
            os.close(watch)


def test_a_parent_that_is_killed_takes_the_lab_along() -> None:
    code = (
        "import sys; from perchhw.lab_process import SimulatedLab\n"
        f"lab = SimulatedLab('lab', {PORTS!r}).open()\n"
        "print(*lab.ready['processes'].values(), flush=True); sys.stdin.read()"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert parent.stdout is not None
    pids = [int(word) for word in parent.stdout.readline().split()]
    assert len(pids) == 2
    watches = [os.pidfd_open(pid) for pid in pids]
    try:
        parent.send_signal(signal.SIGKILL)
        parent.communicate()
        for watch in watches:
            assert select.select([watch], [], [], 120.0)[0], "a process of the lab outlived its parent"
    finally:
        for watch in watches:
            os.close(watch)


def test_a_lab_that_cannot_start_says_why() -> None:
    with pytest.raises(LabNotReady, match="no_such_fault"):
        SimulatedLab("lab", [*PORTS, "--fault", "no_such_fault=1"]).open()


def test_a_lab_that_is_ended_does_not_wait_for_its_parent() -> None:
    command = [sys.executable, "-m", "perchhw", "sim", "drone", "--with-parent", "--drone-port", "0"]
    lab = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        assert lab.stdout is not None
        assert lab.stderr is not None
        ready = json.loads(lab.stdout.readline())
        assert "lab" not in ready, "a drone without a room has no lab file"
        lab.send_signal(signal.SIGTERM)
        assert lab.wait(timeout=PATIENCE_S) == 0  # its standard input is still open
        assert lab.stderr.read() == b""
    finally:
        lab.kill()
        lab.communicate()


def room_of(lab: int) -> int | None:
    """Process id of the mocap room that the lab has started, once it runs its own program."""
    for child in Path(f"/proc/{lab}/task/{lab}/children").read_text().split():
        if b"sim_backend.room_process" in Path(f"/proc/{child}/cmdline").read_bytes():
            return int(child)
    return None


@pytest.mark.parametrize(
    ("how", "code"),
    [
        pytest.param(signal.SIGINT, 130, marks=pytest.mark.further),
        (signal.SIGTERM, 0),
        pytest.param(signal.SIGHUP, 0, marks=pytest.mark.further),  # heard in the same place as SIGTERM
        (None, 0),
    ],
)
def test_a_lab_that_is_told_to_end_while_it_starts_ends_in_order(
    how: signal.Signals | None, code: int
) -> None:
    """On a machine that gives its room no time; or its parent is gone."""
    command = [sys.executable, "-m", "perchhw", "sim", "lab", "--with-parent", *PORTS]
    lab = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    watch = None
    try:
        until(lambda: room_of(lab.pid))
        room = room_of(lab.pid)
        assert room is not None
        watch = os.pidfd_open(room)
        os.kill(room, signal.SIGSTOP)
        if how is not None:
            lab.send_signal(how)
            assert lab.wait(timeout=PATIENCE_S) == code  # its standard input is still open
        _, errors = lab.communicate(timeout=PATIENCE_S)
        assert lab.returncode == code
        assert b"Traceback" not in errors, errors.decode()
        assert select.select([watch], [], [], PATIENCE_S)[0], "the room outlived its lab"
    finally:
        if watch is not None:
            os.close(watch)
        lab.kill()
        lab.communicate()
