"""The scale: a load cell with an HX711 converter, and the board that passes its counts on."""

import math

import numpy as np

from sim_backend.bench.board import ROUNDING_S, Board
from sim_backend.bench.faults import BenchFaults

COUNTS_PER_GRAM = 4200.0
"""Of a 500 g cell at 1 mV/V and gain 128, within 10 %: nobody knows it before the calibration."""
LIMIT = 8388607
NOISE_G = 0.006
SHAKE = 0.004
"""Standard deviation of one conversion by the propellers' vibration, relative to the thrust."""
WANDER_G = 0.01
"""Random walk of the zero, g per sqrt(min)."""
WARM_UP_S = 400.0
SETTLING_CONVERSIONS = 4
"""The converter's filter needs four conversions after a step."""
QUIET_CODE = 1
QUIET_PERIOD_S = 0.5


class SimulatedLoadCell:
    """Cell and converter: grams that push, to counts.

    Attributes:
        counts_per_gram: unknown to the user.
        zero: counts without load, when cold.
    """

    def __init__(self, rng: np.random.Generator, faults: BenchFaults) -> None:
        self._rng = rng
        self._faults = faults
        self.counts_per_gram = COUNTS_PER_GRAM * float(rng.uniform(0.9, 1.1))
        self.zero = float(rng.uniform(-150e3, 150e3))
        self._period = 1.0 / faults.scale_rate
        self._due = self._period
        self._wander = 0.0
        self._recent: list[float] = []
        self._stuck: int | None = None

    def step(self, time: float, load: float, thrust: float) -> int | None:
        """Counts when a conversion ends at `time` (s), otherwise None.

        Args:
            time: bench time, s.
            load: g that push the cell, without the thrust.
            thrust: g that push the cell by the propellers.
        """
        if time < self._due - ROUNDING_S or time >= self._faults.scale_off_at:
            return None
        self._due += self._period
        self._wander += WANDER_G * math.sqrt(self._period / 60.0) * float(self._rng.standard_normal())
        push = load + (-thrust if self._faults.inverted else thrust)
        self._recent = [*self._recent[1 - SETTLING_CONVERSIONS :], push]
        settled = sum(self._recent) / len(self._recent)
        drift = self._faults.drift * (1.0 - math.exp(-time / WARM_UP_S)) + self._wander
        noise = math.hypot(NOISE_G, SHAKE * thrust) * float(self._rng.standard_normal())
        return self._faulty(time, self.zero + self.counts_per_gram * (settled + drift + noise))

    def _faulty(self, time: float, counts: float) -> int:
        if time >= self._faults.scale_saturated_at:
            return LIMIT
        value = int(max(-LIMIT - 1, min(LIMIT, round(counts))))
        if time >= self._faults.scale_stuck_at:
            if self._stuck is None:
                self._stuck = value
            return self._stuck
        return value


class ScaleBoard(Board):
    """The board: one line a conversion, and a word when the converter is silent."""

    def __init__(self, rng: np.random.Generator, faults: BenchFaults) -> None:
        super().__init__("load", rng, faults)

    def forget(self) -> None:
        """Nothing was converted yet."""
        self._last = self._started
        self._counts: int | None = None

    def conversion(self, counts: int | None) -> None:
        """The converter's word in this ms, None if it has none."""
        self._counts = counts

    def work(self, time: float) -> None:
        """Pass the conversion on."""
        counts, self._counts = self._counts, None
        if counts is not None:
            self._last = time
            if self.running:
                self.total += 1
                self.emit("L", self.micros(time), counts)
        elif time - self._last > QUIET_PERIOD_S:
            self._last = time
            self.emit("X", self.micros(time), QUIET_CODE, "hx711 not ready")
