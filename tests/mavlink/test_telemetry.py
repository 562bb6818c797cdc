"""Telemetry as others read it: MAVSDK, ArduPilot's dialect of pymavlink, and bytes by hand."""

import math
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega
from scipy.spatial.transform import Rotation

from mocap_bridge.errors import MocapUriError
from mocap_bridge.mavlink.address import MavlinkAddress, parse_mavlink_address
from mocap_bridge.mavlink.telemetry import MavlinkTelemetry, heartbeat, status
from tests.mavlink.ground import Listener, MavsdkGround, needs_mavsdk

KEY = bytes(range(32))


@contextmanager
def showing(telemetry: MavlinkTelemetry) -> Iterator[None]:
    """The same state over and over, as a drone that hangs still."""
    stop = threading.Event()
    nose_up = Rotation.from_euler("ZYX", (0.4, -0.3, 0.2)).as_quat()

    def show() -> None:
        while not stop.wait(0.01):
            t = time.monotonic()
            telemetry.set_position(t, (1.25, -2.5, 0.75), (0.1, 0.2, -0.3))
            telemetry.set_attitude(t, tuple(nose_up))
            telemetry.set_rates((0.5, 0.25, -0.125))

    thread = threading.Thread(target=show)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


@needs_mavsdk
def test_mavsdk_sees_the_flight_and_may_not_arm_it() -> None:
    axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    ours = Rotation.from_euler("ZYX", (0.4, -0.3, 0.2)).as_matrix()
    expected = Rotation.from_matrix(axes @ ours @ np.diag([1.0, -1.0, -1.0]))
    with (
        MavsdkGround() as ground,
        MavlinkTelemetry(MavlinkAddress("127.0.0.1", ground.port, None)) as telemetry,
        showing(telemetry),
    ):
        telemetry.set_voltage(3.812)
        telemetry.set_state(4, armed=True)
        ground.until("ready")
        seen = ground.until("position")
        np.testing.assert_allclose(seen["position"], (-2.5, 1.25, -0.75), atol=1e-6)
        np.testing.assert_allclose(seen["velocity"], (0.2, 0.1, 0.3), atol=1e-6)
        w, x, y, z = ground.until("attitude")["wxyz"]
        assert math.degrees((expected.inv() * Rotation.from_quat((x, y, z, w))).magnitude()) < 1e-3
        battery = ground.until("battery", lambda line: line["volts"] > 0.0)
        assert battery["volts"] == pytest.approx(3.812, abs=1e-3)
        ground.until("armed", lambda line: line["armed"])
        telemetry.say("link_lost: no answer for 1.0 s", 2, safety=True)
        ground.until("text", lambda line: line["text"] == "#1 link_lost: no answer for 1.0 s")
        ground.ask("arm")
        assert "DENIED" in ground.until("arm")["answer"].upper()


@needs_mavsdk
def test_words_of_the_refusal_reach_whoever_commanded() -> None:
    with MavsdkGround() as ground, MavlinkTelemetry(MavlinkAddress("127.0.0.1", ground.port, None)):
        ground.until("ready")
        ground.ask("arm")
        ground.until("text", lambda line: line["text"].startswith("refused COMMAND_LONG 400"))


@pytest.mark.parametrize(
    "command",
    [
        ardupilotmega.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
        ardupilotmega.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, 0, 0, 0, 0, 0, 0, 0),
        ardupilotmega.MAVLink_set_mode_message(1, 1, 4),
        ardupilotmega.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0),
        ardupilotmega.MAVLink_mission_count_message(1, 1, 3),
        ardupilotmega.MAVLink_param_set_message(1, 1, b"X", 1.0, 9),
        ardupilotmega.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
        ),
    ],
    ids=lambda command: command.get_type(),
)
def test_every_kind_of_command_is_refused_and_that_is_said_once(command) -> None:
    with Listener() as station, MavlinkTelemetry(MavlinkAddress("127.0.0.1", station.port, None)):
        station.until("HEARTBEAT")
        for _ in range(3):
            station.send(command)
        words, acknowledgements = [], []
        for message in station.messages(seconds=0.5):
            if message.get_type() == "STATUSTEXT":
                words.append(message.text)
            if message.get_type() in ("COMMAND_ACK", "MISSION_ACK"):
                acknowledgements.append(message)
        assert "".join(words).startswith(f"refused {command.get_type()}")
        assert len(words) == (2 if len("".join(words)) > 49 else 1)
        if command.get_type().startswith("COMMAND"):
            assert [a.result for a in acknowledgements] == [ardupilotmega.MAV_RESULT_DENIED] * 3
        if command.get_type().startswith("MISSION"):
            assert [a.type for a in acknowledgements] == [ardupilotmega.MAV_MISSION_DENIED] * 3


def test_what_is_meant_for_others_is_left_alone() -> None:
    with Listener() as station, MavlinkTelemetry(MavlinkAddress("127.0.0.1", station.port, None)):
        station.until("HEARTBEAT")
        station.send(ardupilotmega.MAVLink_command_long_message(7, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
        kinds = {message.get_type() for message in station.messages(seconds=0.3)}
        assert not kinds & {"COMMAND_ACK", "STATUSTEXT"}


def test_timesync_is_answered_by_our_clock() -> None:
    with Listener() as station, MavlinkTelemetry(MavlinkAddress("127.0.0.1", station.port, None)):
        station.until("HEARTBEAT")
        before = time.monotonic_ns()
        station.send(ardupilotmega.MAVLink_timesync_message(0, 1234))
        answer = station.until("TIMESYNC")
        assert answer.ts1 == 1234
        assert before - 1e6 <= answer.tc1 <= time.monotonic_ns()


def test_with_a_key_all_is_signed_and_what_is_not_is_not_heard(tmp_path: Path) -> None:
    file = tmp_path / "key"
    file.write_text(KEY.hex() + "\n")
    with Listener(KEY) as station:
        address = parse_mavlink_address(f"mavlink://127.0.0.1:{station.port}?key={file}")
        with MavlinkTelemetry(address) as telemetry:
            assert station.until("HEARTBEAT").get_signed()
            other = ardupilotmega.MAVLink(None, srcSystem=255, srcComponent=190)
            forged = ardupilotmega.MAVLink_timesync_message(0, 55)
            station.socket.sendto(forged.pack(other), station.source)
            station.codec.signing.timestamp = int((time.time() - 1_420_070_400) * 1e5)
            station.send(ardupilotmega.MAVLink_timesync_message(0, 66))
            assert station.until("TIMESYNC").ts1 == 66
            assert telemetry._endpoint.refused >= 1
    with Listener(bytes(32)) as stranger:
        with MavlinkTelemetry(MavlinkAddress("127.0.0.1", stranger.port, KEY)):
            kinds = {message.get_type() for message in stranger.messages(seconds=0.4)}
        assert kinds == {"BAD_DATA"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("udp://127.0.0.1:14550", "write mavlink://"),
        ("mavlink://127.0.0.1:99999", "Port out of range"),
        ("mavlink://127.0.0.1:1/x", "write mavlink://"),
        ("mavlink://127.0.0.1?sign=x", "unknown option 'sign'"),
        ("mavlink://127.0.0.1?key=/nowhere", "64 hex digits"),
    ],
)
def test_an_address_that_cannot_be_used_says_why(text: str, says: str) -> None:
    with pytest.raises(MocapUriError, match=says):
        parse_mavlink_address(text)


def test_without_a_host_it_is_this_computer() -> None:
    assert str(parse_mavlink_address("mavlink://")) == "mavlink://127.0.0.1:14550"


def test_a_third_lost_loses_no_safety_event_over_the_wire() -> None:
    rng = np.random.default_rng(4)
    with Listener(keep=lambda: rng.random() >= 0.3) as station:
        with MavlinkTelemetry(MavlinkAddress("127.0.0.1", station.port, None)) as telemetry:
            for number in range(40):
                telemetry.say(f"event {number}", 2, safety=True)
        said = {m.text for m in station.messages(seconds=0.5) if m.get_type() == "STATUSTEXT"}
    assert said == {f"#{number + 1} event {number}" for number in range(40)}


def test_nobody_there_costs_the_flight_no_time() -> None:
    with MavlinkTelemetry(MavlinkAddress("127.0.0.1", 9, None)) as telemetry:
        begin = time.thread_time()
        for i in range(10_000):
            telemetry.set_position(i * 0.01, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
            telemetry.set_attitude(i * 0.01, (0.0, 0.0, 0.0, 1.0))
            telemetry.say("flood", 2, safety=True)
        assert time.thread_time() - begin < 1.0  # 0.1 ms for each


def test_no_number_ends_the_thread() -> None:
    nasty = (math.nan, math.inf, -math.inf, 1e300, -1e39, 0.0)
    with Listener() as station, MavlinkTelemetry(MavlinkAddress("127.0.0.1", station.port, None)) as told:
        for a in nasty:
            told.set_voltage(a)
            told.set_position(0.0, (a, a, 0.0), (0.0, 0.0, a))
            told.set_attitude(1e6, (a, 0.0, a, 1.0))
            told.set_rates((0.0, a, 0.0))
            told._round(time.monotonic())
        told.set_attitude(2e6, (0.0, 0.0, 0.0, 1.0))
        station.until("ATTITUDE_QUATERNION", lambda message: message.time_boot_ms > 1_000_000_000)
        assert told._thread.is_alive()


def crc_x25(data: bytes) -> int:
    """CRC-16/MCRF4XX bit by bit, as the MAVLink guide gives it."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc


def test_golden_bytes_by_hand_from_the_public_specification() -> None:
    """https://mavlink.io/en/guide/serialization.html: magic FD, length, flags, sequence, system, component,
    24 bits of message id, payload without its trailing zeros, CRC with the message's CRC_EXTRA (heartbeat 50,
    LOCAL_POSITION_NED 185)."""
    codec = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    packed = heartbeat(4, armed=True).pack(codec)
    payload = struct.pack("<IBBBBB", 0, 2, 0, 0x81, 4, 3)
    body = struct.pack("<BBBBBB", 9, 0, 0, 0, 1, 1) + bytes([0, 0, 0]) + payload
    assert packed == b"\xfd" + body + struct.pack("<H", crc_x25(body + bytes([50])))


def test_an_unknown_voltage_is_unknown() -> None:
    for unknown in (math.nan, math.inf, -1.0, 1e9):
        system, battery = status(unknown, poses_good=True, armed=False)
        assert system.voltage_battery == 0xFFFF
        assert battery.voltages[0] == 0xFFFF
        assert not system.onboard_control_sensors_health & ardupilotmega.MAV_SYS_STATUS_SENSOR_BATTERY
