"""The modelled radio: how much passes, what is lost, and when the firmware's reception asserts."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.link import DroneLink
from perchhw.lab_process import SimulatedLab
from sim_backend.crazyflie.crtp import Packet, Port
from sim_backend.crazyflie.interfaces import FirmwareAssertion
from sim_backend.crazyflie.radio_channel import DRONE_QUEUE, HOST_QUEUE, LATENCY_S, RATE_HZ, RadioChannel
from sim_backend.crazyflie.reception import PORT_QUEUE, RECEPTION_QUEUE, Reception
from tests.patience import patient_uri

READ = Packet(Port.PARAM, 1, b"\0\0")
POSE = Packet(Port.LOCALIZATION, 1, b"\x08" + bytes(28))
ECHO = Packet(Port.LINK, 0, b"\0")


def arrivals(channel: RadioChannel, way: str, sends: list[float], until: float) -> list[tuple[float, int]]:
    """When the packet of each number arrives, polled every 2 ms as a lab does; sent at `sends` [s]."""
    arrived: list[tuple[float, int]] = []
    came: list[int] = []
    numbered = list(enumerate(sends))
    for step in range(round(until / 0.002) + 1):
        now = 0.002 * step
        while numbered and numbered[0][1] <= now:
            number, _ = numbered.pop(0)
            getattr(channel, way)(now, partial(came.append, number))
        channel.move(now)
        arrived += [(now, number) for number in came]
        came.clear()
    return arrived


@pytest.mark.parametrize("way", ["up", "down"])
def test_no_more_than_its_rate_passes_in_order(way: str) -> None:
    channel = RadioChannel(np.random.default_rng(1))
    got = arrivals(channel, way, [step / 540.0 for step in range(540)], 1.0)
    assert [number for _, number in got] == sorted({number for _, number in got})
    assert RATE_HZ * 0.98 <= len(got) <= RATE_HZ + 1


def test_what_the_radio_carries_is_not_held_up() -> None:
    """240 packets a second, as a landing asks for: none is lost or waits for more than a burst takes."""
    channel = RadioChannel(np.random.default_rng(1))
    sends = sorted([step / 100 for step in range(100)] * 2 + [step / 20 for step in range(20)] * 3)
    got = arrivals(channel, "down", sends, 1.1)
    assert len(got) == len(sends)
    assert max(at - sends[number] for at, number in got) < 5 / RATE_HZ + LATENCY_S[1] + 0.005


def test_a_full_queue_loses_what_comes_then() -> None:
    channel = RadioChannel(np.random.default_rng(1))
    for _ in range(DRONE_QUEUE):
        assert channel.has_room
        channel.down(0.0, lambda: None)
    assert not channel.has_room
    got = arrivals(channel, "down", [0.0], 1.0)
    assert got == [], "there was no place for it"
    got = arrivals(RadioChannel(np.random.default_rng(1)), "up", [0.0] * (HOST_QUEUE + 7), 1.0)
    assert len(got) == HOST_QUEUE


@given(st.integers(0, 2**32 - 1))
def test_the_same_seed_gives_the_same_times(seed: int) -> None:
    sends = [step / 200.0 for step in range(20)]
    first, second = (arrivals(RadioChannel(np.random.default_rng(seed)), "down", sends, 0.2) for _ in "12")
    assert first == second


class Drone:
    """A firmware that answers into a queue with room, or without."""

    def __init__(self) -> None:
        self.room = 0
        self.worked: list[Packet] = []
        self.reception = Reception(lambda: self.room > 0, self._work)

    def _work(self, packet: Packet) -> None:
        self.worked.append(packet)
        if packet.port in (Port.PARAM, Port.LINK):
            self.room -= 1


def test_answers_wait_for_room_and_poses_pass() -> None:
    drone = Drone()
    for _ in range(PORT_QUEUE):
        drone.reception.take(READ)
    drone.reception.take(POSE)
    assert drone.worked == [POSE]
    drone.room = 3
    drone.reception.go_on()
    assert drone.worked == [POSE, READ, READ, READ]


def test_a_full_port_holds_up_everything_and_the_sixth_packet_restarts_the_drone() -> None:
    drone = Drone()
    for _ in range(PORT_QUEUE + 1):
        drone.reception.take(READ)
    for _ in range(RECEPTION_QUEUE - 1):
        drone.reception.take(POSE)
    assert drone.worked == []
    with pytest.raises(FirmwareAssertion, match=r"radiolink\.c"):
        drone.reception.take(POSE)
    drone.reception.clear()
    drone.reception.take(POSE)
    assert drone.worked == [POSE]


def test_an_echo_that_cannot_be_answered_holds_up_poses() -> None:
    drone = Drone()
    drone.reception.take(ECHO)
    drone.reception.take(POSE)
    assert drone.worked == []
    drone.room = 1
    drone.reception.go_on()
    assert drone.worked == [ECHO, POSE]


def test_the_link_connects_over_the_modelled_radio() -> None:
    with (
        SimulatedLab("drone", ("--drone-port", "0", "--radio")) as lab,
        DroneLink.open(patient_uri(lab.drones[0])) as link,
    ):
        assert link.param("stabilizer.estimator") == 2
        assert link.silence() < 120.0
