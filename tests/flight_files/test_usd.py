"""Logs of the micro-SD card deck."""

import math
import struct
import zlib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from calibration.flights import FlightFileError, PoseSource, UnusableFlightError, open_flight
from onboard.gravity import GRAVITY
from tests.drawn_examples import examples

Event = tuple[int, float, tuple[float, ...]]
POSE = tuple(f"locSrv.{name}(f)" for name in ("x", "y", "z", "qx", "qy", "qz", "qw"))
ESTIMATE = tuple(f"stateEstimate.{name}(f)" for name in ("x", "y", "z", "qx", "qy", "qz", "qw"))
TYPES = {
    7: ("fast", ("gyro.x(f)", "gyro.y(f)", "gyro.z(f)", "acc.z(f)", "motor.m1(H)", "motor.m4(I)")),
    9: ("slow", (*POSE, "pm.vbat(f)", "stateEstimate.x(f)", "range.zrange(h)")),
}


def usd_log(
    types: dict[int, tuple[str, tuple[str, ...]]], events: Iterable[Event], version: int = 2
) -> bytes:
    """A log as the deck writes it; times in s."""
    data = struct.pack("<BHH", 0xBC, version, len(types))
    for number, (name, variables) in types.items():
        data += struct.pack("<H", number) + name.encode() + b"\0" + struct.pack("<H", len(variables))
        data += b"".join(variable.encode() + b"\0" for variable in variables)
    for number, t, values in events:
        data += (
            struct.pack("<HQ", number, round(t * 1e6))
            if version == 2
            else struct.pack("<HI", number, round(t * 1e3))
        )
        codes = "".join(variable[-2] for variable in types[number][1])
        data += struct.pack(
            "<" + codes, *(int(v) if c not in "fde" else v for c, v in zip(codes, values, strict=True))
        )
    return data + struct.pack("<I", zlib.crc32(data))


def flight_events(seconds: float = 0.1) -> list[Event]:
    """Inertial events at 1 kHz and poses, of 50 Hz, logged at 200 Hz."""
    events: list[Event] = []
    for ms in range(round(1000 * seconds)):
        t = 3.0 + ms * 1e-3
        events.append((7, t, (90.0, 0.0, -180.0, 1.0, 30000 + ms, 65000)))
        if ms % 5 == 0:
            x = 0.1 * (ms // 20)
            events.append((9, t + 2e-4, (x, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 3.9, x + 0.01, -5)))
    return events


def test_events_become_channels_in_si(tmp_path: Path) -> None:
    path = tmp_path / "log07"
    path.write_bytes(usd_log(TYPES, flight_events()))
    flight = open_flight(path)
    assert (flight.format, flight.name, flight.finished) == ("usd", "log07", True)
    assert flight.pose_source is PoseSource.MOCAP
    t, gyro = flight.series("gx", "gy", "gz")
    np.testing.assert_allclose(t, 3.0 + 1e-3 * np.arange(100), atol=1e-9)
    np.testing.assert_allclose(gyro[5], [math.pi / 2, 0.0, -math.pi], atol=1e-6)
    assert flight.series("az")[1][0, 0] == pytest.approx(GRAVITY)
    assert flight.series("m1", "m4")[1][17].tolist() == [30017.0, 65000.0]
    assert flight.series("vbat")[1][0, 0] == pytest.approx(3.9)
    assert flight.series("est_x")[1][4, 0] == pytest.approx(0.11)


def test_a_pose_counts_when_it_arrives_and_not_again(tmp_path: Path) -> None:
    path = tmp_path / "log"
    path.write_bytes(usd_log(TYPES, flight_events()))
    t, x = open_flight(path).series("x")
    np.testing.assert_allclose(t, 3.0002 + 0.02 * np.arange(5), atol=1e-6)
    np.testing.assert_allclose(x[:, 0], 0.1 * np.arange(5), atol=1e-6)


def test_the_first_version_counts_milliseconds(tmp_path: Path) -> None:
    types = {1: ("all", (*ESTIMATE, "stateEstimate.vx(e)"))}
    events = [(1, 0.5 + 0.01 * i, (0.1 * i, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5)) for i in range(10)]
    path = tmp_path / "log"
    path.write_bytes(usd_log(types, events, version=1))
    flight = open_flight(path)
    assert flight.pose_source is PoseSource.ONBOARD_ESTIMATE
    np.testing.assert_allclose(flight.t, 0.5 + 0.01 * np.arange(10), atol=1e-9)
    assert flight.series("vx")[1][3, 0] == 0.5


def test_without_a_pose_it_is_no_flight(tmp_path: Path) -> None:
    path = tmp_path / "log"
    path.write_bytes(usd_log({1: ("imu", ("gyro.x(f)",))}, [(1, 0.0, (1.0,)), (1, 0.1, (1.0,))]))
    with pytest.raises(UnusableFlightError, match=r"no pose: log locSrv\.x"):
        open_flight(path)


def test_a_log_that_ended_with_the_battery_keeps_all_whole_events(tmp_path: Path) -> None:
    path = tmp_path / "log"
    whole = usd_log(TYPES, flight_events())[:-4]
    path.write_bytes(whole[:-7])
    flight = open_flight(path)
    assert not flight.finished
    assert "bytes at its end left out" in flight.notes[0]
    assert flight.series("gx")[0].size == 99


def test_damage_names_the_byte(tmp_path: Path) -> None:
    path = tmp_path / "log"
    good = usd_log(TYPES, flight_events())
    head = len(usd_log(TYPES, [])) - 4
    second = head + 2 + 8 + 4 * 4 + 2 + 4
    for position, value, message in (
        (0, 0xBD, "byte 0: not a micro-SD log"),
        (1, 3, "byte 1: version 3 of the format; known are 1, 2"),
        (good.index(b"gyro.x(f)") + 7, ord("Z"), f"byte {good.index(b'gyro.x(f)')}: variable 'gyro.x(Z)'"),
        (second + 1, 0x55, f"byte {second}: event of type {9 + (0x55 << 8)}, which the header does not have"),
        (head + 12, good[head + 12] ^ 1, "CRC-32 does not match"),
    ):
        bad = bytearray(good)
        bad[position] = value
        path.write_bytes(bytes(bad))
        with pytest.raises(FlightFileError) as caught:
            open_flight(path, "usd")
        assert message in str(caught.value)
        assert str(path) in str(caught.value)
    path.write_bytes(good[:20])
    with pytest.raises(FlightFileError, match="byte 14: a name without end in the header"):
        open_flight(path, "usd")
    events = flight_events()
    events[10], events[20] = events[20], events[10]
    path.write_bytes(usd_log(TYPES, events))
    with pytest.raises(FlightFileError, match="event 'fast': time goes back"):
        open_flight(path)


@settings(max_examples=examples(150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(0, 4000), content=st.binary(max_size=60))
def test_no_content_raises_anything_but_an_error_of_ours(tmp_path: Path, cut: int, content: bytes) -> None:
    path = tmp_path / "noise"
    path.write_bytes(usd_log(TYPES, flight_events())[:cut] + content)
    with suppress(FlightFileError, UnusableFlightError):
        flight = open_flight(path, "usd")
        assert np.all(np.diff(flight.t) >= 0)
