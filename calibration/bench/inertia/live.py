"""The swing while it is being recorded: amplitude, cycles, swing share, and when it is enough."""

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

import numpy as np

from calibration.bench.inertia.checks import AMPLITUDE_LEAST, AMPLITUDE_MOST
from calibration.bench.inertia.rest import STILL_RATE
from calibration.bench.inertia.start import strongest_line
from calibration.bench.inertia.swing import CLOCK_WRAP_S
from onboard.arrays import FloatArray, Vector

CYCLES_ENOUGH = 20.0
_WINDOW_S = 16.0  # looked at; holds four cycles of the slowest swing that is planned
_STILL_S = 2.0
_EVERY_S = 0.5  # between two analyses
_FEWEST = 30  # samples
_FEWEST_CYCLES = 2.0  # in the window, for a first figure
_CLEAR = 0.7  # share of the variance that one line must explain
_LARGEST_STEP_S = 2.0  # a longer hole starts the count again


class LiveState(Enum):
    """What the drone does."""

    STARTING = "starting"
    STILL = "still"
    MOVING = "moving"
    ENOUGH = "enough"


@dataclass(frozen=True, slots=True)
class LiveView:
    """For the operator's eyes.

    Attributes:
        state: `ENOUGH` says that recording may stop.
        amplitude: rad, of the last cycles; 0 until known.
        in_band: whether the amplitude is one to measure with (2 to 20 deg).
        cycles: since the release.
        period: s, of the last cycles, or None.
        swing_share: strongest other line over the torsion's, or None until four cycles are in.
        rate: rad/s, largest about any axis in the last 2 s, gyro bias taken out.
        samples: received.
    """

    state: LiveState
    amplitude: float
    in_band: bool
    cycles: float
    period: float | None
    swing_share: float | None
    rate: float
    samples: int


class LiveSwing:
    """Feed it samples as they arrive; read :attr:`view` whenever the screen is drawn.

    A sample costs a few microseconds; twice a second the last 16 s are analysed (some 20 ms). A drone that is
    held still after the twist counts as at rest: cycles count from the release.
    """

    def __init__(self, enough: float = CYCLES_ENOUGH) -> None:
        """`enough`: cycles after which the view says so (or when the amplitude falls below 2 deg)."""
        self._enough = enough
        self._time: deque[float] = deque()
        self._gyro: deque[Vector] = deque()
        self._bias: Vector | None = None
        self._wraps = 0.0
        self._analysed = -math.inf
        self._phase = 0.0  # cycles up to `_analysed`
        self._released = False
        self._view = LiveView(LiveState.STARTING, 0.0, False, 0.0, None, None, 0.0, 0)
        self._samples = 0

    @property
    def view(self) -> LiveView:
        """The latest analysis."""
        return self._view

    def add(self, time: float, gyro: Vector) -> LiveView:
        """One sample: `time` in s as stamped (wraps are undone), `gyro` in rad/s. Late ones are left out."""
        if self._time:
            if time + self._wraps < self._time[-1] - 0.5 * CLOCK_WRAP_S:
                self._wraps += CLOCK_WRAP_S
            time += self._wraps
            if time <= self._time[-1]:
                return self._view
            if time - self._time[-1] > _LARGEST_STEP_S:
                self._forget()
        self._samples += 1
        self._time.append(time)
        self._gyro.append(gyro)
        while self._time[-1] - self._time[0] > _WINDOW_S:
            self._time.popleft()
            self._gyro.popleft()
        if time - self._analysed >= _EVERY_S:
            self._view = self._analyse(time)
            self._analysed = time
        return self._view

    def _forget(self) -> None:
        """After a hole in the data: the phase across it is not known."""
        self._time.clear()
        self._gyro.clear()
        self._released, self._phase = False, 0.0

    def _analyse(self, now: float) -> LiveView:
        if now - self._time[0] < _STILL_S and self._view.state is LiveState.STARTING:
            return LiveView(LiveState.STARTING, 0.0, False, 0.0, None, None, 0.0, self._samples)
        t, gyro = np.array(self._time), np.array(self._gyro)
        recent = gyro[t > now - _STILL_S]
        still = math.sqrt(2.0) * float(np.max(np.std(recent, axis=0))) < STILL_RATE
        if still and self._view.state is not LiveState.ENOUGH:
            x, y, z = (float(part) for part in recent.mean(axis=0))
            self._bias, self._released, self._phase = (x, y, z), False, 0.0
            rate = float(np.max(np.abs(recent - recent.mean(axis=0))))
            return LiveView(LiveState.STILL, 0.0, False, 0.0, None, None, rate, self._samples)
        if self._view.state is LiveState.STILL:
            self._leave_out_before(now - _EVERY_S)
            t, gyro = np.array(self._time), np.array(self._gyro)
        centre = gyro.mean(axis=0) if self._bias is None else np.array(self._bias)
        return self._moving(now, t, gyro - centre, float(np.max(np.abs(recent - centre))))

    def _leave_out_before(self, begin: float) -> None:
        """It begins to move: what was before, at rest, is no swing."""
        while self._time[0] < begin:
            self._time.popleft()
            self._gyro.popleft()

    def _moving(self, now: float, t: FloatArray, gyro: FloatArray, rate: float) -> LiveView:
        """Period and amplitude of the last cycles, which count from the first that are large enough."""
        found = _torsion(t, gyro)
        if found is None or (not self._released and found[1] < AMPLITUDE_LEAST):
            return LiveView(LiveState.MOVING, 0.0, False, self._phase, None, None, rate, self._samples)
        period, amplitude, share = found
        since = self._analysed if self._released else max(float(t[0]), now - _FEWEST_CYCLES * period)
        self._released = True
        self._phase += (now - since) / period
        over = self._phase >= self._enough or (self._phase > 1.0 and amplitude < AMPLITUDE_LEAST)
        return LiveView(
            LiveState.ENOUGH if over else LiveState.MOVING,
            amplitude,
            AMPLITUDE_LEAST <= amplitude <= AMPLITUDE_MOST,
            self._phase,
            period,
            share,
            rate,
            self._samples,
        )


def _torsion(t: FloatArray, gyro: FloatArray) -> tuple[float, float, float | None] | None:
    """Period (s), amplitude (rad) and swing share of a window, or None where nothing oscillates."""
    if len(t) < _FEWEST:
        return None
    vectors = np.linalg.eigh(gyro.T @ gyro)[1]
    along = gyro @ vectors[:, 2]
    frequency, size = strongest_line(t - t[0], along)
    clear = size > 0.0 and 0.5 * size**2 > _CLEAR * float(np.var(along))
    if not clear or (t[-1] - t[0]) * frequency < _FEWEST_CYCLES:
        return None
    turn = math.tau * frequency * (t - t[-1])
    slow = (t - t[-1]) / (t[-1] - t[0])
    wave = np.column_stack([np.cos(turn), np.sin(turn)])
    columns = np.column_stack([wave, wave * slow[:, None], wave * slow[:, None] ** 2, np.ones_like(t)])
    weights = np.linalg.lstsq(columns, along, rcond=None)[0]
    # The amplitude falls along the window: the quadratic gives that of a quarter of a window before its end.
    at = -0.25
    cosine, sine = (weights[k] + at * weights[2 + k] + at * at * weights[4 + k] for k in (0, 1))
    amplitude = math.hypot(cosine, sine) / (math.tau * frequency)
    if (t[-1] - t[0]) * frequency < 4.0:
        return 1.0 / frequency, amplitude, None
    _, other = strongest_line(t - t[0], along - columns @ weights)
    return 1.0 / frequency, amplitude, other / size
