"""Supervisor, arming and flying through the link, against a peer written from the byte tables."""

import struct
import threading
from collections.abc import Callable
from itertools import groupby

import pytest

from onboard.link import (
    CommandRefused,
    DroneLink,
    LinkError,
    LinkInputError,
    LinkTimeout,
    Superseded,
)
from tests.link.tiny_drone import TinyDrone
from tests.patience import PATIENCE_S, until


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


GO_TO, LAND = 12, 8


def sent(tiny: TinyDrone, command: int) -> list[int]:
    """Where among all that the drone heard this command of the planner stands."""
    return [i for i, r in enumerate(list(tiny.requests)) if r[0] & 0xF3 == 0x80 and r[1] == command]


def silent_about(command: int) -> Callable[[bytes], bool]:
    """Of a drone that answers this command never."""
    return lambda request: request[0] & 0xF3 == 0x80 and request[1] == command


def in_thread(command: Callable[[], None]) -> tuple[threading.Thread, list[LinkError]]:
    """A command that is given beside the test, and how it failed."""
    failures: list[LinkError] = []

    def run() -> None:
        try:
            command()
        except LinkError as error:
            failures.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread, failures


def test_a_newer_command_ends_the_repetitions_of_an_older_one(tiny: TinyDrone, link: DroneLink) -> None:
    """The planner takes a go-to also when it lands: the copy that comes last wins."""
    tiny.drop = silent_about(GO_TO)
    going, failures = in_thread(lambda: link.go_to(1.0, 0.0, 0.5, 0.0, 2.0))
    until(lambda: len(sent(tiny, GO_TO)) > 1)
    link.land(0.0, 2.0)
    going.join(PATIENCE_S)
    assert [type(failure) for failure in failures] == [Superseded]
    threading.Event().wait(0.3)
    landed = sent(tiny, LAND)[0]
    assert len([at for at in sent(tiny, GO_TO) if at > landed]) <= 1, (
        "one may have been in its thread's hands"
    )


def test_a_command_that_is_not_wanted_is_not_sent_and_ends_no_other(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.drop = silent_about(LAND)
    landing, failures = in_thread(lambda: link.land(0.0, 2.0))
    until(lambda: sent(tiny, LAND))
    for command in (
        lambda: link.go_to(1.0, 0.0, 0.5, 0.0, 2.0, wanted=lambda: False),
        lambda: link.takeoff(0.5, 2.0, wanted=lambda: False),
    ):
        with pytest.raises(Superseded, match="no longer wanted"):
            command()
    tiny.drop = lambda _request: False
    landing.join(PATIENCE_S)
    assert not failures
    assert not sent(tiny, GO_TO)


def test_repetitions_end_when_they_are_no_longer_wanted(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.drop = silent_about(GO_TO)
    wanted = threading.Event()
    wanted.set()
    going, failures = in_thread(lambda: link.go_to(1.0, 0.0, 0.5, 0.0, 2.0, wanted=wanted.is_set))
    until(lambda: len(sent(tiny, GO_TO)) > 1)
    wanted.clear()
    going.join(PATIENCE_S)
    assert [type(failure) for failure in failures] == [Superseded]


def test_a_landing_that_is_ordered_again_may_be_under_way(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.commander_errno = 1
    link.land(0.0, 2.0, again=True)
    with pytest.raises(CommandRefused, match="refuses land: error 1"):
        link.land(0.0, 2.0)
    tiny.commander_errno = 16
    with pytest.raises(CommandRefused, match="does not let it fly"):
        link.land(0.0, 2.0, again=True)


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
