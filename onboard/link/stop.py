"""The emergency stop's own path to the drone: nothing that hangs, fails or closes above the driver delays it.

A :class:`StopPath` is a thread that was started with the link and sleeps on a socket pair. A trigger is one
byte; then the stop leaves through a :class:`StopPort`, straight to the driver's transport, and is repeated
until the drone's own supervisor says that it is locked. The thread shares no queue, lock or exception with
anything else, asks for the supervisor's bits itself, and goes by the machine's clock: a stop never waits for
the time of a lab.

CRTP port 9 channel 1 ``03``: stop, unanswered. Channel 0 ``0C`` -> ``8C``, bits u16 little endian.
"""

import contextlib
import logging
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from onboard.supervisor_info import SupervisorInfo

REPEAT_S = 0.02
"""Time between two copies of the stop."""
SILENT_S = 3.0
"""A drone that says nothing for this long will not confirm any more. All its own timeouts are shorter: 1 s
of the emergency-stop watchdog, 2 s of the commander."""
LONGEST_S = 5.0
"""A drone that talks, but is not locked after this long, does not obey: cut its power."""

logger = logging.getLogger(__name__)
_LOOK_S = 0.004
_PORT_AND_CHANNEL = 0xF3
_INFO_HEADER, _COMMAND_HEADER = 0x90, 0x91
_STOP = bytes((_COMMAND_HEADER, 0x03))
_ASK = bytes((_INFO_HEADER, 0x0C))
_ANSWER = 0x8C


class StopPort(Protocol):
    """Where a driver lets a stop through. No method raises, and none takes longer than 20 ms."""

    def stop(self, packet: bytes) -> None:
        """Send `packet` (header and payload) before anything that waits to be sent."""

    def ask(self, packet: bytes) -> None:
        """Send `packet` if there is room for it."""

    def listen(self, take: Callable[[bytes], None]) -> None:
        """Give every packet that arrives from now on to `take` as well, on whatever thread reads it."""

    def poll(self) -> None:
        """Read what has come, if nobody else does."""

    def close(self) -> None:
        """Nothing more is sent."""


@dataclass(frozen=True, slots=True)
class StopReport:
    """What came of a stop.

    Attributes:
        locked: the drone said that it is locked: its motors stay off until it is rebooted.
        reason: why that is not known, else empty.
        seconds: from the trigger to this report.
        copies: how often the stop was sent.
    """

    locked: bool
    reason: str
    seconds: float
    copies: int


class StopPath:
    """Stops one drone when triggered, and nothing calls that off.

    Args:
        port: the driver's transport.
    """

    def __init__(self, port: StopPort) -> None:
        self._port = port
        self._wake, self._trigger = socket.socketpair()
        self._trigger.setblocking(False)
        # Plain attributes, each written by one thread: there is no lock that somebody could hold.
        self._locked = False
        self._heard_at = time.monotonic()
        self._report: StopReport | None = None
        port.listen(self._take)
        self._thread = threading.Thread(target=self._run, name="EmergencyStop", daemon=True)
        self._thread.start()

    @property
    def report(self) -> StopReport | None:
        """What came of the last stop that was triggered; None while it is under way."""
        return self._report

    def trigger(self) -> None:
        """Start to stop; returns at once. From any thread, any number of times; also while it closes."""
        self._report = None
        with contextlib.suppress(OSError):  # thousands of triggers wait already; or the link is closed
            self._trigger.send(b"!")

    def wait(self, seconds: float) -> StopReport | None:
        """The report of a stop that was triggered, waited for in real time; None if it takes longer."""
        deadline = time.monotonic() + seconds
        while self._report is None and time.monotonic() < deadline:
            time.sleep(_LOOK_S)
        return self._report

    def close(self) -> None:
        """End the thread. A stop that was triggered is carried to its end first."""
        if self._thread.is_alive():
            with contextlib.suppress(OSError):  # closed before
                self._trigger.shutdown(socket.SHUT_WR)
            self._thread.join()
        self._wake.close()
        self._trigger.close()
        self._port.close()

    def _run(self) -> None:
        while self._wake.recv(4096):
            self._report = self._stop()

    def _stop(self) -> StopReport:
        begin = self._heard_at = time.monotonic()
        self._locked = False
        copies = 0
        while True:
            self._send_and_listen()
            copies += 1
            now = time.monotonic()
            if self._locked:
                return StopReport(True, "", now - begin, copies)
            problem = self._given_up(now, begin)
            if problem is not None:
                return StopReport(False, problem, now - begin, copies)

    def _send_and_listen(self) -> None:
        """One copy, and the question whether it is needed any more."""
        deadline = time.monotonic() + REPEAT_S
        try:
            self._port.stop(_STOP)
            self._port.ask(_ASK)
            while not self._locked and time.monotonic() < deadline:
                time.sleep(_LOOK_S)
                self._port.poll()
        except Exception:  # of a transport that is breaking: the next copy may get through
            logger.exception("a copy of the emergency stop was not sent")
            time.sleep(_LOOK_S)

    def _given_up(self, now: float, begin: float) -> str | None:
        if now - self._heard_at > SILENT_S:
            return f"the drone has said nothing for {SILENT_S:g} s; cut its power"
        if now - begin > LONGEST_S:
            return f"the drone talks, but has not locked its motors within {LONGEST_S:g} s; cut its power"
        return None

    def _take(self, packet: bytes) -> None:
        self._heard_at = time.monotonic()
        if len(packet) >= 4 and packet[0] & _PORT_AND_CHANNEL == _INFO_HEADER and packet[1] == _ANSWER:
            self._locked |= SupervisorInfo(int.from_bytes(packet[2:4], "little")).is_locked
