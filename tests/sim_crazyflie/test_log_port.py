"""The log port byte by byte, over a real socket, against what the firmware's source says."""

import math
import struct

import numpy as np
import pytest

from sim_backend.crazyflie.ports.log import encoder
from sim_backend.crazyflie.toc import LogType
from tests.sim_crazyflie.minimal_firmware import (
    MinimalFirmware,
    RawClient,
    ServedFirmware,
    SteppedClock,
    serve,
)

LOG = 5


def log_entry(drone: ServedFirmware, name: str, wanted: int | None = None) -> bytes:
    entry = drone.firmware.logs.entry(name)
    return struct.pack("<BH", (entry.type if wanted is None else wanted) | entry.type << 4, entry.ident)


class TestLog:
    def test_table(self, client: RawClient, drone: ServedFirmware) -> None:
        logs = drone.firmware.logs
        assert client.ask(LOG, 0, b"\3") == [struct.pack("<BHIBB", 3, len(logs), logs.crc, 16, 128)]
        ident = struct.pack("<H", logs.entry("stabilizer.roll").ident)
        assert client.ask(LOG, 0, b"\2" + ident) == [
            b"\2" + ident + b"\7stabilizer\0roll\0"
        ]  # type without flags
        assert client.ask(LOG, 0, b"\2\xff\xff") == [b"\2"]

    def test_errors(self, client: RawClient, drone: ServedFirmware) -> None:
        roll, counter = log_entry(drone, "stabilizer.roll"), log_entry(drone, "radio.rssi")
        assert client.ask(LOG, 1, b"\6\1" + roll) == [b"\6\1\0"]
        assert client.ask(LOG, 1, b"\6\1" + roll) == [b"\6\1\x11"]  # EEXIST
        assert client.ask(LOG, 1, b"\7\2" + roll) == [b"\7\2\2"]  # ENOENT
        assert client.ask(LOG, 1, b"\7\1" + b"\x77\xf0\xf0") == [b"\7\1\2"]
        assert client.ask(LOG, 1, b"\7\1" + roll * 6) == [b"\7\1\7"]  # E2BIG: 24 of 26 bytes used
        assert client.ask(LOG, 1, b"\7\1" + counter * 2) == [b"\7\1\0"]
        assert client.ask(LOG, 1, b"\7\1" + counter) == [b"\7\1\7"]
        assert client.ask(LOG, 1, b"\x09\1") == [b"\x09\1\x08"]  # ENOEXEC
        for command in (2, 3, 4, 8):
            assert client.ask(LOG, 1, bytes([command, 9, 0])) == [bytes([command, 9, 2])]
        assert client.ask(LOG, 1, b"\2\1") == [b"\2\1\0"]
        assert client.ask(LOG, 1, b"\5") == [b"\5\0\0"]

    def test_limits_of_blocks_and_variables(self, client: RawClient, drone: ServedFirmware) -> None:
        counter = log_entry(drone, "radio.rssi")
        for block in range(16):
            assert client.ask(LOG, 1, bytes([6, block]) + counter * 8) == [bytes([6, block, 0])]
        assert client.ask(LOG, 1, b"\6\x20") == [b"\6\x20\x0c"]  # ENOMEM: 16 blocks
        assert client.ask(LOG, 1, b"\7\0" + counter) == [b"\7\0\x0c"]  # ENOMEM: 128 variables
        assert client.ask(LOG, 1, b"\2\0") == [b"\2\0\0"]
        assert client.ask(LOG, 1, b"\6\x20" + counter) == [b"\6\x20\0"]

    def test_data_single_shot_and_types(self, client: RawClient, drone: ServedFirmware) -> None:
        drone.firmware.logs.bind("stabilizer.roll", lambda: -1.5)
        drone.firmware.logs.bind("memTst.errCntW", lambda: 0x80000001)
        roll = [log_entry(drone, "stabilizer.roll", wanted) for wanted in (7, 8, 4)]
        errors = [log_entry(drone, "memTst.errCntW", wanted) for wanted in (3, 1, 7)]
        assert client.ask(LOG, 1, b"\6\1" + b"".join(roll + errors)) == [b"\6\1\0"]
        client.socket.send(b"\x51\3\1\0")
        data = client.wait_for(LOG, 2)
        assert data[0] == 1
        assert struct.unpack("<febIBf", data[4:]) == (-1.5, -1.5, -1, 0x80000001, 1, -(2.0**31))

    def test_period_and_time_stamps(self) -> None:
        clock = SteppedClock()
        firmware = MinimalFirmware(clock=clock)
        with serve(firmware) as drone, RawClient(drone.uri) as client:
            clock.set_ms(1000)
            client.ask(LOG, 1, b"\6\1" + log_entry(drone, "supervisor.info"))
            for start, period in ((b"\3\1\1", 10), (b"\x08\1\x07\0", 7)):
                began = firmware.tick_ms()
                client.ask(LOG, 1, start)
                for index in range(1, 20):
                    clock.set_ms(began + index * period)
                    stamp = int.from_bytes(client.wait_for(LOG, 2)[1:4], "little")
                    assert stamp == began + index * period
                client.ask(LOG, 1, b"\4\1")

    def test_a_late_block_sends_once_and_keeps_its_phase(self) -> None:
        clock = SteppedClock()
        with serve(MinimalFirmware(clock=clock)) as drone, RawClient(drone.uri) as client:
            client.ask(LOG, 1, b"\6\1" + log_entry(drone, "supervisor.info"))
            client.ask(LOG, 1, b"\3\1\1")
            for now in (35, 40, 50):
                clock.set_ms(now)
                assert int.from_bytes(client.wait_for(LOG, 2)[1:4], "little") == now

    @pytest.mark.parametrize(
        ("value", "stored", "wanted", "expected"),
        [
            (300, LogType.U8, 1, b"\x2c"),
            (-1, LogType.I16, 2, b"\xff\xff"),
            (3e9, LogType.FLOAT, 6, struct.pack("<i", 2**31 - 1)),
            (math.nan, LogType.FLOAT, 3, bytes(4)),
            (1e39, LogType.FLOAT, 7, struct.pack("<f", math.inf)),
            (1e39, LogType.FLOAT, 8, b"\0\x7c"),
            (-1e6, LogType.FLOAT, 8, b"\0\xfc"),
            (math.nan, LogType.FLOAT, 8, b"\0\x7e"),
            (1e-5, LogType.FLOAT, 8, b"\0\0"),
            (1.0, LogType.FLOAT, 0, b""),
            (1.0, LogType.FLOAT, 15, b""),
        ],
    )
    def test_conversion(self, value: float, stored: LogType, wanted: int, expected: bytes) -> None:
        assert encoder(stored, wanted)(value) == expected

    def test_half_precision_is_that_of_numpy(self) -> None:
        values = np.random.default_rng(1).normal(0, 100, 500).astype(np.float32)
        ours = np.array([struct.unpack("<e", encoder(LogType.FLOAT, 8)(float(v)))[0] for v in values])
        assert np.allclose(ours, values.astype(np.float16), rtol=2**-10)
