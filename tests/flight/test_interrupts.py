"""Signals reach the stop path while the main thread is stuck, and the supervisor by being looked at."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from perchhw.flight.interrupts import OperatorInterrupts
from perchhw.operator_signals import ending_in_order
from tests.patience import PATIENCE_S
from tests.tiers import some

STUCK = """
import ctypes, os, sys, threading, time
from perchhw.flight.interrupts import OperatorInterrupts
def stop():
    sys.stdout.write("stopped\\n"); sys.stdout.flush()
with OperatorInterrupts() as interrupts:
    interrupts.stop_by(stop)
    sys.stdout.write("ready\\n"); sys.stdout.flush()
    ctypes.CDLL(None).usleep(20_000_000)
    ctypes.CDLL(None).usleep(20_000_000)
"""


def wait_for_count(interrupts: OperatorInterrupts, count: int) -> None:
    deadline = time.monotonic() + 5.0
    while interrupts.count < count:
        assert time.monotonic() < deadline
        threading.Event().wait(0.002)


def test_the_second_signal_stops_and_the_first_does_not() -> None:
    stops: list[float] = []
    before = signal.getsignal(signal.SIGINT)
    with OperatorInterrupts() as interrupts:
        interrupts.stop_by(lambda: stops.append(time.monotonic()))
        os.kill(os.getpid(), signal.SIGINT)
        wait_for_count(interrupts, 1)
        assert stops == []
        os.kill(os.getpid(), signal.SIGTERM)
        wait_for_count(interrupts, 2)
    assert len(stops) == 1
    assert signal.getsignal(signal.SIGINT) is before
    assert signal.set_wakeup_fd(-1) == -1


def test_a_main_thread_that_is_stuck_in_a_call_does_not_keep_the_stop() -> None:
    """A handler in Python would wait until the call returns: this one is of C, and begins anew."""
    child = subprocess.Popen([sys.executable, "-c", STUCK], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    try:
        assert child.stdout.readline() == "ready\n"
        child.send_signal(signal.SIGINT)
        threading.Event().wait(0.05)
        begin = time.monotonic()
        child.send_signal(signal.SIGINT)
        assert child.stdout.readline() == "stopped\n"
        assert time.monotonic() - begin < 5.0
    finally:
        child.kill()
        child.wait()
        child.stdout.close()


@pytest.mark.parametrize(
    ("before", "counted"), [(signal.SIG_DFL, 1), (signal.SIG_IGN, 0)], ids=["terminal", "nohup"]
)
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTSTP, signal.SIGQUIT])
def test_a_terminal_that_closes_suspends_or_kills_asks_for_a_landing(
    number: signal.Signals, before: signal.Handlers, counted: int
) -> None:
    """A flight that is suspended kicks no watchdog: the drone would fall."""
    previous = signal.signal(number, before)
    try:
        with OperatorInterrupts() as interrupts:
            os.kill(os.getpid(), number)
            os.kill(os.getpid(), signal.SIGTERM)
            wait_for_count(interrupts, counted + 1)
        assert interrupts.count == counted + 1
        assert signal.getsignal(number) is before
    finally:
        signal.signal(number, previous)


def test_a_terminal_that_closes_lands_though_its_shell_says_so_too() -> None:
    stopped = threading.Event()
    with OperatorInterrupts() as interrupts:
        interrupts.stop_by(stopped.set)
        os.kill(os.getpid(), signal.SIGHUP)
        wait_for_count(interrupts, 1)
        os.kill(os.getpid(), signal.SIGHUP)
        os.kill(os.getpid(), signal.SIGUSR1)  # is heard after it, and counts as little
        os.kill(os.getpid(), signal.SIGTERM)
        wait_for_count(interrupts, 2)
    assert stopped.is_set()
    assert interrupts.count == 2


@pytest.mark.parametrize("number", some([signal.SIGTERM, signal.SIGUSR1, signal.SIGUSR2], 3))
def test_before_a_flight_the_same_signals_end_the_command(number: signal.Signals, tmp_path: Path) -> None:
    """Here while it waits for the answer of a drone that is to be rebooted."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
        drone.bind(("127.0.0.1", 0))
        drone.settimeout(PATIENCE_S)
        where = f"udp://127.0.0.1:{drone.getsockname()[1]}?connect_s={PATIENCE_S}"
        fly = ["fly", "--drone", where, "--mocap", "vicon://127.0.0.1:1?subject=cf1", "--put-back", "--yes"]
        there = ["--speed", "2.5", "--angle", "50", "--out", str(tmp_path)]
        process = subprocess.Popen(
            [sys.executable, "-m", "perchhw", *fly, *there], stderr=subprocess.PIPE, text=True
        )
        try:
            drone.recv(64)
            process.send_signal(number)
            errors = process.communicate()[1]
        finally:
            process.kill()
    assert process.returncode == 130, errors
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP])
def test_who_turns_motors_ends_in_order_whatever_ends_or_suspends_it(number: signal.Signals) -> None:
    before = signal.signal(number, signal.SIG_DFL)
    try:
        with pytest.raises(KeyboardInterrupt), ending_in_order():
            signal.raise_signal(number)
        assert signal.getsignal(number) is signal.SIG_DFL
        signal.signal(number, signal.SIG_IGN)  # as with nohup
        with ending_in_order():
            signal.raise_signal(number)
    finally:
        signal.signal(number, before)
