"""A lab that runs faster than the wall's clock: by which of the two a client is still there."""

import asyncio
import socket
import struct

import pytest

from sim_backend.crazyflie import server
from sim_backend.lab import LabServer, LabSettings
from sim_backend.pace import REAL, Pace
from tests.patience import StandingClock

CREATE, START = (
    bytes((0x51, 6, 1)) + struct.pack("<BH", 7, 0),
    bytes((0x51, 8, 1)) + struct.pack("<H", 100),
)
LOG_DATA = bytes((0x52, 1))
FASTER = Pace(10.0, waits=True)


@pytest.mark.parametrize(
    ("pace", "takes_part", "wall_s", "kept"),
    [
        pytest.param(FASTER, False, 60.0, True, id="cflib asks ten times a second of its own"),
        pytest.param(FASTER, False, 0.0, False, id="a client that has gone"),
        pytest.param(FASTER, True, 60.0, False, id="who takes part lives by the lab's time"),
        pytest.param(REAL, False, 60.0, False, id="a lab in real time has one clock"),
    ],
)
def test_log_blocks_go_on_as_long_as_their_client_is_there_by_its_own_clock(
    pace: Pace, takes_part: bool, wall_s: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "ACTIVITY_TIMEOUT_S", wall_s)
    assert asyncio.run(_logs_after_two_seconds(pace, takes_part)) is kept


async def _logs_after_two_seconds(pace: Pace, takes_part: bool) -> bool:
    clock = StandingClock()
    lab = LabServer(LabSettings(drone_port=0, with_room=False, parked=True, pace=pace), clock)
    lab.load()
    await lab.start()
    (drone,) = lab.servers
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.connect(drone.address)
        if takes_part:
            lab._traffic.belongs_to_participant(f"udp:{client.getsockname()[1]}")
        try:
            client.send(CREATE)
            client.send(START)
            while sum(drone.received.values()) < 2:
                await asyncio.sleep(0.0)
            for _ in range(50):
                clock.now += 0.04
                lab.round()
            return _log_data(client) == 20
        finally:
            await lab.close()


def _log_data(client: socket.socket) -> int:
    client.setblocking(False)
    count = 0
    while True:
        try:
            count += client.recv(64)[:2] == LOG_DATA
        except BlockingIOError:
            return count
