"""The smallest UDP peer that cflib fully connects to: a few variables, one memory, the perching app's
parameters.

Written from the byte tables of the protocol only, without code of the link or of the simulated drone, so that
it can judge both ends. Faults are put in by hand: ``answers(request) -> replies`` can be wrapped, packets
dropped by a filter.
"""

import socket
import struct
import threading
import zlib
from collections.abc import Callable

from onboard.closing import Closing

PARAMETERS: list[tuple[str, int, str, float]] = [
    ("perch.version", 0x48, "<B", 2),
    ("perch.polLen", 0x09, "<H", 0),
    ("perch.polCrc", 0x0A, "<I", 0),
    ("perch.polCommit", 0x08, "<B", 0),
    ("perch.polStat", 0x48, "<B", 0),
    ("perch.polActCrc", 0x4A, "<I", 0),
    ("perch.polArm", 0x08, "<B", 0),
    ("perch.trjArm", 0x08, "<B", 0),
    ("perch.trjStat", 0x48, "<B", 0),
    ("perch.go", 0x08, "<B", 0),
    ("perch.abort", 0x08, "<B", 0),
    ("perch.zCeil", 0x06, "<f", 0),
    ("perch.xImp", 0x06, "<f", 0),
    ("perch.yImp", 0x06, "<f", 0),
    ("perch.vx", 0x06, "<f", 0),
    ("perch.vz", 0x06, "<f", 0),
    ("perch.ax", 0x06, "<f", 0),
    ("perch.az", 0x06, "<f", 0),
    ("perch.tau0", 0x06, "<f", 0),
    ("perch.state", 0x48, "<B", 0),
    ("perch.vehCrc", 0x4A, "<I", 0x1234),
    ("perch.ownLaw", 0x08, "<B", 0),
    ("stabilizer.estimator", 0x18, "<B", 2),
    ("ring.solid", 0x06, "<f", 0.25),
    ("motion.offset", 0x01, "<h", -3),
]
LOGS: list[tuple[str, int, str]] = [
    ("stateEstimate.x", 7, "<f"),
    ("stateEstimate.z", 7, "<f"),
    ("pm.vbatMV", 2, "<H"),
    ("supervisor.info", 2, "<H"),
]
MEMORY_TYPE, MEMORY_SIZE = 0x18, 8192


class TinyDrone(Closing):
    """Serves CRTP on ``port`` (``uri``) until closed; log blocks are sent when the test says so."""

    def __init__(self) -> None:
        self.values = {name: value for name, _, _, value in PARAMETERS}
        self.memory = bytearray(MEMORY_SIZE)
        self.supervisor_bits = 0x0001
        self.armable = True
        self.commander_errno = 0
        self.memory_status = 0
        self.protocol_version = 12
        self.requests: list[bytes] = []
        self.blocks: dict[int, list[int]] = {}
        self.frozen = threading.Event()
        self.drop: Callable[[bytes], bool] = lambda _request: False
        self.copies: Callable[[bytes], int] = lambda _reply: 1
        self.peer: tuple[str, int] | None = None
        self.clients: set[tuple[str, int]] = set()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.02)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="TinyDrone")
        self._thread.start()

    @property
    def port(self) -> int:
        """UDP port."""
        return int(self._socket.getsockname()[1])

    @property
    def uri(self) -> str:
        """Address for a link."""
        return f"udp://127.0.0.1:{self.port}"

    def push(self, packet: bytes) -> None:
        """Send a packet that nobody asked for."""
        if self.peer is not None:
            self._socket.sendto(packet, self.peer)

    def push_log(self, block: int, time_ms: int, values: bytes) -> None:
        """Send one sample."""
        self.push(b"\x52" + bytes((block,)) + (time_ms & 0xFFFFFF).to_bytes(3, "little") + values)

    def count(self, header: int) -> int:
        """How many packets with this header (port << 4 | channel) came."""
        return sum(request[0] & 0xF3 == header for request in self.requests)

    def close(self) -> None:
        """Stop answering and free the port."""
        self._closing.set()
        self._thread.join()
        self._socket.close()

    def _serve(self) -> None:
        while not self._closing.is_set():
            try:
                packet, self.peer = self._socket.recvfrom(64)
            except (TimeoutError, ConnectionRefusedError):
                continue
            self.requests.append(packet)
            self.clients.add(self.peer)
            if self.frozen.is_set() or self.drop(packet):
                continue
            for reply in self.answers(packet[0] & 0xF3, packet[1:]):
                for _ in range(self.copies(reply)):
                    self._socket.sendto(reply, self.peer)

    def answers(self, header: int, data: bytes) -> list[bytes]:
        """Replies to one request, header included."""
        handlers = {
            0xF0: lambda d: [d],
            0xF1: lambda d: [b"Bitcraze Crazyflie".ljust(30, b"\0")],
            0xD1: lambda d: [b"\0" + struct.pack("<I", self.protocol_version)],
            0x50: lambda d: [_table(d, [(n, t) for n, t, _ in LOGS], 0x1111)],
            0x51: self._log_settings,
            0x20: lambda d: [_table(d, [(n, t) for n, t, _, _ in PARAMETERS], 0x2222)],
            0x21: lambda d: [d[:2] + b"\0" + self._value(*struct.unpack("<H", d[:2]))],
            0x22: self._set,
            0x23: lambda d: [d[:3] + b"\0\0"],
            0x40: self._memory_info,
            0x41: self._memory_read,
            0x42: self._memory_write,
            0x80: lambda d: [d[:3].ljust(3, b"\xaa") + bytes((self.commander_errno,))],
            0x90: lambda d: [b"\x8c" + struct.pack("<H", self.supervisor_bits)],
            0x91: self._supervisor_command,
            0xF3: lambda d: [d],
        }
        handler = handlers.get(header)
        return [] if handler is None else [bytes((header,)) + reply for reply in handler(data)]

    def _value(self, ident: int) -> bytes:
        name, _, form, _ = PARAMETERS[ident]
        return struct.pack(form, self.values[name])

    def _set(self, data: bytes) -> list[bytes]:
        name, code, form, _ = PARAMETERS[struct.unpack("<H", data[:2])[0]]
        if code & 0x40:
            return []
        self.values[name] = struct.unpack(form, data[2:])[0]
        if name == "perch.polCommit":
            self._commit()
        return [data]

    def _commit(self) -> None:
        staged = bytes(self.memory[: int(self.values["perch.polLen"])])
        good = zlib.crc32(staged) == self.values["perch.polCrc"]
        if staged[:4] == b"BAD!":
            self.values["perch.polStat"] = 18
        elif good:
            self.values["perch.polStat"], self.values["perch.polActCrc"] = 1, zlib.crc32(staged)
        else:
            self.values["perch.polStat"] = 17

    def _memory_info(self, data: bytes) -> list[bytes]:
        if data[0] == 1:
            return [b"\x01\x01"]
        return [b"\x02" + data[1:2] + bytes((MEMORY_TYPE,)) + struct.pack("<I", MEMORY_SIZE) + bytes(8)]

    def _memory_read(self, data: bytes) -> list[bytes]:
        address, length = struct.unpack("<IB", data[1:6])
        return [data[:5] + b"\0" + bytes(self.memory[address : address + length])]

    def _memory_write(self, data: bytes) -> list[bytes]:
        (address,) = struct.unpack("<I", data[1:5])
        if self.memory_status == 0:
            self.memory[address : address + len(data) - 5] = data[5:]
        return [data[:5] + bytes((self.memory_status,))]

    def _log_settings(self, data: bytes) -> list[bytes]:
        command = data[0]
        if command == 5:
            self.blocks.clear()
            return [b"\x05\0\0"]
        block = data[1]
        status = 0
        if command == 6:
            status = 17 if block in self.blocks else 0
            self.blocks.setdefault(
                block, [struct.unpack("<H", data[i + 1 : i + 3])[0] for i in range(2, len(data), 3)]
            )
        elif command == 2:
            status = 0 if self.blocks.pop(block, None) is not None else 2
        elif block not in self.blocks:
            status = 2
        return [bytes((command, block, status))]

    def _supervisor_command(self, data: bytes) -> list[bytes]:
        if data[0] == 1:
            if self.armable:
                self.supervisor_bits = self.supervisor_bits & ~2 | (2 if data[1] else 0)
            return [bytes((0x81, self.armable, bool(self.supervisor_bits & 2)))]
        if data[0] == 3:
            self.supervisor_bits |= 0x40
        return [b"\x82\x01\x01"] if data[0] == 2 else []


def _table(data: bytes, entries: list[tuple[str, int]], crc: int) -> bytes:
    if data[0] == 3:
        return b"\x03" + struct.pack("<HI", len(entries), crc) + (b"\x10\x80" if crc == 0x1111 else b"")
    (ident,) = struct.unpack("<H", data[1:3])
    name, code = entries[ident]
    return data[:3] + bytes((code,)) + name.replace(".", "\0").encode() + b"\0"
