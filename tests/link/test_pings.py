"""How long the drone takes to answer: the way that its other packets take, too."""

import threading
from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np
import pytest
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort

from onboard.link import DroneLink
from onboard.link.pings import PERIOD_S, Pings
from tests.link.faulty_network import Faults, FaultyNetwork
from tests.link.tiny_drone import TinyDrone
from tests.patience import patient_link, until
from tests.stepped_time import Stepping

CFLIB = CRTPPacket(0xF0, b"\0" + bytes(8))


class Drone:
    """Answers the ping of a number after so long (s), in steps of a period; None: never."""

    def __init__(self, run_s: float, answers: Callable[[int], float | None]) -> None:
        self.time = Stepping(run_s, self._deliver)
        self.ended = threading.Event()
        self.way = answers
        self.under_way: list[tuple[float, CRTPPacket]] = []
        self.seen: list[float] = []
        self.sent: list[CRTPPacket] = []
        self.again = False
        crazyflie: Any = self
        self.pings = Pings(crazyflie, self.time)
        assert self.pings.round_trip() == inf
        self.time.run()

    def add_header_callback(self, callback: Callable[[CRTPPacket], None], port: int, channel: int) -> None:
        """As cflib's."""
        assert (port, channel) == (CRTPPort.LINKCTRL, 0)
        self.answered = callback

    def transmit(self, packet: CRTPPacket) -> None:
        """Takes it."""
        self.sent.append(packet)
        way = self.way(len(self.sent))
        if way is not None:
            self.under_way.append((self.time.now + way, packet))

    def _deliver(self, now: float) -> None:
        for due, packet in [flight for flight in self.under_way if flight[0] <= now + 1e-9]:
            self.under_way.remove((due, packet))
            self.answered(packet)
            self.answered(CFLIB)
            self.answered(packet)  # a double
        self.seen.append(self.pings.round_trip())


def test_it_is_the_time_from_a_ping_to_its_own_answer() -> None:
    drone = Drone(3.0, lambda _number: 4.0 * PERIOD_S)
    assert drone.seen[-1] == pytest.approx(4.0 * PERIOD_S)
    assert len({bytes(packet.data) for packet in drone.sent}) == len(drone.sent), "each has its number"


def test_one_answer_that_is_held_up_says_nothing_and_three_do() -> None:
    held_up = Drone(5.0, lambda number: (5.0 if number == 20 else 1.0) * PERIOD_S)
    assert max(held_up.seen[1:]) == pytest.approx(PERIOD_S)
    slower = Drone(5.0, lambda number: (5.0 if number >= 20 else 1.0) * PERIOD_S)
    assert slower.seen[-1] == pytest.approx(5.0 * PERIOD_S)


def test_it_grows_where_no_answer_comes_any_more() -> None:
    drone = Drone(5.0, lambda number: PERIOD_S if number <= 20 else None)
    assert drone.seen[-1] == pytest.approx(3.0, abs=4.0 * PERIOD_S)
    assert min(np.diff(drone.seen)) > -1e-9


def test_single_losses_do_not_matter() -> None:
    drone = Drone(5.0, lambda number: None if number % 3 else PERIOD_S)
    assert max(drone.seen[3:]) <= 1.01 * PERIOD_S


def test_of_a_link_it_has_the_delay_of_the_downlink(tiny: TinyDrone) -> None:
    with (
        FaultyNetwork(tiny.port, np.random.default_rng(1), Faults()) as network,
        patient_link(network.uri) as link,
    ):
        until(lambda: link.round_trip() < inf)
        network.faults = Faults(downlink=0.4)
        until(lambda: link.round_trip() >= 0.4)


def test_a_drone_that_answers_no_ping_is_far_away(tiny: TinyDrone, link: DroneLink) -> None:
    until(lambda: link.round_trip() < inf)
    tiny.drop = lambda request: request[0] & 0xF3 == 0xF0
    until(lambda: link.round_trip() > 1.0)
