"""The recorder's ring: its layout, what it keeps, what the ground makes of it."""

import ctypes

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.app_interface import RecorderState
from onboard.firmware.structures import PerchLawSample, PerchPeriod, PerchRecorder
from onboard.ring import (
    AFTER_MS,
    HEADER,
    LAW,
    PERIOD,
    PERIODS,
    RING_BYTES,
    RingError,
    RingRecorder,
    decode_ring,
)

ORIGIN = (0.0, 0.0, 0.0)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def recorded(begin: int, end: int, until: int) -> RingRecorder:
    """A recorder that was armed at `begin` (ms), its approach ended at `end`; the voltage is the time."""
    recorder = RingRecorder()
    for tick in range(until):
        if tick == begin:
            recorder.begin()
        if tick == end:
            recorder.end(tick)
        if recorder.records(tick):
            estimate = ((0.1, 0.2, 0.3), ORIGIN, UPRIGHT, (1.0, 2.0, 3.0))
            cues = ((0.25, 3.0, 0.5), -float(tick), 0.001)
            recorder.record(tick, cues, estimate, UPRIGHT, float(tick), (0.1, 0.2, 0.3, 0.4))
    return recorder


def test_the_layout_is_that_of_the_code_in_c() -> None:
    assert (LAW.itemsize, PERIOD.itemsize) == (ctypes.sizeof(PerchLawSample), ctypes.sizeof(PerchPeriod))
    assert ctypes.sizeof(PerchRecorder) == RING_BYTES
    for name in HEADER.names or ():
        assert HEADER.fields is not None
        assert HEADER.fields[name][1] == getattr(PerchRecorder, name).offset
    estimate = PerchLawSample.estimate.offset
    assert LAW.fields is not None
    assert (estimate, PerchLawSample.thrusts.offset) == (LAW.fields["estimate"][1], LAW.fields["thrusts"][1])


@given(begin=st.integers(0, 200), flown=st.integers(1, 1500))
def test_the_periods_come_back_in_their_order(begin: int, flown: int) -> None:
    end = begin + flown
    recorder = recorded(begin, end, end + AFTER_MS + 20)
    ring = decode_ring(recorder.image())
    assert ring.end_tick == end
    assert len(ring.ticks) == min(PERIODS, len(range(-(-begin // 10) * 10, end + AFTER_MS, 10)))
    assert ring.ticks[-1] == (end + AFTER_MS - 1) // 10 * 10
    voltages = ring.periods["law"]["voltage"]
    assert np.array_equal(voltages, np.stack([ring.ticks, ring.ticks + 4], axis=1))
    assert np.array_equal(ring.periods["trigger_value"], -ring.ticks)
    assert ring.periods["law"]["estimate"]["gyro"][0, 0].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("until", [0, 100, 700])
def test_what_is_not_complete_is_not_read(until: int) -> None:
    recorder = recorded(50, 500, until)
    with pytest.raises(RingError, match="no complete recording"):
        decode_ring(recorder.image())


def test_a_new_arming_forgets_the_last_recording() -> None:
    recorder = recorded(50, 500, 900)
    recorder.begin()
    header = np.frombuffer(recorder.image(), HEADER, count=1)[0]
    assert (header["begun"], header["state"]) == (0, RecorderState.RUNS)


def test_another_layout_is_named() -> None:
    image = bytearray(recorded(50, 500, 900).image())
    image[12:14] = (200).to_bytes(2, "little")
    with pytest.raises(RingError, match=r"70 periods of 200 bytes, not 70 of 196; flash"):
        decode_ring(bytes(image))
