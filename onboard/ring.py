"""The recorder's ring on the drone: the last 0.7 s around a trigger, as policy and law had them.

Float32 and little endian, as it lies in the app's memory (``onboard/firmware/core/recorder.h``) from
:data:`onboard.app_interface.RECORD_ADDRESS` on. It runs from the arming of an approach until 0.3 s after its
end. A period of 10 ms is an evaluation of the policy, the law's step in the same ms, and that 4 ms later.
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from onboard.app_interface import RecorderState
from onboard.arrays import Quaternion, Vector
from onboard.errors import OnboardError
from onboard.mixer import Thrusts

PERIODS = 70
PERIOD_MS = 10
SECOND_SAMPLE_MS = 4
AFTER_MS = 300
"""The recorder stops so long after the end of the approach."""

ESTIMATE = np.dtype(
    [("position", "<f4", (3,)), ("velocity", "<f4", (3,)), ("quaternion", "<f4", (4,)), ("gyro", "<f4", (3,))]
)
"""m, m/s, world; x, y, z, w, body to world; rad/s, body."""

LAW = np.dtype(
    [("estimate", ESTIMATE), ("own_attitude", "<f4", (4,)), ("voltage", "<f4"), ("thrusts", "<f4", (4,))]
)
"""What a step of the law had and gave: own attitude as the quaternion, filtered voltage (V), thrusts (N)."""

PERIOD = np.dtype([("cues", "<f4", (3,)), ("trigger_value", "<f4"), ("a_rot", "<f4"), ("law", LAW, (2,))])
"""tau (s), theta_x (rad/s), d_ceil (m); value of the trigger; moment (N m); the law's two samples."""

HEADER = np.dtype(
    [
        ("begun", "<u4"),
        ("last_tick", "<u4"),
        ("stop_tick", "<u4"),
        ("period_bytes", "<u2"),
        ("periods", "u1"),
        ("state", "u1"),
    ]
)
"""Periods so far, of which number n is at n % 70; tick (ms) of the newest, and of the stop; sizes; state."""

RING_BYTES = HEADER.itemsize + PERIODS * PERIOD.itemsize

Table: TypeAlias = NDArray[np.void]
"""Periods (`PERIOD`) in the order of their time."""


class RingError(OnboardError):
    """What the drone recorded is not there, or not as this program knows it."""


@dataclass(frozen=True)
class Ring:
    """What a stopped recorder holds.

    Attributes:
        ticks: (n,) when each period began, ms on the drone's control loop.
        end_tick: when the approach ended, on the same clock.
        periods: (n,) of `PERIOD`, oldest first.
    """

    ticks: NDArray[np.int64]
    end_tick: int
    periods: Table


def decode_header(data: bytes) -> Any:
    """The `HEADER` of a ring.

    Raises:
        RingError: it is another layout.
    """
    header = np.frombuffer(data, HEADER, count=1)[0]
    if header["begun"] > 0 and (header["period_bytes"], header["periods"]) != (PERIOD.itemsize, PERIODS):
        raise RingError(
            f"the drone records {header['periods']} periods of {header['period_bytes']} bytes, not {PERIODS} "
            f"of {PERIOD.itemsize}; flash the matching firmware"
        )
    return header


def is_complete(header: Any) -> bool:
    """Whether something was recorded, and the recorder has stopped."""
    return bool(header["begun"] > 0 and header["state"] == RecorderState.OFF)


def check_complete(header: Any) -> None:
    """Refuse what is not :func:`is_complete`.

    Raises:
        RingError: it records still, or has recorded nothing.
    """
    if not is_complete(header):
        raise RingError("the drone has no complete recording: it records still, or no approach was armed")


def decode_ring(data: bytes) -> Ring:
    """What a stopped recorder holds.

    Args:
        data: `RING_BYTES` bytes from the ring's address on.

    Raises:
        RingError: it records still, has recorded nothing, or is another layout.
    """
    header = decode_header(data)
    check_complete(header)
    begun = int(header["begun"])
    held = min(begun, PERIODS)
    places = np.arange(begun - held, begun) % PERIODS
    periods = np.frombuffer(data, PERIOD, count=PERIODS, offset=HEADER.itemsize)[places]
    ticks = int(header["last_tick"]) - PERIOD_MS * np.arange(held - 1, -1, -1, dtype=np.int64)
    return Ring(ticks, int(header["stop_tick"]) - AFTER_MS, periods)


class RingRecorder:
    """The reference of the recorder (``onboard/firmware/core/recorder.c``)."""

    def __init__(self) -> None:
        self._header = np.zeros(1, HEADER)
        self._periods = np.zeros(PERIODS, PERIOD)

    def begin(self) -> None:
        """Forget everything, and run."""
        self._header[:] = (0, 0, 0, PERIOD.itemsize, PERIODS, RecorderState.RUNS)
        self._periods[:] = np.zeros(1, PERIOD)

    def end(self, tick: int) -> None:
        """The approach has ended: stop a while after `tick` (ms)."""
        if self._header["state"][0] == RecorderState.RUNS:
            self._header["state"], self._header["stop_tick"] = RecorderState.ENDS, tick + AFTER_MS

    def records(self, tick: int) -> bool:
        """Whether a step of the law at `tick` is recorded."""
        phase = tick % PERIOD_MS
        if phase not in (0, SECOND_SAMPLE_MS):
            return False
        header = self._header[0]
        return bool(header["state"] != RecorderState.OFF) and (phase == 0 or bool(header["begun"] > 0))

    def record(
        self,
        tick: int,
        policy: tuple[Vector, float, float],
        estimate: tuple[Vector, Vector, Quaternion, Vector],
        own_attitude: Quaternion,
        voltage: float,
        thrusts: Thrusts,
    ) -> None:
        """Take in a step of the law, with the newest cues, trigger value and moment."""
        header = self._header[0]
        law = (estimate, own_attitude, voltage, thrusts)
        if tick % PERIOD_MS:
            self._periods[(int(header["begun"]) - 1) % PERIODS]["law"][1] = law
            return
        if header["state"] == RecorderState.ENDS and tick >= header["stop_tick"]:
            header["state"] = RecorderState.OFF
            return
        period = self._periods[int(header["begun"]) % PERIODS]
        period["cues"], period["trigger_value"], period["a_rot"] = policy
        period["law"][0] = law
        header["last_tick"] = tick
        header["begun"] += 1

    def image(self) -> bytes:
        """The bytes that the ground reads."""
        return self._header.tobytes() + self._periods.tobytes()
