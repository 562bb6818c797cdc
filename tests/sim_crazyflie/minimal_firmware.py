"""A small but real firmware behind the CRTP side, and a thread that serves it."""

import asyncio
import errno
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from onboard.supervisor_info import SupervisorBits
from sim_backend.crazyflie.crtp import Packet, Port
from sim_backend.crazyflie.faults import DatagramFaults
from sim_backend.crazyflie.interfaces import FirmwareAssertion, Memory
from sim_backend.crazyflie.memory import DeckMemory, MemoryTester, MemoryType, RamMemory
from sim_backend.crazyflie.server import CrazyflieServer
from sim_backend.crazyflie.tables import LogTable, ParameterTable
from tests.patience import PATIENCE_S


class SteppedClock:
    """A clock that stands still until it is moved."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now

    def set_ms(self, milliseconds: int) -> None:
        """Move to the middle of a millisecond."""
        self.now = (milliseconds + 0.5) / 1000


class MinimalFirmware:
    """Tables, memories and a supervisor that arms; setpoints and measurements are only recorded."""

    def __init__(self, with_app: bool = True, clock: Callable[[], float] = time.monotonic) -> None:
        self.params = ParameterTable.firmware(with_app)
        self.logs = LogTable.firmware(with_app)
        self.tester = MemoryTester()
        self.app_memory = RamMemory(MemoryType.APP, 8192, may_write=lambda: not self.flying)
        self.trajectory_memory = RamMemory(MemoryType.TRAJECTORY, 4096)
        self.memories: Sequence[Memory] = (
            RamMemory(MemoryType.EEPROM, 0x1FFF),
            self.app_memory,
            self.trajectory_memory,
            self.tester,
            DeckMemory(),
        )
        self.boot_count = 0
        self.powered = True
        self.armed = self.flying = self.stopped = False
        self.packets = 0
        self.calls: list[tuple[object, ...]] = []
        self.console: list[str] = []
        self._clock = clock
        self._booted_at = 0.0
        self.logs.bind("memTst.errCntW", lambda: self.tester.write_errors)
        self.logs.bind("supervisor.info", self.info_bits)
        self.params.mirror("memTst.resetW", lambda value: self.tester.reset_write_errors())
        self.params.on_write("system.doAssert", self._do_assert)
        self.reboot()

    @property
    def supervisor(self) -> "MinimalFirmware":
        return self

    @property
    def commander(self) -> "MinimalFirmware":
        return self

    @property
    def localization(self) -> "MinimalFirmware":
        return self

    def tick_ms(self) -> int:
        return int((self._clock() - self._booted_at) * 1000)

    @property
    def is_armed(self) -> bool:
        return self.armed

    @property
    def is_crashed(self) -> bool:
        return False

    def step(self) -> None:
        """What the firmware does each ms: run the callbacks of parameters."""
        try:
            self.params.run_callback()
        except FirmwareAssertion as assertion:
            self.assert_failed(str(assertion))

    def on_packet(self) -> None:
        self.packets += 1

    def battery_voltage(self) -> float:
        return 4.0

    def power_off(self) -> None:
        self.powered = self.armed = self.flying = False

    def reboot(self) -> None:
        self.power_off()
        self.powered, self.stopped = True, False
        self._booted_at = self._clock()
        self.boot_count += 1
        self.params.reset()
        self.params["system.selftestPassed"] = 1
        self.app_memory.clear()
        self.trajectory_memory.clear()
        self.console = [
            "SYS: Crazyflie 2.1 is up and running!\n",
            "SYS: a line that is longer than one packet\n",
        ]

    def assert_failed(self, reason: str) -> None:
        self.reboot()
        self.console.append(f"SYS: Assert failed: {reason}\n")

    def take_console(self) -> list[str]:
        text, self.console = self.console, []
        return text

    def info_bits(self) -> int:
        bits = SupervisorBits(0)
        bits |= SupervisorBits.LOCKED if self.stopped else SupervisorBits.CAN_ARM
        bits |= SupervisorBits.ARMED | SupervisorBits.CAN_FLY if self.armed else bits
        bits |= SupervisorBits.FLYING if self.flying else bits
        return int(bits)

    def arm(self, on: bool) -> bool:
        self.armed = on and not self.stopped
        return self.armed == on

    def recover(self) -> bool:
        return not self.stopped

    def emergency_stop(self) -> None:
        self.stopped, self.armed = True, False

    def kick_emergency_stop_watchdog(self) -> None:
        self.calls.append(("watchdog",))

    def emergency_stop_watchdog(self) -> None:
        self.calls.append(("watchdog",))

    def high_level(self, command: int, payload: bytes) -> int:
        self.calls.append(("high_level", command, payload))
        return 0 if self.armed else errno.EBUSY

    def setpoint_generic(self, payload: bytes) -> None:
        self.calls.append(("generic", payload))

    def setpoint_rpyt(self, payload: bytes) -> None:
        self.calls.append(("rpyt", payload))

    def notify_setpoints_stop(self, remain_valid_ms: int) -> None:
        self.calls.append(("notify", remain_valid_ms))

    def external_position(self, x: float, y: float, z: float) -> None:
        self.calls.append(("position", x, y, z))

    def external_pose(self, x: float, y: float, z: float, qx: float, qy: float, qz: float, qw: float) -> None:
        self.calls.append(("pose", x, y, z, qx, qy, qz, qw))

    def _do_assert(self, value: float) -> None:
        if value:
            raise FirmwareAssertion("system.c: doAssert")


T = TypeVar("T")


class ServedFirmware:
    """A served firmware: ``call`` runs something on the server's thread and gives its result."""

    def __init__(
        self, firmware: MinimalFirmware, server: CrazyflieServer, loop: asyncio.AbstractEventLoop
    ) -> None:
        self.firmware = firmware
        self.server = server
        self.uri = server.uri
        self._loop = loop

    def call(self, function: Callable[[], T]) -> T:
        async def run() -> T:
            return function()

        return asyncio.run_coroutine_threadsafe(run(), self._loop).result(PATIENCE_S)


async def _poll_forever(firmware: MinimalFirmware, server: CrazyflieServer, period_s: float) -> None:
    while True:
        firmware.step()
        server.poll(time.monotonic())
        await asyncio.sleep(period_s)


@contextmanager
def serve(
    firmware: MinimalFirmware, faults: DatagramFaults | None = None, period_s: float = 0.001
) -> Iterator[ServedFirmware]:
    """Serve ``firmware`` on a free port from a thread of its own, polled every ``period_s``."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name="simulated drone")
    thread.start()
    server = CrazyflieServer(firmware, faults=faults)
    asyncio.run_coroutine_threadsafe(server.start(), loop).result(PATIENCE_S)
    polling = asyncio.run_coroutine_threadsafe(_poll_forever(firmware, server, period_s), loop)
    try:
        yield ServedFirmware(firmware, server, loop)
    finally:
        failure = polling.exception() if polling.done() and not polling.cancelled() else None
        polling.cancel()
        served = ServedFirmware(firmware, server, loop)
        served.call(server.close)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(PATIENCE_S)
        loop.close()
        if failure is not None:
            raise failure


class RawClient:
    """A UDP client that sends bytes as they are; an echo after each request tells when all replies are in."""

    def __init__(self, uri: str) -> None:
        host, _, port = uri.removeprefix("udp://").partition(":")
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect((host, int(port)))
        self._barrier = 0

    def __enter__(self) -> "RawClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def receive(self) -> Packet:
        """The next packet; fails when none comes."""
        packet = Packet.decode(self.socket.recv(64))
        assert packet is not None
        return packet

    def receive_param(self) -> tuple[int, bytes]:
        """Channel and payload of the next packet of port 2."""
        while (packet := self.receive()).port != Port.PARAM:
            pass
        return packet.channel, packet.payload

    def exchange(self, *datagrams: bytes) -> list[Packet]:
        """Send datagrams; everything that came back until the echo, without console and log data."""
        self._barrier += 1
        echo = Packet(Port.LINK, 0, b"barrier" + self._barrier.to_bytes(4, "little"))
        for datagram in (*datagrams, echo.encode()):
            self.socket.send(datagram)
        replies = []
        while (packet := self.receive()) != echo:
            if packet.port != Port.CONSOLE and (packet.port, packet.channel) != (Port.LOG, 2):
                replies.append(packet)
        return replies

    def ask(self, port: int, channel: int, payload: bytes) -> list[bytes]:
        """Payloads of the replies to one packet; they are on its own port and channel."""
        replies = self.exchange(Packet(port, channel, payload).encode())
        assert all((reply.port, reply.channel) == (port, channel) for reply in replies), replies
        return [reply.payload for reply in replies]

    def wait_for(self, port: int, channel: int) -> bytes:
        """Payload of the next packet of a port and channel."""
        while (packet := self.receive()).port != port or packet.channel != channel:
            pass
        return packet.payload
