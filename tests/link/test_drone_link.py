"""The one door to the drone, against a peer written from the byte tables."""

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
    NoSuchVariable,
    PolicyRefused,
    Superseded,
    reboot,
)
from tests.link.tiny_drone import MEMORY_SIZE, MEMORY_TYPE, TinyDrone
from tests.patience import PATIENCE_S, patient_link, until

BUNDLE = bytes(range(256)) * 8


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


def test_an_echo_of_another_value_is_no_answer(tiny: TinyDrone, hasty: DroneLink) -> None:
    tiny._set = lambda data: [data[:2] + b"\x02\x00"]  # type: ignore[method-assign]  # a firmware that clips
    with pytest.raises(LinkTimeout, match=r"set motion\.offset = 300"):
        hasty.set_param("motion.offset", 300)


def test_the_late_echo_of_an_earlier_write_is_not_taken_for_that_of_the_next(
    tiny: TinyDrone, link: DroneLink
) -> None:
    written: list[bytes] = []

    def echo_the_last_one_again(data: bytes) -> list[bytes]:
        written.append(data)
        return written[-2:]

    tiny._set = echo_the_last_one_again  # type: ignore[method-assign]
    for value in (6, 7, 8):
        link.set_param("motion.offset", value)
    # A busy machine answers so late that a write is sent again; none is after the next has begun.
    assert [value for value, _ in groupby(data[2] for data in written)] == [6, 7, 8]


def test_a_write_that_another_thread_undoes_is_given_up_at_once(tiny: TinyDrone, link: DroneLink) -> None:
    """The stop of a bench motor must not leave the command that it undoes waiting until its deadline."""
    lost = threading.Event()
    failures: list[LinkError] = []

    def lose_five(request: bytes) -> bool:
        is_five = request[0] & 0xF3 == 0x22 and request[3] == 5
        if is_five:
            lost.set()
        return is_five

    def write_five() -> None:
        try:
            link.set_param("motion.offset", 5)
        except LinkError as error:
            failures.append(error)

    tiny.drop = lose_five
    thread = threading.Thread(target=write_five)
    thread.start()
    until(lost.is_set)
    link.set_param("motion.offset", 6)
    thread.join()
    assert isinstance(failures[0], Superseded), "not the timeout two minutes later"
    assert tiny.values["motion.offset"] == 6


def test_no_answer_is_a_timeout_with_the_question_in_it(tiny: TinyDrone, hasty: DroneLink) -> None:
    tiny.drop = lambda request: request[0] & 0xF3 == 0x21
    start = time.monotonic()
    with pytest.raises(LinkTimeout, match=r"ring\.solid"):
        hasty.param("ring.solid")
    assert time.monotonic() - start >= 0.5
    assert hasty.lost is None, "pings are answered: the link stands"


# Memory and policy


def test_memory_round_trip_at_any_address_and_length(tiny: TinyDrone, link: DroneLink) -> None:
    data = bytes(range(200))
    link._memories.write(MEMORY_TYPE, data, address=77)
    assert bytes(tiny.memory[77:277]) == data
    assert link.read_memory(MEMORY_TYPE, 80, 49) == data[3:52]
    assert link.read_memory(MEMORY_TYPE, 0, 0) == b""
    with pytest.raises(LinkInputError, match="do not fit"):
        link._memories.write(MEMORY_TYPE, data, address=MEMORY_SIZE - 100)
    tiny.memory_status = 5
    with pytest.raises(CommandRefused, match="status 5"):
        link._memories.write(MEMORY_TYPE, data, address=0)


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
