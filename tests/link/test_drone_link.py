"""The one door to the drone, against a peer written from the byte tables."""

import struct
import threading
import time
import zlib
from collections.abc import Callable
from itertools import groupby
from pathlib import Path

import pytest

from onboard.errors import InputError, OnboardError
from onboard.link import (
    CommandRefused,
    DroneLink,
    LinkError,
    LinkInputError,
    LinkLost,
    LinkTimeout,
    LogSample,
    NoSuchVariable,
    PolicyRefused,
    reboot,
)
from onboard.link.logs import QUEUE_LIMIT, unwrap
from tests.link.tiny_drone import MEMORY_SIZE, MEMORY_TYPE, TinyDrone
from tests.patience import PATIENCE_S, patient_link, until

BUNDLE = bytes(range(256)) * 8


class Samples:
    """A callback that collects samples."""

    def __init__(self) -> None:
        self.samples: list[LogSample] = []
        self._arrived = threading.Condition()

    def __call__(self, sample: LogSample) -> None:
        with self._arrived:
            self.samples.append(sample)
            self._arrived.notify_all()

    def wait_for(self, count: int) -> list[LogSample]:
        with self._arrived:
            assert self._arrived.wait_for(lambda: len(self.samples) >= count, timeout=PATIENCE_S), (
                self.samples
            )
        return self.samples


# Parameters


def test_parameters_are_read_from_the_drone_each_time(tiny: TinyDrone, link: DroneLink) -> None:
    assert link.param("ring.solid") == 0.25
    tiny.values["ring.solid"] = 0.75
    assert link.param("ring.solid") == 0.75
    assert link.param("motion.offset") == -3
    assert isinstance(link.param("motion.offset"), int)


def test_set_param_returns_when_the_drone_has_it(tiny: TinyDrone, link: DroneLink) -> None:
    link.set_params({"ring.solid": 1.5, "motion.offset": -300})
    assert (tiny.values["ring.solid"], tiny.values["motion.offset"]) == (1.5, -300)


def test_unknown_names_are_told_apart_from_link_trouble(link: DroneLink) -> None:
    assert link.has_param("ring.solid")
    assert not link.has_param("ring.solidd")
    assert link.has_log("pm.vbatMV")
    assert not link.has_log("ring.solid")
    with pytest.raises(NoSuchVariable, match=r"ring\.solidd"):
        link.param("ring.solidd")
    with pytest.raises(NoSuchVariable, match="0x12"):
        link.read_memory(0x12, 0, 4)


@pytest.mark.parametrize(
    ("name", "value"), [("motion.offset", 40000), ("motion.offset", 1.5), ("perch.polLen", -1)]
)
def test_values_that_do_not_fit_never_leave(
    tiny: TinyDrone, link: DroneLink, name: str, value: float
) -> None:
    with pytest.raises(LinkInputError, match=name) as caught:
        link.set_param(name, value)
    assert isinstance(caught.value, InputError)
    assert isinstance(caught.value, OnboardError)
    assert tiny.count(0x22) == 0


def test_read_only_parameters_are_refused_here_because_the_drone_would_not_answer(link: DroneLink) -> None:
    with pytest.raises(CommandRefused, match="read-only"):
        link.set_param("perch.polStat", 1)


def test_an_echo_of_another_value_is_a_refusal(tiny: TinyDrone, link: DroneLink) -> None:
    tiny._set = lambda data: [data[:2] + b"\x02\x00"]  # type: ignore[method-assign]  # a firmware that clips
    with pytest.raises(CommandRefused, match=r"motion\.offset"):
        link.set_param("motion.offset", 300)


def test_no_answer_is_a_timeout_with_the_question_in_it(tiny: TinyDrone, hasty: DroneLink) -> None:
    tiny.drop = lambda request: request[0] & 0xF3 == 0x21
    start = time.monotonic()
    with pytest.raises(LinkTimeout, match=r"ring\.solid"):
        hasty.param("ring.solid")
    assert time.monotonic() - start >= 0.5
    assert hasty.lost is None, "pings are answered: the link stands"


# Supervisor and flying


def test_supervisor_info_is_fresh(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.supervisor_bits = 0x0849
    info = link.supervisor_info()
    assert (info.bits, info.can_arm, info.can_fly, info.is_locked) == (0x849, True, True, True)
    assert not info.is_armed
    tiny.supervisor_bits = 0x0020
    assert link.supervisor_info().is_tumbled


def test_supervisor_info_without_an_answer_raises(tiny: TinyDrone, hasty: DroneLink) -> None:
    tiny.drop = lambda request: request[0] & 0xF3 == 0x90
    with pytest.raises(LinkTimeout):
        hasty.supervisor_info()


def test_arming_refused_says_what_the_supervisor_says(tiny: TinyDrone, link: DroneLink) -> None:
    link.arm()
    assert link.supervisor_info().is_armed
    link.disarm()
    assert not link.supervisor_info().is_armed
    tiny.armable, tiny.supervisor_bits = False, 0x0020
    with pytest.raises(CommandRefused, match="tumbled"):
        link.arm()
    link.recover()


def test_commander_errors_are_noticed(tiny: TinyDrone, link: DroneLink) -> None:
    link.takeoff(0.5, 2.0)
    link.go_to(1.0, 0.0, 0.5, 0.0, 2.0)
    link.land(0.0, 2.0)
    link.stop_motors()
    tiny.commander_errno = 16
    for command in (
        lambda: link.takeoff(0.5, 2.0),
        lambda: link.go_to(1.0, 0.0, 0.5, 0.0, 2.0),
        lambda: link.land(0.0, 2.0),
        link.stop_motors,
    ):
        with pytest.raises(CommandRefused, match="does not let it fly"):
            command()


@pytest.mark.parametrize("answer_is_lost", [True, False])
def test_a_copy_of_what_the_drone_does_already_is_no_refusal(
    tiny: TinyDrone, link: DroneLink, answer_is_lost: bool
) -> None:
    """The planner answers 1 to a landing that lands: to our own copy, when the first answer was lost."""
    heard: list[bytes] = []

    def lose_the_first(packet: bytes) -> bool:
        if packet[0] & 0xF3 == 0x80:
            heard.append(packet)
        return answer_is_lost and len(heard) == 1 and packet[0] & 0xF3 == 0x80

    tiny.drop, tiny.commander_errno = lose_the_first, 1
    if answer_is_lost:
        link.land(0.0, 2.0)
        assert len(heard) > 1
    else:
        with pytest.raises(CommandRefused, match="refuses land: error 1"):
            link.land(0.0, 2.0)


def test_commander_packets_have_the_firmwares_layout(tiny: TinyDrone, link: DroneLink) -> None:
    link.takeoff(0.5, 2.0)
    link.land(0.1, 3.0, yaw=0.25)
    link.go_to(1.0, 2.0, 3.0, 0.5, 4.0, relative=True)
    link.stop_motors()
    sent = [request[1:] for request in tiny.requests if request[0] & 0xF3 == 0x80]
    assert [packet for packet, _repeats in groupby(sent)] == [
        b"\x07\x00" + struct.pack("<ff?f", 0.5, 0.0, True, 2.0),
        b"\x08\x00" + struct.pack("<ff?f", 0.1, 0.25, False, 3.0),
        b"\x0c\x00\x01\x00" + struct.pack("<5f", 1.0, 2.0, 3.0, 0.5, 4.0),
        b"\x03\x00",
    ]


def test_a_relative_move_is_sent_once_even_without_an_answer(tiny: TinyDrone, hasty: DroneLink) -> None:
    tiny.drop = lambda request: request[0] & 0xF3 == 0x80
    with pytest.raises(LinkTimeout):
        hasty.go_to(0.1, 0.0, 0.0, 0.0, 1.0, relative=True)
    with pytest.raises(LinkTimeout):
        hasty.go_to(0.1, 0.0, 0.5, 0.0, 1.0)

    def sent(relative: int) -> int:
        return sum(request[0] & 0xF3 == 0x80 and request[3] == relative for request in list(tiny.requests))

    until(lambda: sent(relative=0) > 1)
    assert sent(relative=1) == 1


def test_emergency_stop_is_repeated_until_the_drone_is_locked(tiny: TinyDrone, link: DroneLink) -> None:
    stops: list[bytes] = []

    def lose_six(request: bytes) -> bool:
        is_stop = request[0] & 0xF3 == 0x91 and request[1] == 3
        if is_stop:
            stops.append(request)
        return is_stop and len(stops) <= 6

    tiny.drop = lose_six
    link.emergency_stop(PATIENCE_S)
    assert link.supervisor_info().is_locked
    assert len(stops) > 6


def test_emergency_stop_that_is_not_confirmed_is_an_error(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.drop = lambda request: request[0] & 0xF3 in (0x90, 0x91)
    with pytest.raises(LinkTimeout, match="not confirmed"):
        link.emergency_stop(0.2)
    until(lambda: tiny.count(0x91) >= 5)


def test_poses_go_out_as_they_are_and_only_if_finite(tiny: TinyDrone, link: DroneLink) -> None:
    link.send_pose((1.0, -2.0, 0.5), (0.0, 0.0, 0.6, 0.8))
    for position, quaternion in (
        ((1.0, float("nan"), 0.5), (0.0, 0.0, 0.0, 1.0)),
        ((1.0, 0.0, 0.5), (0.0, 0.0, 0.0, float("inf"))),
        ((1.0, 0.5), (0.0, 0.0, 0.0, 1.0)),
    ):
        with pytest.raises(LinkInputError):
            link.send_pose(position, quaternion)
    link.kick_emergency_stop_watchdog()
    assert link.param("ring.solid") == 0.25  # what was sent before has arrived
    poses = [request for request in tiny.requests if request[0] & 0xF3 == 0x61]
    assert [pose[1:] for pose in poses] == [struct.pack("<B7f", 8, 1.0, -2.0, 0.5, 0.0, 0.0, 0.6, 0.8)]
    assert [r[1:] for r in tiny.requests if r[0] & 0xF3 == 0x91] == [b"\x04"]


def test_setpoints_go_out_in_thousandths_and_only_if_they_fit(tiny: TinyDrone, link: DroneLink) -> None:
    link.send_full_state((1.0, -2.0, 0.5), (0.1, 0.0, -0.2), (0.0, 3.0, -9.0), 0.0, -0.5)
    link.end_setpoints()
    nothing = (0.0, 0.0, 0.0)
    for position, yaw, rate in (
        ((1.0, float("nan"), 0.5), 0.0, 0.0),
        ((1.0, 0.0, 33.0), 0.0, 0.0),
        (nothing, float("nan"), 0.0),
        (nothing, 0.0, float("inf")),
    ):
        with pytest.raises(LinkInputError):
            link.send_full_state(position, nothing, nothing, yaw, rate)
    assert link.param("ring.solid") == 0.25  # what was sent before has arrived
    setpoints = [request[1:] for request in tiny.requests if request[0] & 0xF3 == 0x70]
    level = 3 << 30  # the largest part is w, the others are zero
    assert setpoints == [
        struct.pack("<B9hI3h", 6, 1000, -2000, 500, 100, 0, -200, 0, 3000, -9000, level, 0, 0, -500)
    ]
    assert tiny.count(0x71) == 2


# Memory and policy


def test_memory_round_trip_at_any_address_and_length(tiny: TinyDrone, link: DroneLink) -> None:
    data = bytes(range(200))
    link.write_memory(MEMORY_TYPE, data, address=77)
    assert bytes(tiny.memory[77:277]) == data
    assert link.read_memory(MEMORY_TYPE, 80, 49) == data[3:52]
    assert link.read_memory(MEMORY_TYPE, 0, 0) == b""
    with pytest.raises(LinkInputError, match="do not fit"):
        link.write_memory(MEMORY_TYPE, data, address=MEMORY_SIZE - 100)
    tiny.memory_status = 5
    with pytest.raises(CommandRefused, match="status 5"):
        link.write_memory(MEMORY_TYPE, data)


def test_uploaded_policy_is_live_under_its_checksum(tiny: TinyDrone, link: DroneLink) -> None:
    assert link.active_policy_crc() == 0
    assert link.upload_policy(BUNDLE) == zlib.crc32(BUNDLE)
    assert bytes(tiny.memory[: len(BUNDLE)]) == BUNDLE
    assert link.active_policy_crc() == zlib.crc32(BUNDLE)


def test_refused_policy_says_why_and_the_previous_one_stays(tiny: TinyDrone, link: DroneLink) -> None:
    link.upload_policy(BUNDLE)
    for _ in range(2):  # the second time the refusal is there already when the commit is sent
        with pytest.raises(PolicyRefused, match="format") as caught:
            link.upload_policy(b"BAD!" + BUNDLE)
        assert "keeps" in str(caught.value)
        assert link.active_policy_crc() == zlib.crc32(BUNDLE)
    assert link.upload_policy(BUNDLE[::-1]) == zlib.crc32(BUNDLE[::-1])


def test_policy_that_does_not_read_back_is_never_committed(tiny: TinyDrone, link: DroneLink) -> None:
    write = tiny._memory_write

    def flip_a_bit(data: bytes) -> list[bytes]:
        return write(data[:10] + bytes((data[10] ^ 1,)) + data[11:])

    tiny._memory_write = flip_a_bit  # type: ignore[method-assign]  # a broken memory
    with pytest.raises(PolicyRefused, match="nothing was committed"):
        link.upload_policy(BUNDLE)
    assert tiny.values["perch.polCommit"] == 0


def test_policy_write_refused_in_flight(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.memory_status = 5
    with pytest.raises(PolicyRefused, match="flying"):
        link.upload_policy(BUNDLE)


def test_firmware_with_another_app_interface_is_refused(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.values["perch.version"] = 1
    with pytest.raises(NoSuchVariable, match="version 1, needed is 2"):
        link.upload_policy(BUNDLE)


# Log streams


@pytest.mark.parametrize(
    ("known", "raw", "expected"),
    [
        (None, 5, 5),
        (0xFFFFF0, 0x10, 0x1000010),
        (0x1000010, 0xFFFFF0, 0xFFFFF0),
        (0x2000005, 0x000006, 0x2000006),
    ],
)
def test_drone_time_is_unwrapped(known: int | None, raw: int, expected: int) -> None:
    assert unwrap(known, raw) == expected


def test_stream_delivers_typed_samples_in_order_across_the_wrap(tiny: TinyDrone, link: DroneLink) -> None:
    samples = Samples()
    with link.stream(["stateEstimate.x", "pm.vbatMV"], 10, samples) as stream:
        for step in range(4):
            tiny.push_log(stream.block, 0xFFFFEC + 10 * step, struct.pack("<fH", 0.5 * step, 3700 + step))
        tiny.push_log(stream.block, 0xFFFFEC + 15, struct.pack("<fH", 7.0, 7))  # overtaken on the way
        tiny.push_log(stream.block, 0xFFFFEC + 45, struct.pack("<f", 0.5))  # too short
        tiny.push_log(stream.block, 0xFFFFEC + 50, struct.pack("<fH", 9.0, 9))
        got = samples.wait_for(5)
        assert [s.drone_time_ms - 0xFFFFEC for s in got] == [0, 10, 20, 30, 50]
        assert got[1].values == {"stateEstimate.x": 0.5, "pm.vbatMV": 3701}
        assert stream.latest is got[-1]
        assert 0.0 <= stream.age() < PATIENCE_S
        assert (stream.received, stream.late, stream.malformed) == (5, 1, 1)
    assert tiny.blocks == {}


def test_stream_limits_are_input_errors(link: DroneLink) -> None:
    with pytest.raises(NoSuchVariable):
        link.stream(["stateEstimate.y"], 10, lambda _sample: None)
    for period in (0, 15, 2550):
        with pytest.raises(LinkInputError, match="period"):
            link.stream(["pm.vbatMV"], period, lambda _sample: None)
    with pytest.raises(LinkInputError, match="bytes"):
        link.stream(["stateEstimate.x"] * 7, 10, lambda _sample: None)
    with pytest.raises(LinkInputError, match="twice"):  # 22 bytes: there is room for its largest
        link.stream(["pm.vbatMV"] * 11, 10, lambda _sample: None)


def test_lost_answer_to_a_block_command_is_repaired(tiny: TinyDrone, link: DroneLink) -> None:
    answered: list[bytes] = []

    def lose_first_create_answer(reply: bytes) -> int:
        if reply[0] == 0x51 and reply[1] == 6:
            answered.append(reply)
            return 0 if len(answered) == 1 else 1
        return 1

    tiny.copies = lose_first_create_answer
    samples = Samples()
    with link.stream(["stateEstimate.z"], 10, samples) as stream:
        assert tiny.blocks[stream.block] == [1]
        tiny.push_log(stream.block, 10, struct.pack("<f", 2.0))
        samples.wait_for(1)


def test_slow_callback_loses_the_oldest_samples_and_blocks_nobody(tiny: TinyDrone, link: DroneLink) -> None:
    go_on, samples = threading.Event(), Samples()

    def slow(sample: LogSample) -> None:
        go_on.wait(PATIENCE_S)
        samples(sample)

    with link.stream(["stateEstimate.x"], 10, slow) as stream:
        count = QUEUE_LIMIT + 50
        for step in range(count):
            tiny.push_log(stream.block, 10 * step, struct.pack("<f", step))
            if step % 50 == 0:
                assert link.param("ring.solid") == 0.25
        assert link.param("ring.solid") == 0.25
        assert stream.received == count
        assert stream.dropped in (49, 50)
        go_on.set()
        got = samples.wait_for(count - stream.dropped)
        assert got[-1].values["stateEstimate.x"] == count - 1


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_callback_that_raises_ends_its_stream_only(tiny: TinyDrone, link: DroneLink) -> None:
    samples = Samples()

    def broken(_sample: LogSample) -> None:
        raise ZeroDivisionError

    bad = link.stream(["stateEstimate.x"], 10, broken)
    good = link.stream(["stateEstimate.x"], 10, samples)
    for stream in (bad, good):
        tiny.push_log(stream.block, 10, struct.pack("<f", 1.0))
    samples.wait_for(1)
    bad._thread.join(PATIENCE_S)
    assert (bad.alive, good.alive) == (False, True)
    bad.close()


# The link itself


def test_close_is_idempotent_cuts_the_motors_and_ends_every_call(tiny: TinyDrone) -> None:
    link = patient_link(tiny.uri)
    threads = threading.active_count()
    link.arm()
    link.close()
    link.close()
    until(lambda: tiny.count(0x30))  # cflib's zero setpoint
    with pytest.raises(LinkLost, match="closed"):
        link.param("ring.solid")
    until(lambda: threading.active_count() < threads)


REST = (0.0, 0.0, 0.0)
COMMANDS: dict[str, Callable[[DroneLink], object]] = {
    "arm": lambda link: link.arm(),
    "take off": lambda link: link.takeoff(0.5, 1.0),
    "go to": lambda link: link.go_to(0.0, 0.0, 1.0, 0.0, 1.0),
    "land": lambda link: link.land(0.0, 1.0),
    "setpoint": lambda link: link.send_full_state(REST, REST, REST, 0.0, 0.0),
    "by cflib": lambda link: link._crazyflie.commander.send_setpoint(0.0, 0.0, 0.0, 20000),
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=list(COMMANDS))
def test_closing_stops_a_drone_that_this_link_commands(
    tiny: TinyDrone, link: DroneLink, command: Callable[[DroneLink], object]
) -> None:
    command(link)
    before = tiny.count(0x30)
    link.close()
    until(lambda: tiny.count(0x30) > before)


def test_closing_leaves_a_drone_alone_that_somebody_else_flies(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.supervisor_bits = 0x1B  # armed and flying
    tiny.memory_status = 5
    link.supervisor_info()
    link.send_pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    link.set_param("stabilizer.estimator", 2)
    with pytest.raises(PolicyRefused, match="flying"):
        link.upload_policy(bytes(100))
    before = len(tiny.requests)
    link.close()
    with patient_link(tiny.uri) as other:  # nothing of the first is still on its way
        other.supervisor_info()
    sent = {request[0] & 0xF0 for request in tiny.requests[before:]}
    assert not sent & {0x30, 0x70, 0x80}
    assert not tiny.count(0x91)


def test_reopening_leaves_no_threads_behind(tiny: TinyDrone) -> None:
    before = threading.active_count()
    for _ in range(3):
        patient_link(tiny.uri).close()
    until(lambda: threading.active_count() <= before)


def test_toc_cache_is_used_the_second_time(tiny: TinyDrone, tmp_path: Path) -> None:
    def items_asked() -> int:
        return sum(request[0] & 0xF3 == 0x50 and request[1] == 2 for request in list(tiny.requests))

    DroneLink.open(tiny.uri, toc_cache=tmp_path, timeout_s=PATIENCE_S).close()
    before = items_asked()
    assert before > 0
    with DroneLink.open(tiny.uri, toc_cache=tmp_path, timeout_s=PATIENCE_S) as link:
        assert items_asked() == before
        assert link.param("motion.offset") == -3


def test_firmware_without_the_supervisor_port_is_refused(tiny: TinyDrone) -> None:
    tiny.protocol_version = 10
    with pytest.raises(LinkError, match="protocol 10"):
        patient_link(tiny.uri)


def test_reboot_returns_when_the_firmware_answers_again(tiny: TinyDrone) -> None:
    off: list[bytes] = []

    def dead_while_off(request: bytes) -> bool:
        if request[1:2] == b"\xfe":
            off.append(request)
            return False
        return request[0] & 0xF3 == 0xF1 and tiny.count(0xF1) < 3  # still booting

    tiny.drop = dead_while_off
    reboot(tiny.uri, timeout_s=PATIENCE_S)
    assert [command for command, _repeats in groupby(request[2] for request in off)] == [2, 3]
    tiny.frozen.set()
    with pytest.raises(LinkTimeout):
        reboot(tiny.uri, timeout_s=0.3)
