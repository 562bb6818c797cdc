"""Every port but the log's byte by byte, over a real socket, against what the firmware's source says."""

import math
import struct

import numpy as np
import pytest

from sim_backend.crazyflie.ports.localization import decompress_quaternion
from tests.patience import until
from tests.sim_crazyflie.minimal_firmware import (
    RawClient,
    ServedFirmware,
)

CONSOLE, PARAM, SETPOINT, MEMORY, LOCALIZATION, GENERIC, HIGH_LEVEL, SUPERVISOR = 0, 2, 3, 4, 6, 7, 8, 9
PLATFORM, LINK = 13, 15


def param_id(drone: ServedFirmware, name: str) -> bytes:
    return struct.pack("<H", drone.firmware.params.entry(name).ident)


class TestLinkAndPlatform:
    def test_source_echo_sink(self, client: RawClient) -> None:
        assert client.ask(LINK, 1, b"\0") == [b"Bitcraze Crazyflie" + bytes(12)]
        assert client.ask(LINK, 0, b"hello") == [b"hello"]
        assert client.ask(LINK, 2, b"hello") == []

    def test_versions(self, client: RawClient) -> None:
        assert client.ask(PLATFORM, 1, b"\0") == [b"\0" + struct.pack("<I", 12)]
        assert client.ask(PLATFORM, 1, b"\1")[0].startswith(b"\x012026.08")
        assert client.ask(PLATFORM, 1, b"\2") == [b"\2Crazyflie 2.1"]
        assert client.ask(PLATFORM, 1, b"\3") == []

    def test_legacy_arming_and_recovery(self, client: RawClient) -> None:
        assert client.ask(PLATFORM, 0, b"\1\1") == [b"\1\1\1"]
        assert client.ask(PLATFORM, 0, b"\1") == [b"\1\0\1"]
        assert client.ask(PLATFORM, 0, b"\1\0") == [b"\1\1\0"]
        assert client.ask(PLATFORM, 0, b"\2") == [b"\2\1\1"]
        assert client.ask(PLATFORM, 0, b"\3\1") == [b""]
        assert client.ask(PLATFORM, 0, b"\x7fabc") == [b"\x7fabc"]

    def test_ports_without_a_service_are_silent(self, client: RawClient) -> None:
        for port in (0, 1, 10, 11, 12, 14):
            for channel in range(4):
                assert client.ask(port, channel, b"\1\2\3") == []


class TestConsole:
    def test_boot_messages_wait_for_a_client_and_keep_to_packets(self, client: RawClient) -> None:
        client.socket.send(b"\xff")  # a poll does not make a peer
        assert client.receive().is_null
        client.socket.send(b"\xf0echo")
        text = b"".join(client.wait_for(CONSOLE, 0) for _ in range(4))
        assert text == b"SYS: Crazyflie 2.1 is up and running!\nSYS: a line that is longer than one packet\n"


class TestParam:
    def test_table(self, client: RawClient, drone: ServedFirmware) -> None:
        params = drone.firmware.params
        assert client.ask(PARAM, 0, b"\3") == [struct.pack("<BHI", 3, len(params), params.crc)]
        assert client.ask(PARAM, 0, b"\2\0\0") == [b"\2\0\0\x08radiotest\0channel\0"]
        assert client.ask(PARAM, 0, b"\2" + param_id(drone, "deck.bcAI"))[0][3] == 0x68
        assert client.ask(PARAM, 0, b"\2\xff\xff") == [b"\2"]

    def test_read(self, client: RawClient, drone: ServedFirmware) -> None:
        ident = param_id(drone, "ring.fadeTime")
        assert client.ask(PARAM, 1, ident) == [ident + b"\0" + struct.pack("<f", 0.5)]
        assert client.ask(PARAM, 1, b"\xff\xff") == [b"\xff\xff\2"]

    def test_write_is_echoed_and_called_back_after_the_reply(
        self, client: RawClient, drone: ServedFirmware
    ) -> None:
        written: list[float] = []
        params = drone.firmware.params

        def accepted(value: float) -> None:
            written.append(value)
            params["perch.go"] = 0

        drone.call(lambda: params.on_write("perch.go", accepted))
        ident = param_id(drone, "perch.go")
        client.socket.send(b"\x2e" + ident + b"\1")
        assert client.receive_param() == (2, ident + b"\1")
        assert client.receive_param() == (3, b"\1" + ident + b"\0")  # what the firmware set itself
        assert written == [1]

    def test_write_refusals(self, client: RawClient, drone: ServedFirmware) -> None:
        assert client.ask(PARAM, 2, b"\xff\xff\1") == [b"\xff\xff\2"]
        assert client.ask(PARAM, 2, param_id(drone, "deck.bcAI") + b"\1") == []
        assert drone.firmware.params["deck.bcAI"] == 0

    @pytest.mark.parametrize(
        ("group", "name", "type_", "value", "error"),
        [
            (b"ring", b"effect", 8, b"\5", 0),
            (b"ring", b"effect", 9, b"\5", 22),
            (b"deck", b"bcAI", 8, b"\1", 13),
            (b"ring", b"nothing", 8, b"\1", 2),
        ],
    )
    def test_set_by_name(
        self,
        client: RawClient,
        drone: ServedFirmware,
        group: bytes,
        name: bytes,
        type_: int,
        value: bytes,
        error: int,
    ) -> None:
        names = group + b"\0" + name + b"\0"
        assert client.ask(PARAM, 3, b"\0" + names + bytes([type_]) + value) == [
            b"\0" + names + bytes([error])
        ]
        assert drone.firmware.params["ring.effect"] == (5 if error == 0 else 6)

    def test_persistence(self, client: RawClient, drone: ServedFirmware) -> None:
        ident = param_id(drone, "ring.effect")
        assert client.ask(PARAM, 3, b"\7" + ident) == [b"\7" + ident + b"\0\1"]
        assert client.ask(PARAM, 3, b"\2" + ident) == [b"\2" + ident + b"\1"]
        assert client.ask(PARAM, 3, b"\4" + ident) == [b"\4" + ident + b"\0\6"]
        assert client.ask(PARAM, 3, b"\5" + ident) == [b"\5" + ident + b"\2"]
        assert client.ask(PARAM, 2, ident + b"\x09") == [ident + b"\x09"]
        assert client.ask(PARAM, 3, b"\3" + ident) == [b"\3" + ident + b"\0"]
        assert client.ask(PARAM, 3, b"\4" + ident) == [b"\4" + ident + b"\1\6\x09"]
        drone.call(drone.firmware.reboot)
        assert client.ask(PARAM, 1, ident) == [ident + b"\0\x09"]
        assert client.ask(PARAM, 3, b"\5" + ident) == [b"\5" + ident + b"\0"]
        assert client.ask(PARAM, 3, b"\x08" + ident) == [b"\x08" + ident + b"\0\6"]
        assert client.ask(PARAM, 3, b"\6" + ident) == [b"\6" + ident + b"\6"]

    def test_persistence_refusals(self, client: RawClient, drone: ServedFirmware) -> None:
        plain, read_only = param_id(drone, "perch.go"), param_id(drone, "perch.polStat")
        for command in (2, 3, 5, 7):
            assert client.ask(PARAM, 3, bytes([command]) + plain) == [bytes([command]) + plain + b"\2"]
        assert client.ask(PARAM, 3, b"\x08" + read_only) == [b"\x08" + read_only + b"\2"]
        for command in (2, 3, 4, 5, 6, 7, 8):
            assert client.ask(PARAM, 3, bytes([command]) + b"\xff\xff") == [bytes([command]) + b"\xff\xff\2"]

    def test_firmware_assertion_in_a_side_effect_reboots(
        self, client: RawClient, drone: ServedFirmware
    ) -> None:
        ident = param_id(drone, "system.doAssert")
        assert client.ask(PARAM, 2, ident + b"\1") == [ident + b"\1"]
        until(lambda: drone.call(lambda: drone.firmware.boot_count) == 2)


class TestMemory:
    def test_information(self, client: RawClient) -> None:
        assert client.ask(MEMORY, 0, b"\1") == [b"\1\5"]
        assert client.ask(MEMORY, 0, b"\2\1") == [b"\2\1\x18" + struct.pack("<I", 8192) + bytes(8)]
        assert client.ask(MEMORY, 0, b"\2\3")[0][2] == 0x15

    def test_write_and_read_back(self, client: RawClient) -> None:
        head = struct.pack("<BI", 1, 8192 - 24)
        assert client.ask(MEMORY, 2, head + bytes(range(24))) == [head + b"\0"]
        assert client.ask(MEMORY, 1, head + b"\x18") == [head + b"\0" + bytes(range(24))]
        assert client.ask(MEMORY, 2, head + bytes(25)) == [head + b"\5"]  # over the end
        assert client.ask(MEMORY, 1, head + b"\x18") == [head + b"\0" + bytes(range(24))]
        assert client.ask(MEMORY, 1, struct.pack("<BIB", 1, 8192, 1)) == [struct.pack("<BI", 1, 8192) + b"\5"]
        assert client.ask(MEMORY, 2, b"\1\0\0") == [b"\1\0\0\0\0\5"]

    def test_refused_while_flying(self, client: RawClient, drone: ServedFirmware) -> None:
        drone.firmware.flying = True
        assert client.ask(MEMORY, 2, b"\1\0\0\0\0abc") == [b"\1\0\0\0\0\5"]
        assert client.ask(MEMORY, 1, b"\1\0\0\0\0\3") == [b"\1\0\0\0\0\0\0\0\0"]

    def test_tester(self, client: RawClient, drone: ServedFirmware) -> None:
        head = struct.pack("<BI", 3, 0x1FE)
        assert client.ask(MEMORY, 1, head + b"\4") == [head + b"\0\xfe\xff\0\1"]
        assert client.ask(MEMORY, 2, head + b"\xfe\xff\0\1") == [head + b"\0"]
        assert client.ask(MEMORY, 2, head + b"\xfe\xff\0\2") == [head + b"\0"]
        assert drone.firmware.logs["memTst.errCntW"] == 1

    @pytest.mark.parametrize(
        "request_", [b"\x40\2\5", b"\x41\5\0\0\0\0\1", b"\x42\5\0\0\0\0\1", b"\x41\3\0\0\0\0\x19"]
    )
    def test_assertions(self, client: RawClient, drone: ServedFirmware, request_: bytes) -> None:
        client.exchange(request_)
        assert len(drone.server.assertions) == 1
        assert drone.firmware.boot_count == 2


class TestLocalization:
    def test_position_and_pose(self, client: RawClient, drone: ServedFirmware) -> None:
        pose = (0.5, -0.25, 1.5, 0.0, 0.0, 0.5, -0.5)
        assert client.ask(LOCALIZATION, 0, struct.pack("<3f", *pose[:3])) == []
        assert client.ask(LOCALIZATION, 1, b"\x08" + struct.pack("<7f", *pose)) == []
        assert drone.firmware.calls == [("position", *pose[:3]), ("pose", *pose)]

    def test_packed_forms_pick_this_drone(self, client: RawClient, drone: ServedFirmware) -> None:
        theirs, ours = struct.pack("<B3h", 0xE6, 1, 1, 1), struct.pack("<B3h", 0xE7, 1500, -250, 32767)
        client.ask(LOCALIZATION, 2, theirs + ours + theirs[:3])
        identity = 3 << 30
        client.ask(LOCALIZATION, 1, b"\x09" + ours + struct.pack("<I", identity))
        position = (1.5, -0.25, 32.767)
        expected = [("position", *position), ("pose", *position, 0.0, 0.0, 0.0, 1.0)]
        assert [call[0] for call in drone.firmware.calls] == [call[0] for call in expected]
        for call, want in zip(drone.firmware.calls, expected, strict=True):
            assert call[1:] == pytest.approx(want[1:])

    def test_too_short_is_ignored(self, client: RawClient, drone: ServedFirmware) -> None:
        client.ask(LOCALIZATION, 0, bytes(11))
        client.ask(LOCALIZATION, 1, b"\x08" + bytes(27))
        client.ask(LOCALIZATION, 1, b"")
        assert drone.firmware.calls == []

    def test_legacy_emergency_stop(self, client: RawClient, drone: ServedFirmware) -> None:
        client.ask(LOCALIZATION, 1, b"\4")
        client.ask(LOCALIZATION, 1, b"\3")
        assert drone.firmware.calls == [("watchdog",)]
        assert drone.firmware.stopped

    def test_answered_types(self, client: RawClient) -> None:
        assert client.ask(LOCALIZATION, 1, b"\2\1abc") == [b"\2\1\0"]
        assert client.ask(LOCALIZATION, 1, b"\x0b\1\0\1\0") == [b"\x0b\1"]

    def test_quaternion_form(self) -> None:
        from cflib.utils.encoding import compress_quaternion

        for quaternion in np.random.default_rng(2).normal(size=(200, 4)):
            quaternion /= np.linalg.norm(quaternion)
            back = np.array(decompress_quaternion(compress_quaternion(quaternion.tolist())))
            assert abs(abs(back @ quaternion) - 1) < 1e-5
        assert math.isnan(decompress_quaternion(0x3FFFFFFF)[0])


class TestSetpoints:
    def test_rpyt_is_filled_up(self, client: RawClient, drone: ServedFirmware) -> None:
        full = struct.pack("<fffH", 1, 2, 3, 4)
        client.ask(SETPOINT, 0, full + b"x")
        client.ask(SETPOINT, 0, full[:12])
        client.ask(SETPOINT, 1, full)
        assert drone.firmware.calls == [("rpyt", full), ("rpyt", full[:12] + b"\0\0")]

    @pytest.mark.parametrize(
        ("kind", "length"),
        [
            *((kind, 16) for kind in (1, 2, 4, 5, 7, 8, 9, 10)),
            (0, 0),
            (0, 5),
            (6, 28),
            (11, 15),
            (12, 3),
            (255, 0),
        ],
    )
    def test_generic_types_of_right_length(
        self, client: RawClient, drone: ServedFirmware, kind: int, length: int
    ) -> None:
        payload = bytes([kind]) + bytes(length)
        client.ask(GENERIC, 0, payload)
        assert drone.firmware.calls == [("generic", payload)]

    @pytest.mark.parametrize(
        "payload", [b"", b"\1", b"\6" + bytes(27), b"\x0a" + bytes(17), b"\3" + bytes(8), b"\3\2" + bytes(8)]
    )
    def test_wrong_length_reboots_the_drone(
        self, client: RawClient, drone: ServedFirmware, payload: bytes
    ) -> None:
        drone.firmware.armed = drone.firmware.flying = True
        client.ask(GENERIC, 0, payload)
        assert not drone.firmware.armed
        assert drone.firmware.boot_count == 2
        assert drone.firmware.calls == []
        assert "setpoint" in drone.server.assertions[0]

    def test_cppm_length_depends_on_its_channels(self, client: RawClient, drone: ServedFirmware) -> None:
        client.ask(GENERIC, 0, b"\3\2" + bytes(12))
        assert drone.firmware.calls == [("generic", b"\3\2" + bytes(12))]

    def test_position_is_filled_up(self, client: RawClient, drone: ServedFirmware) -> None:
        client.ask(GENERIC, 0, b"\7\1")
        assert drone.firmware.calls == [("generic", b"\7\1" + bytes(15))]

    def test_notify_stop(self, client: RawClient, drone: ServedFirmware) -> None:
        client.ask(GENERIC, 1, b"\0\x64\0\0\0")
        client.ask(GENERIC, 1, b"\1")
        assert drone.firmware.calls == [("notify", 100)]
        client.ask(GENERIC, 1, b"\0\x64")
        assert drone.firmware.boot_count == 2


class TestHighLevel:
    def test_reply_echoes_three_bytes_and_errno(self, client: RawClient, drone: ServedFirmware) -> None:
        takeoff = b"\7" + struct.pack("<BffBf", 0, 0.5, 0.0, 1, 2.0)
        assert client.ask(HIGH_LEVEL, 0, takeoff) == [takeoff[:3] + b"\x10"]  # EBUSY
        drone.firmware.armed = True
        assert client.ask(HIGH_LEVEL, 0, takeoff + b"more") == [takeoff[:3] + b"\0"]
        assert drone.firmware.calls[-1] == ("high_level", 7, takeoff[1:])

    @pytest.mark.parametrize("payload", [b"", b"\7\0\0", b"\x0e" + bytes(20), b"\xff"])
    def test_unknown_or_short_is_refused(
        self, client: RawClient, drone: ServedFirmware, payload: bytes
    ) -> None:
        assert client.ask(HIGH_LEVEL, 0, payload) in (
            [payload.ljust(3, b"\0")[:3] + b"\x08"],
            [b"\0\0\0\x08"],
        )
        assert drone.firmware.calls == []


class TestSupervisor:
    def test_arm_and_information(self, client: RawClient) -> None:
        assert client.ask(SUPERVISOR, 0, b"\x0c") == [b"\x8c\1\0"]
        assert client.ask(SUPERVISOR, 1, b"\1\1") == [b"\x81\1\1"]
        assert client.ask(SUPERVISOR, 0, b"\x0c") == [b"\x8c\x0b\0"]
        assert client.ask(SUPERVISOR, 0, b"\2") == [b"\x82\1"]
        assert client.ask(SUPERVISOR, 0, b"\7") == [b"\x87\0"]
        assert client.ask(SUPERVISOR, 0, b"\x0d") == []
        assert client.ask(SUPERVISOR, 0, b"") == []
        assert client.ask(SUPERVISOR, 1, b"\1") == [b"\x81\1\0"]

    def test_emergency_stop(self, client: RawClient, drone: ServedFirmware) -> None:
        assert client.ask(SUPERVISOR, 1, b"\4") == []
        assert client.ask(SUPERVISOR, 1, b"\3") == []
        assert drone.firmware.calls == [("watchdog",)]
        assert client.ask(SUPERVISOR, 1, b"\1\1") == [b"\x81\0\0"]
        assert client.ask(SUPERVISOR, 1, b"\2") == [b"\x82\0\1"]
