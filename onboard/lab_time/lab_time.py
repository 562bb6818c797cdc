"""Taking part in the turns of a simulated lab."""

import contextlib
import logging
import queue
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import IO, Any, Self

from onboard.errors import PerchhwError
from onboard.lab_time.messages import Message, decode, encode
from onboard.lab_time.waiting import LabBell, LabEvent, LabQueue, Workers
from onboard.timebase import Bell, Event, Queue, Transport

ANSWER_S = 60.0
"""Real time after which a lab that owes an answer is taken for dead."""
PULSE_S = 5.0
"""Real time between two questions whether the lab still lives, which nobody hears who waits for his turn."""
SLOT_PERIOD, SLOT_MARGIN = 2.0, 1.5
"""Motors are armed at multiples of the period, the first that is at least the margin away, lab s."""
_OWN_PACE_STEP_S = 0.002
_CALLBACK_STEP_S = 0.002
"""Between two looks whether a drone has done with a parameter, lab s."""
_log = logging.getLogger(__name__)


class LabTimeError(PerchhwError):
    """The clock of a simulated lab cannot be reached, or is lost."""


class LabTime:
    """A :class:`onboard.timebase.Timebase` that is a lab's; a context manager that joins and leaves.

    A turn of time `t`: everything that was sent until then arrives and is worked on, then those who wait for
    a time up to `t` are woken, one after the other in the order of their deadlines; when all wait again, the
    lab is told. A lab that dies, or answers nothing for :data:`ANSWER_S`, leaves its time behind: it goes on
    here at the pace of the machine's clock, so that every deadline comes.
    """

    def __init__(self, host: str, port: int, name: str) -> None:
        self._address = (host, port)
        self._name = name
        self._workers = Workers(0.0)
        self._transports: dict[str, _LabTransport] = {}
        self._answers: dict[str, Message] = {}
        self._answered = threading.Condition()
        self._sending, self._asking = threading.Lock(), threading.Lock()
        self._turns: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self._socket: socket.socket | None = None
        self._alone = self._runs = False
        self._left = threading.Event()

    # Timebase

    def __call__(self) -> float:
        """The lab's time, s."""
        return self._workers.now

    def event(self) -> Event:
        """An event."""
        return LabEvent(self._workers)

    def queue(self, limit: int = 0) -> Queue:
        """A queue."""
        return LabQueue(self._workers, limit)

    def bell(self) -> Bell:
        """A bell."""
        return LabBell(self._workers)

    def nap(self, seconds: float, at_most: float) -> None:
        """Wait for `seconds` of the lab, or `at_most` of the machine's."""
        workers = self._workers
        with workers.lock:
            workers.block(set(), workers.now + seconds, at_most)

    def thread(self, target: Callable[..., object], name: str, *args: object) -> threading.Thread:
        """A daemon thread, started, that counts as at work unless it waits."""
        workers = self._workers

        def run() -> None:
            workers.count()
            try:
                target(*args)
            finally:
                self.foreign()

        with workers.lock:
            workers.begin()
        thread = threading.Thread(target=run, name=name, daemon=True)
        thread.start()
        return thread

    def foreign(self, thread: threading.Thread | None = None) -> None:
        """A thread, by default the calling one, is at work for itself from here on."""
        workers = self._workers
        with workers.lock:
            if workers.discount(thread or threading.current_thread()):
                workers.end()

    def transport(self, key: str) -> Transport:
        """The end of a socket; packets that were sent to its port before do not count."""
        before = int(self._ask("open", key=key).get("packets", 0))
        transport = _LabTransport(self._workers, before, lambda packets: self._forget(key, packets))
        with self._workers.lock:
            self._transports[key] = transport
        return transport

    @contextmanager
    def connecting(self) -> Iterator[None]:
        """The lab stands still; or, where its links lose or delay packets, lives at the machine's pace.

        What a drone that stood still would never answer, because it is in a parameter's callback, is waited
        for first, in the lab's time.
        """
        while (answer := self._ask("connecting")).get("wait"):
            self.event().wait(_CALLBACK_STEP_S)
        runs, connected = bool(answer.get("runs")), threading.Event()
        self._runs = runs
        pacer = threading.Thread(target=self._run_alone, args=(connected.is_set,), daemon=True)
        self._workers.let_turns_hold(False)
        if runs:
            pacer.start()
        try:
            yield
        finally:
            connected.set()
            if runs:
                pacer.join()
                self._workers.now = float(self._ask("connected", t=self._workers.now)["t"])
            self._runs = False
            self._workers.let_turns_hold(True)

    def patience(self, limit: float) -> float:
        """As long as the lab itself waits; while it runs at the machine's pace, no longer than `limit`."""
        return limit if self._runs else max(limit, ANSWER_S)

    def slot(self) -> float:
        """A multiple of 2 s of the lab's time, at least 1.5 s from now."""
        return SLOT_PERIOD * -(-(self._workers.now + SLOT_MARGIN) // SLOT_PERIOD)

    # Taking part

    def join(self) -> None:
        """Connect, and take part from here on; the calling thread counts as at work.

        Raises:
            LabTimeError: nobody answers there.
        """
        host, port = self._address
        try:
            self._socket = socket.create_connection(self._address, timeout=ANSWER_S)
        except OSError as error:
            raise LabTimeError(
                f"no lab keeps its time at {host}:{port} ({error}); is `perchhw sim lab` still running? "
                "Take the address of a drone from its ready line"
            ) from error
        self._socket.settimeout(None)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with self._workers.lock:
            self._workers.begin()
            self._workers.count()
        lines = self._socket.makefile("rb")
        threading.Thread(target=self._receive, args=(lines,), name="LabTimeReceive", daemon=True).start()
        threading.Thread(target=self._take_turns, name="LabTimeTurns", daemon=True).start()
        threading.Thread(target=self._feel_pulse, name="LabTimePulse", daemon=True).start()
        self._workers.now = float(self._ask("join", name=self._name)["t"])

    def leave(self) -> None:
        """Take no further part; the lab first lets everything come to rest that was left in the air."""
        if self._socket is None:
            return
        if not self._alone:
            self._ask("leave")  # first: the lab's time must not go on between the last turn and the word
        self.foreign()
        self._left.set()
        connection, self._socket = self._socket, None
        with contextlib.suppress(OSError):  # the lab has closed it already
            connection.shutdown(socket.SHUT_RDWR)
        connection.close()

    def __enter__(self) -> Self:
        self.join()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.leave()

    # The connection

    def _tell(self, message: Message) -> None:
        """Send; a lab that is gone is noticed by who receives."""
        connection = self._socket
        if connection is None or self._alone:
            return
        try:
            with self._sending:
                connection.sendall(encode(message))  # leave() may have closed it meanwhile
        except OSError:
            self._alone = True

    def _ask(self, what: str, **details: Any) -> Message:
        """Ask the lab, and wait in real time; of a lab that is gone, what was known last."""
        with self._asking, self._answered:
            self._tell({"ask": what, **details})
            if not self._answered.wait_for(lambda: what in self._answers or self._alone, ANSWER_S):
                raise LabTimeError(f"the lab's clock at {self._address} did not answer within {ANSWER_S:g} s")
            return self._answers.pop(what, {"t": self._workers.now})

    def _feel_pulse(self) -> None:
        """Ask the lab for a sign of life from time to time; one that gives none is left."""
        while not self._left.wait(PULSE_S) and not self._alone:
            try:
                self._ask("status")
            except LabTimeError as error:
                _log.error("%s: it hangs, or is stopped; time goes on without it", error)
                connection = self._socket
                if connection is not None:
                    with contextlib.suppress(OSError):
                        connection.shutdown(socket.SHUT_RDWR)  # who receives then knows that we are alone
                return

    def _forget(self, key: str, packets: int) -> None:
        with self._workers.lock:
            self._transports.pop(key, None)
        self._tell({"close": key, "packets": packets})

    def _receive(self, lines: IO[bytes]) -> None:
        """Take in turns and answers as they come, until the lab is gone."""
        try:
            for line in lines:
                message = decode(line)
                if "answer" in message:
                    self._answer(message)
                else:
                    self._turns.put(message)
        except (OSError, ValueError) as error:
            _log.info("no longer in the lab's time: %s", error)  # closed by leave(), or broken off
        finally:
            lines.close()
        with self._answered:
            self._alone = True
            self._answered.notify_all()
        self._turns.put(None)

    def _take_turns(self) -> None:
        """One turn after the other; without a lab, on the machine's clock."""
        while (turn := self._turns.get()) is not None:
            self._turn(float(turn["t"]), turn["packets"])
        self._workers.let_turns_hold(False)
        self._run_alone(lambda: self._socket is None)

    def _answer(self, message: Message) -> None:
        with self._answered:
            self._answers[str(message["answer"])] = message
            self._answered.notify_all()

    def _turn(self, now: float, packets: dict[str, int]) -> None:
        """One turn; see the class."""
        workers = self._workers
        with workers.lock:
            workers.now = now
            for key, count in packets.items():
                if key in self._transports:
                    self._transports[key].expected = count
            workers.changed.notify_all()
            self._finish_work()
            while workers.wake_next_due():
                self._finish_work()
            done: Message = {
                "done": now,
                "next": workers.next_deadline(),
                "packets": {key: transport.count_sent for key, transport in self._transports.items()},
            }
        self._tell(done)

    def _finish_work(self) -> None:
        """Wait until every packet has come and nobody is at work; the caller holds the lock."""
        workers = self._workers
        while workers.at_work > 0 or not all(t.caught_up for t in self._transports.values()):
            workers.changed.wait()

    def _run_alone(self, ended: Callable[[], bool]) -> None:
        """Let time go on at the machine's pace until `ended`."""
        workers = self._workers
        lab_time, started = workers.now, time.monotonic()
        while not ended():
            with workers.lock:
                workers.now = lab_time + (time.monotonic() - started)
                while workers.wake_next_due():
                    pass
                workers.changed.wait(_OWN_PACE_STEP_S)


class _LabTransport:
    """A socket's end; see :class:`onboard.timebase.Transport`.

    A packet may arrive before the turn that it belongs to. It then waits until the lab has said what time it
    is, so that its time of receipt is the lab's.
    """

    def __init__(self, workers: Workers, before: int, forget: Callable[[int], None]) -> None:
        self._workers = workers
        self._forget = forget
        self._received = self.expected = before
        self._counted = self._closed = False
        self.count_sent = 0

    @property
    def caught_up(self) -> bool:
        """Whether every packet that the lab has sent was received."""
        return self._received >= self.expected

    def blocking(self) -> Self:
        """The calling thread is not at work inside; it comes out with a packet of this turn."""
        return self

    def __enter__(self) -> None:
        workers = self._workers
        self._counted = workers.counted
        if self._counted:
            with workers.lock:
                workers.end()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        workers = self._workers
        with workers.lock:
            while kind is None and workers.takes_turns and self.caught_up and not self._closed:
                workers.changed.wait()
            if self._counted:
                workers.begin()

    def received(self, packets: int) -> None:
        """Note packets that were received."""
        with self._workers.lock:
            self._received += packets
            self._workers.changed.notify_all()

    def sent(self, packets: int) -> None:
        """Note packets that were sent."""
        with self._workers.lock:
            self.count_sent += packets

    def close(self) -> None:
        """Nothing is expected here any more; the lab still waits for what was sent."""
        with self._workers.lock:
            if self._closed:
                return
            self._closed = True
        self._forget(self.count_sent)
        with self._workers.lock:
            self._workers.changed.notify_all()
