"""The stop path alone: it leaves at once, goes on until locked, and outlives the link."""

import logging
import socket
import threading
from contextlib import ExitStack

import pytest

from onboard.link import DroneLink
from onboard.link.driver import ResendingUdpDriver, links_live_in
from onboard.link.errors import LinkError, LinkInputError
from onboard.link.stop import LONGEST_S, SILENT_S, StopPath
from onboard.link.stop_drone import stop_drone
from onboard.link.stop_ports import UdpStopPort
from onboard.timebase import WALL
from tests.link.tiny_drone import TinyDrone
from tests.patience import PATIENCE_S, until

STOP = b"\x91\x03"


def stops(tiny: TinyDrone) -> int:
    """How many stop packets came."""
    return sum(bytes((r[0] & 0xF3, *r[1:2])) == STOP for r in tiny.requests)


def test_a_stop_is_repeated_until_the_drone_says_that_it_is_locked(tiny: TinyDrone) -> None:
    tiny.drop = lambda request: request[:2] == STOP and stops(tiny) <= 6
    report = stop_drone(tiny.uri)
    assert report.locked
    assert report.copies >= 7
    assert tiny.supervisor_bits & 0x40


def test_an_answer_that_is_lost_is_asked_for_again(tiny: TinyDrone) -> None:
    asked: list[bytes] = []

    def lose_three(request: bytes) -> bool:
        if request[0] & 0xF3 == 0x90:
            asked.append(request)
        return request[0] & 0xF3 == 0x90 and len(asked) <= 3

    tiny.drop = lose_three
    assert stop_drone(tiny.uri).locked
    assert len(asked) >= 4


def test_a_name_that_nobody_finds_is_given_up_and_said_so() -> None:
    found = threading.Event()

    def waits_for_the_network(_host: str) -> str:
        found.wait()
        return "127.0.0.1"

    try:
        with pytest.raises(LinkError, match=r"nobody says within 3 s where drone\.lab is.*cut its power"):
            stop_drone("udp://drone.lab:19850", waits_for_the_network)
    finally:
        found.set()


def test_a_drone_whose_host_has_a_name_is_stopped(tiny: TinyDrone) -> None:
    asked: list[str] = []

    def table(host: str) -> str:
        asked.append(host)
        return "127.0.0.1"

    assert stop_drone(tiny.uri.replace("127.0.0.1", "drone.lab"), table).locked
    assert asked == ["drone.lab"]
    with pytest.raises(LinkError, match="no such name"):
        stop_drone("udp://elsewhere:1", unknown)


def unknown(_host: str) -> str:
    raise OSError("no such name")


def test_a_silent_drone_is_given_up_and_said_so() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody:
        nobody.bind(("127.0.0.1", 0))
        report = stop_drone(f"udp://127.0.0.1:{nobody.getsockname()[1]}")
    assert not report.locked
    assert "said nothing" in report.reason
    assert report.seconds >= SILENT_S
    assert report.copies > 20


def test_an_address_that_refuses_is_tried_again_until_somebody_is_there() -> None:
    """A refusal belongs to an earlier packet; the drone may be back by now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.connect(("127.0.0.1", port))
        path = StopPath(UdpStopPort(udp))
        path.trigger()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
            drone.bind(("127.0.0.1", port))
            drone.settimeout(PATIENCE_S)
            packet, host = drone.recvfrom(64)
            drone.sendto(b"\x90\x8c\x40\x00", host)
            assert packet in (STOP, b"\x90\x0c")
            until(lambda: path.report is not None)
        path.close()
    assert path.report is not None
    assert path.report.locked


def test_a_drone_that_talks_but_does_not_obey_is_given_up(tiny: TinyDrone) -> None:
    tiny.drop = lambda request: request[:2] == STOP
    report = stop_drone(tiny.uri)
    assert not report.locked
    assert "talks" in report.reason
    assert report.seconds >= LONGEST_S


def test_an_address_that_no_drone_can_have_is_refused() -> None:
    with pytest.raises(LinkInputError):
        stop_drone("tcp://127.0.0.1:1")


def test_closing_the_link_lets_a_stop_finish(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.drop = lambda request: request[:2] == STOP and stops(tiny) <= 10
    link.stop_path.trigger()
    link.close()
    assert tiny.supervisor_bits & 0x40
    assert link.stop_path.report is not None
    assert link.stop_path.report.locked


def test_a_trigger_after_the_link_is_closed_does_no_harm(link: DroneLink) -> None:
    link.close()
    link.stop_path.trigger()
    link.close()


def test_a_stop_leaves_while_every_lock_of_the_link_is_held(tiny: TinyDrone, link: DroneLink) -> None:
    """And every thread of ours that could send hangs on one of them."""
    driver = link._crazyflie.link
    with driver._lock, link._exchange._lock, link._crazyflie._failure_lock:
        link.stop_path.trigger()
        until(lambda: tiny.supervisor_bits & 0x40)
    report = link.stop_path.wait(PATIENCE_S)
    assert report is not None
    assert report.locked


class _BreakingPort(UdpStopPort):
    """The transport fails twice, and then works again."""

    failures = 2

    def stop(self, packet: bytes) -> None:
        if self.failures:
            self.failures -= 1
            raise OSError("as a transport that is breaking")
        super().stop(packet)


def test_a_copy_that_fails_says_so_to_nobody_who_could_hold_it_up(tiny: TinyDrone) -> None:
    """A log's handlers have locks, and its terminal may stand still."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp, ExitStack() as held:
        udp.connect(("127.0.0.1", int(tiny.uri.rsplit(":", 1)[1])))
        udp.settimeout(0.01)
        for handler in logging.getLogger().handlers:  # pytest's
            handler.acquire()
            held.callback(handler.release)
        path = StopPath(_BreakingPort(udp))
        path.trigger()
        report = path.wait(PATIENCE_S)
    path.close()
    assert report is not None
    assert report.locked


def test_a_stop_goes_on_over_a_link_that_was_lost(tiny: TinyDrone) -> None:
    driver = ResendingUdpDriver()
    with links_live_in(tiny.uri, WALL):
        driver.connect(tiny.uri, None, None)
    path = StopPath(driver.stop_port())
    tiny.drop = lambda request: request[:2] == STOP and stops(tiny) <= 3
    driver._fail("as if the drone had fallen silent")
    driver.close()
    path.trigger()
    path.close()
    assert path.report is not None
    assert path.report.locked


def test_a_thousand_triggers_are_one_stop(tiny: TinyDrone, link: DroneLink) -> None:
    for _ in range(1000):
        link.stop_path.trigger()
    until(lambda: link.stop_path.report is not None)
    link.close()
    assert 1 <= stops(tiny) < 100
