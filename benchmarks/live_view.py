"""What a live view costs a flight: how long a pose is on its way through the host, with and without one.

    python benchmarks/live_view.py [--flights 4] [--seconds 60] [--block 2.5] [--seed 0]

Hovers in one simulated lab in real time with `perchhw view --web` on the growing record. The view is
suspended and let go again in blocks of a few seconds, in pairs of random order: both halves of a pair find
the computer as busy. Of each block the first half second is left out, in which a view that was suspended
reads what it has missed. Prints one JSON document: percentiles of the time from the socket of the motion
capture to the link's return (ms) over all poses without and with a view, the difference of each, its 95 %
interval (bootstrap over pairs), and whether that of the 99th is below 0.2 ms (null: the interval holds 0.2).
The viewer serves its page; a browser on the same machine would take what it takes. Five minutes.
"""

import argparse
import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from mocap_bridge.bridge import PoseBridge
from onboard.arrays import FloatArray
from onboard.manoeuvres import HOVER
from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.flight.course import CourseRequest, fly_course
from perchhw.flight.turnaround import Turnaround
from perchhw.lab_process import FREE_PORTS, SimulatedLab
from perchhw.supervisor import FlightState, Phase

LIMIT_MS = 0.2
PERCENTILES = (50.0, 90.0, 99.0)
LEFT_OUT_S = 0.5
RESAMPLES = 4000

Pair = tuple[FloatArray, FloatArray]
"""Times of poses (ms) in a block without a view and in one with it."""


class Noted(deque[float]):
    """A bridge's times of its last poses, each of which is noted with its moment as well."""

    def __init__(self, notes: list[tuple[float, float]], maxlen: int | None) -> None:
        super().__init__(maxlen=maxlen)
        self._notes = notes

    def append(self, value: float) -> None:
        """A pose took so long, s."""
        super().append(value)
        self._notes.append((time.monotonic(), value))


@contextmanager
def noting() -> Iterator[list[tuple[float, float]]]:
    """Moments and times (s) of the poses that go through any bridge of this process."""
    notes: list[tuple[float, float]] = []
    start = PoseBridge.start

    def noted(bridge: PoseBridge) -> None:
        bridge._residences = Noted(notes, bridge._residences.maxlen)
        start(bridge)

    PoseBridge.start = noted  # type: ignore[method-assign]
    try:
        yield notes
    finally:
        PoseBridge.start = start  # type: ignore[method-assign]


@contextmanager
def view_of(folder: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """A view of the record in `folder`, the first of a group of processes."""
    command = [sys.executable, "-m", "perchhw", "view", str(folder), "--web", "--wait", "60", "--linger", "0"]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True)
    try:
        yield viewer
    finally:
        os.killpg(viewer.pid, signal.SIGCONT)
        os.killpg(viewer.pid, signal.SIGTERM)
        viewer.wait()


class Switch:
    """Suspends an open view and lets it go, block after block, while the drone is on its course."""

    def __init__(self, view: "subprocess.Popen[bytes]", block: float, rng: np.random.Generator) -> None:
        self._view, self._block, self._rng = view, block, rng
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._switch, daemon=True)
        self.pairs: list[dict[bool, tuple[float, float]]] = []

    def phase(self, state: FlightState) -> None:
        """Begin and end with the course."""
        if state.phase is Phase.TEST_FLIGHT and not self._thread.is_alive() and not self._over.is_set():
            self._thread.start()
        elif state.phase in (Phase.LANDING, Phase.DONE):
            self._over.set()

    def _switch(self) -> None:
        assert self._view.stdout is not None
        if not self._view.stdout.readline():  # its address: it is open
            raise RuntimeError("the view did not open")
        while True:
            pair: dict[bool, tuple[float, float]] = {}
            for viewed in self._rng.permutation([False, True]):
                os.killpg(self._view.pid, signal.SIGCONT if viewed else signal.SIGSTOP)
                begin = time.monotonic()
                if self._over.wait(self._block):
                    return
                pair[bool(viewed)] = (begin + LEFT_OUT_S, time.monotonic())
            self.pairs.append(pair)


def measure(flights: int, seconds: float, block: float, seed: int, folder: Path) -> list[Pair]:
    """The pairs of blocks of so many hovers of so many seconds."""
    rng, pairs = np.random.default_rng(seed), []
    with SimulatedLab("lab", (*FREE_PORTS, "--seed", "5")) as lab, noting() as notes:
        for index in range(flights):
            place = folder / f"20260101T0000{index:02d}Z-flight"
            place.mkdir()
            request = CourseRequest(
                kind=HOVER,
                parameters={"seconds": seconds},
                folder=place,
                drone=lab.drones[0],
                mocap=lab.mocap[0],
                vehicle=DEFAULT_VEHICLE,
            )
            if index:
                Turnaround(lab.drones[0], confirm=lambda _what: None).put_back()
            notes.clear()
            with view_of(place) as view:
                switch = Switch(view, block, rng)
                result = fly_course(request, on_phase=switch.phase)
            times = np.array(notes)
            taken = [{v: _within(times, *spans[v]) for v in (False, True)} for spans in switch.pairs]
            pairs += [(one[False], one[True]) for one in taken]
            sys.stderr.write(f"flight {index + 1}: {len(taken)} pairs; {result.aborted_by or 'flown'}\n")
    return pairs


def _within(times: FloatArray, begin: float, end: float) -> FloatArray:
    """Times of the poses of a block, ms."""
    return 1e3 * times[(times[:, 0] >= begin) & (times[:, 0] < end), 1]


def percentiles(pairs: list[Pair], viewed: int) -> FloatArray:
    """Of all poses of the blocks of one kind, ms."""
    return np.asarray(np.percentile(np.concatenate([pair[viewed] for pair in pairs]), PERCENTILES))


def difference(pairs: list[Pair]) -> FloatArray:
    """By which a view makes each percentile larger, ms."""
    return percentiles(pairs, 1) - percentiles(pairs, 0)


def summary(pairs: list[Pair], seed: int) -> dict[str, Any]:
    """Percentiles, differences, their intervals."""
    rng = np.random.default_rng((seed, 1))
    drawn = rng.integers(len(pairs), size=(RESAMPLES, len(pairs)))
    spread = np.array([difference([pairs[i] for i in row]) for row in drawn])
    low, high = np.percentile(spread, [2.5, 97.5], axis=0)
    below = bool(high[-1] < LIMIT_MS)
    names = [f"p{percentile:g}" for percentile in PERCENTILES]
    return {
        "pairs": len(pairs),
        "poses": [int(sum(len(pair[viewed]) for pair in pairs)) for viewed in (0, 1)],
        "without_ms": dict(zip(names, percentiles(pairs, 0).tolist(), strict=True)),
        "with_ms": dict(zip(names, percentiles(pairs, 1).tolist(), strict=True)),
        "difference_ms": dict(zip(names, difference(pairs).tolist(), strict=True)),
        "interval_ms": dict(zip(names, np.stack([low, high], axis=1).tolist(), strict=True)),
        "p99_changes_by_less_than_0.2_ms": below or (None if low[-1] < LIMIT_MS else False),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--flights", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each hover")
    parser.add_argument("--block", type=float, default=2.5, help="s with, and s without a view")
    parser.add_argument("--seed", type=int, default=0, help="of the order in each pair")
    asked = parser.parse_args()
    before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        pairs = measure(asked.flights, asked.seconds, asked.block, asked.seed, Path(folder))
    document = {
        "benchmark": "live_view",
        "machine": {"cpus": os.cpu_count(), "python": platform.python_version()},
        "load": [before, os.getloadavg()[0]],
        **summary(pairs, asked.seed),
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
