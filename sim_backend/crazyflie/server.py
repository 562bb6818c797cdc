"""One simulated Crazyflie on one UDP socket, for any CRTP client (``udp://host:port``).

A datagram is a packet. Replies go to where the request came from; what the drone sends by itself (log
data, console, changed parameters) goes to the peer, that is the last source of a packet for the firmware.
Packets for the radio chip, such as the polls of a scan and power commands, are answered without making
their source the peer.

Source of the behaviour: bitcraze/crazyflie-firmware 2a18fc29 (``crtp.c``, ``radiolink.c``) and our
measurements of cflib 0.1.34.
"""

import asyncio
import heapq
import itertools
import socket
import time
from collections import Counter, deque
from collections.abc import Callable
from functools import partial
from typing import Protocol

from onboard.taken_port import why_not_taken
from sim_backend.crazyflie.crtp import PAYLOAD_MAX, Packet, Port
from sim_backend.crazyflie.faults import DatagramFaults
from sim_backend.crazyflie.interfaces import FirmwareAssertion, FirmwarePort
from sim_backend.crazyflie.ports.console import console_packets
from sim_backend.crazyflie.ports.high_level import HighLevelPort
from sim_backend.crazyflie.ports.link import LinkPort
from sim_backend.crazyflie.ports.localization import LocalizationPort
from sim_backend.crazyflie.ports.log import LogPort
from sim_backend.crazyflie.ports.memory import MemoryPort
from sim_backend.crazyflie.ports.param import ParamPort
from sim_backend.crazyflie.ports.platform import PlatformPort
from sim_backend.crazyflie.ports.radio import Power, Radio
from sim_backend.crazyflie.ports.setpoint import GenericSetpointPort, RpytPort
from sim_backend.crazyflie.ports.supervisor import SupervisorCrtpPort
from sim_backend.crazyflie.radio_channel import RadioChannel
from sim_backend.crazyflie.reception import Reception
from sim_backend.errors import SimulationError

#: A full table of contents is asked for and answered within milliseconds, and udp:// clients never resend: a
#: datagram that the kernel drops hangs them.
BUFFER_BYTES = 4 << 20
#: Datagrams handled in one go before other tasks of the loop get their turn.
BURST = 1024
DATAGRAM_MAX = 2048
ECHO_HEADERS = tuple(bytes((Port.LINK << 4 | link_bits << 2,)) for link_bits in range(4))
#: Silence after which the firmware stops all logging (CONFIG_RADIO_ACTIVITY_TIMEOUT_MS).
ACTIVITY_TIMEOUT_MS = 1000
#: The same for a client that lives by the clock on the wall while the drone does not.
ACTIVITY_TIMEOUT_S = 0.001 * ACTIVITY_TIMEOUT_MS
#: Length of the firmware's queue towards the radio.
CONSOLE_QUEUE = 200

Address = tuple[str, int]


class ServerError(SimulationError):
    """The simulated drone cannot be served."""


class PortHandler(Protocol):
    """One CRTP port."""

    def handle(self, packet: Packet) -> None:
        """One packet of the client."""
        ...


class CrazyflieServer:
    """Serves a firmware. Use from one event loop: ``await start()``, ``poll(now)`` after each step,
    ``close()``.

    Attributes:
        radio: the radio chip with the drone's power switch.
        dropped: datagrams that the kernel did not take.
        received, sent: datagrams from and to each client, by its port.
        heard: set when a datagram has come.
        assertions: assertions of the firmware that packets have tripped, oldest first.
        by_wall_clock: whether the client at this port counts its time by the clock on the wall: it is there
            as long as it is heard once a second by either clock.
    """

    def __init__(
        self,
        firmware: FirmwarePort,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        radio_id: int = 0xE7,
        faults: DatagramFaults | None = None,
        air: RadioChannel | None = None,
    ) -> None:
        """Port 0 takes a free one; ``radio_id`` is the last byte of the drone's radio address; without
        ``air`` packets take no time."""
        self.radio = Radio(firmware)
        self.dropped = 0
        self.received: Counter[int] = Counter()
        self.sent: Counter[int] = Counter()
        self.heard = asyncio.Event()
        self.assertions: list[str] = []
        self.by_wall_clock: Callable[[int], bool] = lambda _port: False
        self._firmware = firmware
        self._requested: Address = (host, port)
        self._radio_id = radio_id
        self._faults = faults
        self._air = air
        self._reception = Reception(lambda: air is None or air.has_room, self._work)
        self._socket: socket.socket | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._peer: Address | None = None
        self._last_packet_ms = 0
        self._last_packet_at = 0.0
        self._console: deque[Packet] = deque(maxlen=CONSOLE_QUEUE)
        self._now = 0.0
        self._delayed: list[tuple[float, int, Callable[[], None]]] = []
        self._sequence = itertools.count()
        self._connect_ports()

    async def start(self) -> None:
        """Bind the socket and answer from now on.

        Raises:
            ServerError: the address cannot be bound.
        """
        host, port = self._requested
        self._loop = asyncio.get_running_loop()
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
        try:
            sock.bind(self._requested)
        except OSError as error:
            sock.close()
            raise ServerError(
                f"no simulated drone: {why_not_taken(error, 'UDP', host, port)}; is a simulated lab running "
                "already? Use that, end it, or give another --drone-port (0: a free one)"
            ) from error
        self._socket = sock
        self._loop.add_reader(sock, self._drain)

    def close(self) -> None:
        """Stop answering; may be called twice."""
        if self._socket is not None and self._loop is not None:
            self._loop.remove_reader(self._socket)
            self._socket.close()
        self._socket = None

    @property
    def address(self) -> Address:
        """Host and port in use.

        Raises:
            ServerError: not started.
        """
        if self._socket is None:
            raise ServerError("the simulated drone is not served; await start() first")
        host, port = self._socket.getsockname()
        return host, port

    @property
    def uri(self) -> str:
        """``udp://host:port``."""
        host, port = self.address
        return f"udp://{host}:{port}"

    def poll(self, now: float) -> None:
        """Send what became due: log data, console, changed parameters, delayed datagrams.

        Call after every step of the world, at least every 10 ms of drone time: log blocks are sampled here.
        ``now`` [s] is any clock that does not go back; delays of injected faults count in it from the first
        call on.
        """
        self._now = now
        while self._delayed and self._delayed[0][0] <= now:
            heapq.heappop(self._delayed)[2]()
        if self._air is not None:
            self._air.move(now)
            self._guarded(self._reception.go_on)
        if self.radio.power is not Power.ON:
            return
        self._notice_reboot()
        for text in self._firmware.take_console():
            self._console.extend(console_packets(text))
        if self._log.is_due and not self.connected:
            self._log.reset()
            self._console.clear()
        self._log.poll()
        if not self.connected:
            self._firmware.params.take_updates()
            return
        self._param.poll()
        while self._console:
            self._send(self._console.popleft())

    @property
    def connected(self) -> bool:
        """A client is there and the radio was not silent for a second of drone time, or of the client's."""
        if self._peer is None:
            return False
        if self._firmware.tick_ms() - self._last_packet_ms < ACTIVITY_TIMEOUT_MS:
            return True
        if not self.by_wall_clock(self._peer[1]):
            return False
        return time.monotonic() - self._last_packet_at < ACTIVITY_TIMEOUT_S

    @property
    def in_callback(self) -> bool:
        """Whether the drone's parameter task is in a callback: until its end it answers nothing."""
        return self.radio.power is Power.ON and self._firmware.params.busy

    def _connect_ports(self) -> None:
        """Ports in the state after boot."""
        firmware = self._firmware
        self._boot_count = firmware.boot_count
        self._param = ParamPort(firmware.params, self._send)
        self._log = LogPort(firmware.logs, firmware.tick_ms, self._send)
        self._ports: dict[int, PortHandler] = {
            Port.PARAM: self._param,
            Port.SETPOINT: RpytPort(firmware.commander),
            Port.MEMORY: MemoryPort(firmware.memories, self._send),
            Port.LOG: self._log,
            Port.LOCALIZATION: LocalizationPort(firmware.localization, self._radio_id, self._send),
            Port.SETPOINT_GENERIC: GenericSetpointPort(firmware.commander),
            Port.SETPOINT_HIGH_LEVEL: HighLevelPort(firmware.commander, self._send),
            Port.SUPERVISOR: SupervisorCrtpPort(firmware.supervisor, self._send),
            Port.PLATFORM: PlatformPort(firmware.supervisor, self._send),
            Port.LINK: LinkPort(self._send),
        }

    def _notice_reboot(self) -> None:
        if self._firmware.boot_count != self._boot_count:
            self._peer = None
            self._last_packet_ms = 0
            self._console.clear()
            self._reception.clear()
            if self._air is not None:
                self._air.forget()
            self._connect_ports()

    def _drain(self) -> None:
        """Take all datagrams that have arrived."""
        for _ in range(BURST):
            if self._socket is None:
                return
            try:
                datagram, source = self._socket.recvfrom(DATAGRAM_MAX)
            except BlockingIOError:
                return
            self.received[source[1]] += 1
            self.heard.set()
            receive = partial(self._receive, datagram, source)
            if self._air is None:
                self._pass(receive, datagram)
            else:
                self._air.up(self._now, partial(self._pass, receive, datagram))

    def _pass(self, deliver: Callable[[], None], datagram: bytes) -> None:
        """Deliver one datagram through the faults of the link."""
        if self._faults is None:
            deliver()
            return
        for delay in self._faults.copies(echo=datagram[:1] in ECHO_HEADERS):
            if delay <= 0.0:
                deliver()
            else:
                heapq.heappush(self._delayed, (self._now + delay, next(self._sequence), deliver))

    def _receive(self, datagram: bytes, source: Address) -> None:
        packet = Packet.decode(datagram)
        if packet is None:
            return
        if packet.for_radio:
            answer = self.radio.handle(packet)
            if answer is not None:
                self._transmit(answer, source)
            if packet.is_null:
                self._touch()
            return
        if self.radio.power is not Power.ON:
            return
        self._notice_reboot()
        self._peer = source
        self._touch()
        self._guarded(partial(self._reception.take, packet))

    def _work(self, packet: Packet) -> None:
        port = self._ports.get(packet.port)
        if port is not None:
            port.handle(packet)

    def _guarded(self, work: Callable[[], None]) -> None:
        """An assertion of the firmware restarts it."""
        try:
            work()
        except FirmwareAssertion as assertion:
            self.assertions.append(str(assertion))
            self._firmware.assert_failed(str(assertion))
            self._notice_reboot()

    def _touch(self) -> None:
        if self.radio.power is Power.ON:
            self._last_packet_ms = self._firmware.tick_ms()
            self._last_packet_at = time.monotonic()
            self._firmware.on_packet()

    def _send(self, packet: Packet) -> None:
        """Send to the peer.

        Raises:
            FirmwareAssertion: the payload is longer than a packet.
        """
        if len(packet.payload) > PAYLOAD_MAX:
            raise FirmwareAssertion(f"crtp.c: packet of {len(packet.payload)} bytes on port {packet.port}")
        if self._peer is not None:
            self._transmit(packet.encode(), self._peer)

    def _transmit(self, datagram: bytes, address: Address) -> None:
        put = partial(self._put, datagram, address)
        if self._air is None:
            self._pass(put, datagram)
        else:
            self._air.down(self._now, partial(self._pass, put, datagram))

    def _put(self, datagram: bytes, address: Address) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(datagram, address)
            self.sent[address[1]] += 1
        except OSError:  # full buffer, or the client is gone: a radio packet would be lost as well
            self.dropped += 1
