"""cflib's Crazyradio driver with a bound on every send, and a way for a stop before everything that waits.

cflib 0.1.34 puts packets into a queue of one, from which a thread takes the next when the drone has
acknowledged the last; a send waits up to 2 s for its place, whoever sends. Here it waits 20 ms and is then
given up when it belongs to a stream (poses, setpoints, echoes, kicks of the watchdog: the next is newer); a
request goes on waiting beside, in order, for at most 2 s, and its sender does not. A stop throws out what
waits, and keeps everything else out while it is being repeated.

A radio has no second way to a drone, as a duplicate of a socket is one: who closes the driver silences the
stop. And cflib closes it for a fade: 100 sends without an acknowledgement, some tenths of a second. So from
the moment that a stop may have to leave through it until none can any more, a fade is no error (its thread
goes on sending; who watches for silence says when the link is lost), and no error closes the driver.
"""

import contextlib
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from cflib.crtp.crtpstack import CRTPPacket
from cflib.crtp.radiodriver import RadioDriver

from onboard.link.replies import ECHO_HEADER, PORT_AND_CHANNEL, CrtpPacket

SEND_S = 0.02
"""Longest time that a send takes."""
LATE_S = 2.0
"""How long a request waits for its place in the queue."""
KEPT_OUT_S = 0.1
"""How long after a copy of a stop nothing else is sent."""
_LATE_LIMIT = 64
_STREAM_HEADERS = frozenset({ECHO_HEADER, 0x30, 0x60, 0x61, 0x70})
_KICK = (0x91, 0x04)
_FADE = "Too many packets lost"
"""What cflib says of 100 sends in a row that nobody acknowledged."""


def _of_a_stream(packet: CrtpPacket) -> bool:
    header = packet.header & PORT_AND_CHANNEL
    return header in _STREAM_HEADERS or (len(packet.data) > 0 and (header, packet.data[0]) == _KICK)


class GuardedRadioDriver(RadioDriver):
    """cflib's driver for ``radio://``, bounded; see the module's description."""

    def __init__(self) -> None:
        super().__init__()
        self._late: deque[tuple[float, CrtpPacket]] = deque(maxlen=_LATE_LIMIT)
        self._late_noted = threading.Event()
        self._closed = threading.Event()
        self._kept_out_until = 0.0
        self._no_stop_can_come = threading.Event()
        self._no_stop_can_come.set()

    def connect(
        self,
        uri: str,
        radio_link_statistics_callback: Callable[..., None] | None,
        link_error_callback: Callable[[str], None] | None,
    ) -> None:
        """As cflib's; of a fade it is told only while no stop can come."""

        def tell(message: str) -> None:
            faded = message == _FADE and not self._no_stop_can_come.is_set()
            if link_error_callback is not None and not faded:
                link_error_callback(message)

        super().connect(uri, radio_link_statistics_callback, tell)
        threading.Thread(target=self._send_late, name="RadioLate", daemon=True).start()

    def send_packet(self, pk: CrtpPacket) -> bool:
        """Send within 20 ms; False if the packet was given up."""
        if time.monotonic() < self._kept_out_until:
            return False
        if not self._late or _of_a_stream(pk):
            with contextlib.suppress(queue.Full):
                self.out_queue.put(pk, timeout=SEND_S)
                return True
            if _of_a_stream(pk):
                return False
        self._late.append((time.monotonic() + LATE_S, pk))
        self._late_noted.set()
        return True

    def displace(self, pk: CrtpPacket) -> None:
        """Send before everything that waits, which is not sent any more."""
        self._kept_out_until = time.monotonic() + KEPT_OUT_S
        self._late.clear()
        for _ in range(2):  # whoever was just putting a packet in is kept out the second time
            with contextlib.suppress(queue.Empty):
                self.out_queue.get_nowait()
            with contextlib.suppress(queue.Full):
                self.out_queue.put_nowait(pk)
                return

    def stops_may_come(self) -> None:
        """From now on neither a fade nor an error closes this, until :meth:`stops_are_over`."""
        self._no_stop_can_come.clear()

    def stops_are_over(self) -> None:
        """Nobody sends a stop any more."""
        self._no_stop_can_come.set()

    def close(self) -> None:
        """Close, once no stop can come any more."""
        self._no_stop_can_come.wait()
        self._closed.set()
        self._late_noted.set()
        super().close()

    def _send_late(self) -> None:
        while not self._closed.is_set():
            self._late_noted.wait()
            self._late_noted.clear()
            while self._late and not self._closed.is_set():
                self._send_oldest()

    def _send_oldest(self) -> None:
        with contextlib.suppress(queue.Full, IndexError):  # no place yet; or a stop has cleared them
            until, packet = self._late[0]
            if time.monotonic() < until:
                self.out_queue.put(packet, timeout=SEND_S)
            self._late.popleft()


class CflibStopPort:
    """A :class:`onboard.link.stop.StopPort` on a driver of cflib: the radio, or the USB cable.

    A radio's driver stays open until this is closed; a cable's does not outlive an error.

    Args:
        driver: connected.
    """

    def __init__(self, driver: Any) -> None:
        self._driver = driver
        self._radio = driver if isinstance(driver, GuardedRadioDriver) else None
        if self._radio is not None:
            self._radio.stops_may_come()

    def stop(self, packet: bytes) -> None:
        """Send, over the radio before what waits."""
        pk = CRTPPacket(packet[0], packet[1:])
        if self._radio is not None:
            self._radio.displace(pk)
        else:
            self._driver.send_packet(pk)

    def ask(self, packet: bytes) -> None:
        """Send if the last packet has left within 20 ms."""
        pk = CRTPPacket(packet[0], packet[1:])
        if self._radio is not None:
            with contextlib.suppress(queue.Full):
                self._radio.out_queue.put(pk, timeout=SEND_S)
        else:
            self._driver.send_packet(pk)

    def listen(self, take: Callable[[bytes], None]) -> None:
        """See every packet on the driver's own thread, as it puts it into its queue."""
        incoming = self._driver.in_queue
        put = incoming.put

        def put_and_tell(packet: CRTPPacket, *arguments: Any) -> None:
            take(bytes((packet.header, *packet.data)))
            put(packet, *arguments)

        incoming.put = put_and_tell

    def poll(self) -> None:
        """The driver's thread reads."""

    def close(self) -> None:
        """The driver may be closed, by its link."""
        if self._radio is not None:
            self._radio.stops_are_over()
