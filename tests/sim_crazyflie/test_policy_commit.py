"""Policies staged in the simulated drone's memory and committed there: taken whole, or refused by name."""

import struct
import zlib

import pytest

from onboard.app_interface import RECORD_ADDRESS, Log, Parameter, PolicyStatus
from onboard.policy.bundle import bundle_crc32, encode_bundle
from onboard.ring import RING_BYTES
from onboard.room import RoomGeometry
from tests.sim_crazyflie.simulated_flight import Flight
from tests.sim_crazyflie.small_policy import small_policy

pytestmark = pytest.mark.usefixtures("either_engine")

BUNDLE = encode_bundle(small_policy())
NUMBERS_OFFSET = 24  # gamma, the first number of the header


def damaged(offset: int, raw: bytes, seal: bool = True) -> bytes:
    """The bundle with other bytes at `offset`; `seal`: with the header's checksum put right again."""
    data = bytearray(BUNDLE)
    data[offset : offset + len(raw)] = raw
    if seal:
        data[12:16] = struct.pack("<L", zlib.crc32(data[16:], zlib.crc32(data[:12])))
    return bytes(data)


def commit(flight: Flight, data: bytes, length: int | None = None, crc: int | None = None) -> PolicyStatus:
    """Stage `data` and commit it with these words about it."""
    memory = flight.firmware.memories[1]
    for address in range(0, len(data), 24):
        assert memory.write(address, data[address : address + 24])
    flight.write(Parameter.POLICY_LENGTH, len(data) if length is None else length)
    flight.write(Parameter.POLICY_CRC, bundle_crc32(data) if crc is None else crc)
    flight.write(Parameter.POLICY_COMMIT, 1)
    return PolicyStatus(int(flight.param(Parameter.POLICY_STATUS)))


def test_commit_makes_the_policy_live_and_readable() -> None:
    flight = Flight()
    assert commit(flight, BUNDLE) is PolicyStatus.ACTIVE
    assert flight.param(Parameter.POLICY_ACTIVE_CRC) == zlib.crc32(BUNDLE)
    assert flight.log("perch.polCrc") == zlib.crc32(BUNDLE)
    assert flight.log("perch.polStat") == PolicyStatus.ACTIVE
    assert flight.param(Parameter.POLICY_COMMIT) == 0
    memory = flight.firmware.memories[1]
    assert (memory.type_id, memory.size) == (0x18, RECORD_ADDRESS + RING_BYTES)
    assert memory.read(0, len(BUNDLE)) == BUNDLE


@pytest.mark.parametrize(
    ("data", "length", "crc", "status"),
    [
        (BUNDLE, 0, None, PolicyStatus.REFUSED_LENGTH),
        (BUNDLE, 8193, None, PolicyStatus.REFUSED_LENGTH),
        (BUNDLE, len(BUNDLE) - 4, bundle_crc32(BUNDLE[:-4]), PolicyStatus.REFUSED_LENGTH),
        (BUNDLE, None, 0x12345678, PolicyStatus.REFUSED_CRC),
        (damaged(100, b"\x01", seal=False), None, None, PolicyStatus.REFUSED_CRC),
        (damaged(0, b"NOPE"), None, None, PolicyStatus.REFUSED_FORMAT),
        (damaged(4, b"\x09"), None, None, PolicyStatus.REFUSED_FORMAT),
        (damaged(18, struct.pack("<H", 251)), None, None, PolicyStatus.REFUSED_VECTORS),
        (damaged(NUMBERS_OFFSET, struct.pack("<f", float("nan"))), None, None, PolicyStatus.REFUSED_RANGE),
        (damaged(NUMBERS_OFFSET + 36, bytes(4)), None, None, PolicyStatus.REFUSED_RANGE),
    ],
    ids=[
        "empty",
        "too-long",
        "cut",
        "other-crc",
        "flipped-byte",
        "magic",
        "version",
        "251-vectors",
        "nan",
        "zero-scale",
    ],
)
def test_refused_commit_keeps_the_previous_policy(
    data: bytes, length: int | None, crc: int | None, status: PolicyStatus
) -> None:
    flight = Flight()
    other = encode_bundle(small_policy(a_rot=-6e-3))
    assert commit(flight, other) is PolicyStatus.ACTIVE
    assert commit(flight, data, length, crc) is status
    assert flight.param(Parameter.POLICY_ACTIVE_CRC) == zlib.crc32(other)
    assert flight.firmware.app is not None
    assert flight.firmware.engine.has_policy


def test_nothing_is_accepted_while_flying() -> None:
    flight = Flight()
    assert commit(flight, BUNDLE) is PolicyStatus.ACTIVE
    flight.hover()
    assert not flight.firmware.memories[1].write(0, b"123")
    assert flight.firmware.memories[1].read(0, 4) == BUNDLE[:4]
    flight.write(Parameter.POLICY_COMMIT, 1)
    assert flight.param(Parameter.POLICY_STATUS) == PolicyStatus.REFUSED_FLYING
    assert flight.param(Parameter.POLICY_ACTIVE_CRC) == zlib.crc32(BUNDLE)


def test_a_policy_that_is_not_there_cannot_be_armed() -> None:
    flight = Flight()
    flight.write(Parameter.POLICY_ARM, 1)
    assert flight.param(Parameter.POLICY_ARM) == 0


def test_what_is_staged_after_a_commit_stays_there() -> None:
    """Two drones of the same seed decide alike, though one has its staged bytes overwritten."""

    def decision(overwritten: bool) -> tuple[float, float]:
        flight = Flight()
        flight.write(Parameter.CEILING_Z, RoomGeometry().ceiling_z)
        assert flight.upload(BUNDLE) == PolicyStatus.ACTIVE
        if overwritten:
            assert flight.firmware.memories[1].write(NUMBERS_OFFSET, bytes(24))
        flight.run(0.1)
        return flight.log(Log.TRIGGER_VALUE), flight.log(Log.A_ROT)

    assert decision(True) == decision(False)
    assert decision(True)[1] == pytest.approx(-5.5e-3)
