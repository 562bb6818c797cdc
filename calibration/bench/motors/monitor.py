"""Live quality of the edges while an operator aligns the sensor or a run goes on."""

import math
from dataclasses import dataclass

import numpy as np

from calibration.bench.motors.records import EdgeRecord, IntArray
from calibration.bench.motors.revolutions import STANDSTILL, mark_passages, speed_trace
from onboard.arrays import FloatArray

_FEWEST = 12
"""Edges that a judgement needs."""


@dataclass(frozen=True, slots=True)
class EdgeQuality:
    """How good the latest edges are.

    Attributes:
        edge_rate: edges a second.
        speed: rad/s over the latest whole revolutions; 0 for a rotor that stands.
        jitter: s, standard deviation of an edge's time beyond pattern and trend; NaN with too few edges.
        missed_share, doubled_share: of the edges; NaN with too few edges.
        lost: edges lost on the line.
    """

    edge_rate: float
    speed: float
    jitter: float
    missed_share: float
    doubled_share: float
    lost: int


class EdgeMonitor:
    """Keeps the latest edges and judges them on demand."""

    def __init__(self, marks_per_revolution: int, span: float = 0.5) -> None:
        """Watch a rotor with that many marks, over the latest `span` (s of the instrument's clock)."""
        self._marks = marks_per_revolution
        self._span = span
        self._times = np.zeros(0)
        self._counts: IntArray = np.zeros(0, dtype=np.int64)
        self._now = -math.inf

    def add(self, times: FloatArray, counts: IntArray) -> None:
        """Take edges: times (s) on the instrument's clock and its running count.

        A clock or count that goes back (a reset) starts afresh.
        """
        if times.size == 0:
            return
        if self._times.size and (times[0] <= self._times[-1] or counts[0] <= self._counts[-1]):
            self._times, self._counts = np.zeros(0), np.zeros(0, dtype=np.int64)
            self._now = -math.inf
        self._times = np.concatenate([self._times, times])
        self._counts = np.concatenate([self._counts, counts])
        self.tick(float(times[-1]))

    def tick(self, now: float) -> None:
        """Tell the instrument's time (s), from a heartbeat: edges grow old while a rotor stands."""
        self._now = max(self._now, now)
        recent = self._times > self._now - self._span
        self._times, self._counts = self._times[recent], self._counts[recent]

    def quality(self) -> EdgeQuality:
        """The quality of the edges of the latest span."""
        rate = self._times.size / self._span
        standing = self._times.size < 2 or self._now - float(self._times[-1]) > STANDSTILL
        for part in EdgeRecord(self._times, self._counts).parts()[-1:]:
            if part.times.size >= _FEWEST:
                return self._judge(part, rate, standing)
        return EdgeQuality(
            edge_rate=rate,
            speed=0.0 if standing else self._rough_speed(),
            jitter=math.nan,
            missed_share=math.nan,
            doubled_share=math.nan,
            lost=0,
        )

    def _rough_speed(self) -> float:
        span = float(self._times[-1] - self._times[0])
        return 2.0 * math.pi * (self._times.size - 1) / (self._marks * span)

    def _judge(self, part: EdgeRecord, rate: float, standing: bool) -> EdgeQuality:
        passages = mark_passages(part)
        trace = speed_trace(passages, self._marks, "live")
        speed = float(np.median(trace.speed[-5:])) if trace.speed.size and not standing else 0.0
        turn = self._marks
        revolution = passages.times[turn:] - passages.times[:-turn]
        whole = passages.marks[turn:] - passages.marks[:-turn] == turn
        second = np.diff(revolution)[whole[1:] & whole[:-1]]
        # A revolution's change is that of four edges' jitter; the median ignores what acceleration adds.
        jitter = (
            float(1.4826 * np.median(np.abs(second - np.median(second)))) / 2.0 if second.size else math.nan
        )
        return EdgeQuality(
            edge_rate=rate,
            speed=speed,
            jitter=jitter,
            missed_share=passages.missed_share,
            doubled_share=passages.doubled_share,
            lost=passages.lost,
        )
