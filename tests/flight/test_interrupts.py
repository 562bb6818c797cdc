"""Signals reach the stop path while the main thread is stuck, and the supervisor by being looked at."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from perchhw.flight.interrupts import OperatorInterrupts

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
def test_a_terminal_that_closes_asks_for_a_landing(before: signal.Handlers, counted: int) -> None:
    previous = signal.signal(signal.SIGHUP, before)
    try:
        with OperatorInterrupts() as interrupts:
            os.kill(os.getpid(), signal.SIGHUP)
            os.kill(os.getpid(), signal.SIGTERM)
            wait_for_count(interrupts, counted + 1)
        assert interrupts.count == counted + 1
        assert signal.getsignal(signal.SIGHUP) is before
    finally:
        signal.signal(signal.SIGHUP, previous)
