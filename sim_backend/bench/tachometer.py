"""The tachometer: a reflex sensor at a marked propeller, and the board that stamps its edges."""

import math

import numpy as np

from sim_backend.bench.board import Board
from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.line_protocol import EDGES_A_LINE, MICROS_RANGE

ASYMMETRY = 0.02
"""Error of the marks' spacing relative to their distance."""
JITTER_S = 3e-6
GLITCH_US = 200
"""The board ignores an edge so soon after another."""
FLUSH_S = 0.05
"""A line with fewer edges than it could have leaves after this time."""
OVERFLOW_EDGES = 64
"""A ring of the size of the board's is lost when it overflows."""


class OpticalSensor:
    """What the sensor sees of a turning propeller: true times of edges.

    Args:
        rng: of this sensor.
        faults: missed and doubled edges, number of blades, mains light.
    """

    def __init__(self, rng: np.random.Generator, faults: BenchFaults) -> None:
        self._rng = rng
        self._faults = faults
        marks = np.arange(faults.blades) * (2.0 * math.pi / faults.blades)
        marks[1:] += ASYMMETRY * 2.0 * math.pi / faults.blades
        self._marks = marks.tolist()
        self._angle = float(rng.uniform(0.0, 2.0 * math.pi))
        self._flicker = 0.0

    def step(self, time: float, dt: float, before: float, after: float) -> list[float]:
        """Times (s) of the edges in the `dt` (s) up to `time`, in order.

        Args:
            time: end of the step, s.
            dt: length of the step, s.
            before, after: rotor speed at both ends, rad/s.
        """
        if self._faults.flicker is not None:
            return self._mains(time, dt, self._faults.flicker)
        mean = 0.5 * (before + after)
        travel = mean * dt
        passed = []
        for mark in self._marks:
            way = (mark - self._angle) % (2.0 * math.pi)
            if way < travel:
                passed.append(time - dt + _crossing(way, before, (after - before) / dt))
        self._angle = (self._angle + travel) % (2.0 * math.pi)
        edges: list[float] = []
        for at in sorted(passed):
            edges += self._seen(at, mean)
        return sorted(edges)

    def _seen(self, at: float, speed: float) -> list[float]:
        if float(self._rng.random()) < self._faults.missed:
            return []
        stamp = at + JITTER_S * float(self._rng.standard_normal())
        if float(self._rng.random()) < self._faults.doubled:
            interval = 2.0 * math.pi / (speed * len(self._marks))
            return [stamp, stamp + float(self._rng.uniform(0.2, 0.4)) * interval]
        return [stamp]

    def _mains(self, time: float, dt: float, frequency: float) -> list[float]:
        self._flicker += frequency * dt
        if self._flicker < 1.0:
            return []
        self._flicker -= 1.0
        return [time - self._flicker / frequency + 20e-6 * float(self._rng.standard_normal())]


def _crossing(way: float, speed: float, acceleration: float) -> float:
    """Time (s) to turn by `way` (rad) from `speed` (rad/s) at a constant acceleration (rad/s2)."""
    root = math.sqrt(max(0.0, speed * speed + 2.0 * acceleration * way))
    return 2.0 * way / (speed + root)


class TachometerBoard(Board):
    """The board: stamps edges, groups them, counts them."""

    def __init__(self, rng: np.random.Generator, faults: BenchFaults) -> None:
        self._late: list[float] = []
        self._overflow_due = faults.overflow_at
        super().__init__("tach", rng, faults)

    def forget(self) -> None:
        """Counts and collected edges are gone."""
        self._group: list[int] = []
        self._group_since = 0.0
        self._last_edge: int | None = None
        self._to_lose = 0
        self._late.clear()

    def edges(self, times: list[float]) -> None:
        """Edges of the sensor at these true times (s); some may lie a little ahead."""
        self._late += times

    def work(self, time: float) -> None:
        """Take the edges, send full and overdue groups."""
        if time >= self._overflow_due:
            self._overflow_due = math.inf
            self._to_lose = OVERFLOW_EDGES
        due = [at for at in self._late if at <= time]
        self._late = [at for at in self._late if at > time]
        for at in sorted(due):
            self._edge(self.micros(at), at)
        if self._group and time - self._group_since > FLUSH_S:
            self._flush()

    def _edge(self, micros: int, at: float) -> None:
        last = self._last_edge
        if last is not None and (micros - last) % MICROS_RANGE < GLITCH_US:
            return
        self._last_edge = micros
        self.level ^= 1
        if not self.running:
            self._group.clear()
            return
        if self._to_lose:
            self._to_lose -= 1
            self.overflow += 1
            return
        self.total += 1
        if not self._group:
            self._group_since = at
        self._group.append(micros)
        if len(self._group) == EDGES_A_LINE:
            self._flush()

    def _flush(self) -> None:
        steps = [(b - a) % MICROS_RANGE for a, b in zip(self._group, self._group[1:], strict=False)]
        self.emit("E", self._group[0], *steps)
        self._group = []
