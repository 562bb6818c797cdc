"""A lab in real time on a machine that lets it sleep: what clients log stays whole."""

import asyncio
import socket
import struct

from sim_backend.lab import LabServer, LabSettings
from tests.patience import StandingClock

CREATE, START = (
    bytes((0x51, 6, 1)) + struct.pack("<BH", 7, 0),
    bytes((0x51, 8, 1)) + struct.pack("<H", 10),
)
LOG_DATA = bytes((0x52, 1))


def test_a_lab_that_slept_sends_every_sample_of_a_log_block() -> None:
    asyncio.run(_sleep_and_count())


async def _sleep_and_count() -> None:
    clock = StandingClock()
    lab = LabServer(LabSettings(drone_port=0, with_room=False, parked=True), clock)
    lab.load()
    await lab.start()
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.setblocking(False)
    client.connect(lab.servers[0].address)
    try:
        client.send(CREATE)
        client.send(START)
        while sum(lab.servers[0].received.values()) < 2:
            await asyncio.sleep(0.0)
        clock.now += 0.041
        lab.round()
        times = [int.from_bytes(p[2:5], "little") for p in _arrived(client) if p[:2] == LOG_DATA]
    finally:
        client.close()
        await lab.close()
    assert [later - times[0] for later in times] == [0, 10, 20, 30]


def _arrived(client: socket.socket) -> list[bytes]:
    packets = []
    while True:
        try:
            packets.append(client.recv(64))
        except BlockingIOError:
            return packets
