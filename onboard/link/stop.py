"""The emergency stop's own path to the drone: nothing that hangs, fails or closes above the driver delays it.

A :class:`StopPath` is a thread that was started with the link and sleeps by a bell, which is a pair of
sockets. A trigger is one byte; then the stop leaves through a :class:`StopPort`, straight to the driver's
transport, and is repeated until the drone's own supervisor says that it is locked. The thread shares no
queue, lock or exception with anything else, and asks for the supervisor's bits itself.

In a lab that keeps its own time the thread takes part in it, or the lab would wait for a flight that waits
for the confirmation: what is given up is given up in the lab's time. The stop itself never waits for that
time: it leaves at once, and is repeated also where time stands still.

CRTP port 9 channel 1 ``03``: stop, unanswered. Channel 0 ``0C`` -> ``8C``, bits u16 little endian.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from onboard.supervisor_info import SupervisorInfo
from onboard.timebase import WALL, Timebase

REPEAT_S = 0.02
"""Time between two copies of the stop; at most 0.1 s by the machine's clock."""
SILENT_S = 3.0
"""A drone that says nothing for this long will not confirm any more. All its own timeouts are shorter: 1 s
of the emergency-stop watchdog, 2 s of the commander."""
LONGEST_S = 5.0
"""A drone that talks, but is not locked after this long, does not obey: cut its power."""

_LOOK_S, _LOOK_AT_MOST_S = 0.004, 0.02
_LOOKS = round(REPEAT_S / _LOOK_S)
_TALKS_S = 1.0
"""A drone that was heard within this time talks."""
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
        seconds: from the first copy to this report.
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
        time: that the link goes by.
    """

    def __init__(self, port: StopPort, time: Timebase = WALL) -> None:
        self._port = port
        self._time = time
        self._bell = time.bell()
        self._ended = time.event()
        # Plain attributes, each written by one thread: there is no lock that somebody could hold.
        self._locked = False
        self._unsent = ""
        self._heard_at = time()
        self._report: StopReport | None = None
        port.listen(self._take)
        self._thread = time.thread(self._run, "EmergencyStop")

    @property
    def report(self) -> StopReport | None:
        """What came of the last stop that was triggered; None while it is under way."""
        return self._report

    def trigger(self) -> None:
        """Start to stop; returns at once. From any thread, any number of times; also while it closes."""
        self._report = None
        self._bell.ring()

    def wait(self, seconds: float) -> StopReport | None:
        """The report of a stop that was triggered; None if it takes longer."""
        pause, deadline = self._time.event(), self._time() + seconds
        while self._report is None and self._time() < deadline:
            pause.wait(_LOOK_S)
        return self._report

    def close(self) -> None:
        """End the thread. A stop that was triggered is carried to its end first."""
        self._bell.close()
        self._ended.wait()  # not join(): a lab's time goes on while somebody waits like this
        self._thread.join()
        self._port.close()

    def _run(self) -> None:
        try:
            while self._bell.wait():
                self._report = self._stop()
        finally:
            self._ended.set()

    def _stop(self) -> StopReport:
        begin = self._heard_at = self._time()
        self._locked, self._unsent = False, ""
        copies = 0
        while True:
            self._send_and_listen()
            copies += 1
            now = self._time()
            if self._locked:
                return StopReport(True, "", now - begin, copies)
            problem = self._given_up(now, begin)
            if problem is not None:
                return StopReport(False, problem + self._unsent, now - begin, copies)

    def _send_and_listen(self) -> None:
        """One copy, and the question whether it is needed any more."""
        try:
            self._port.stop(_STOP)
            self._port.ask(_ASK)
            for _ in range(_LOOKS):
                if self._locked:
                    return
                self._time.nap(_LOOK_S, _LOOK_AT_MOST_S)
                self._port.poll()
        except Exception as error:  # noqa: BLE001 -- of a transport that breaks: the next copy may get through
            # No log: its handlers have locks, and write to terminals that may stand still.
            self._unsent = f" (a copy was not sent: {error!r})"
            self._time.nap(_LOOK_S, _LOOK_AT_MOST_S)

    def _given_up(self, now: float, begin: float) -> str | None:
        silent = now - self._heard_at
        if silent > SILENT_S:
            return f"the drone has said nothing for {SILENT_S:g} s; cut its power"
        if now - begin <= LONGEST_S:
            return None
        if silent > _TALKS_S:
            return (
                f"the drone has not locked its motors, and has said nothing for {silent:.1f} s; cut its power"
            )
        return f"the drone talks, but has not locked its motors within {LONGEST_S:g} s; cut its power"

    def _take(self, packet: bytes) -> None:
        self._heard_at = self._time()
        if len(packet) >= 4 and packet[0] & _PORT_AND_CHANNEL == _INFO_HEADER and packet[1] == _ANSWER:
            self._locked |= SupervisorInfo(int.from_bytes(packet[2:4], "little")).is_locked
