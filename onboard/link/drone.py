"""The one door to the drone.

>>> with DroneLink.open("udp://127.0.0.1:19850") as drone:        # doctest: +SKIP
...     drone.upload_policy(bundle)
...     drone.takeoff(0.5, 2.0)

Three promises. Every call returns or raises by a deadline. Every value was asked of the drone for this call,
or came in a log sample that carries the drone's time; there are no cached ones. Every refusal of the drone is
an error.
"""

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Self

from onboard.arrays import Vector
from onboard.closing import Closing
from onboard.link.commands import Commands
from onboard.link.connection import Connection, connect
from onboard.link.crazyflie import broken_opening, closed_on_error
from onboard.link.driver import ResendingUdpDriver
from onboard.link.errors import LinkLost, LinkTimeout
from onboard.link.exchange import always
from onboard.link.logs import LogSample, LogStream, LogStreams
from onboard.link.memory import Memories
from onboard.link.parameters import Parameters
from onboard.link.pings import Pings
from onboard.link.policy_upload import PolicyUpload
from onboard.link.power import reboot
from onboard.link.radio import CflibStopPort
from onboard.link.stop import StopPath
from onboard.link.table_cache import TableCache
from onboard.link.uri import SILENCE_LIMIT, check_drone_uri, connect_limit, patience, silence_limit
from onboard.supervisor_info import SupervisorInfo
from onboard.timebase import WALL, Timebase

__all__ = ["DroneLink", "LogSample", "LogStream", "reboot"]

_CLOSE_DEADLINE_S = 2.0
_REPLY_TIMEOUT_S = 2.0
_WATCH_INTERVAL_S = 0.1


class DroneLink(Closing):
    """An open connection to one drone. Methods may be called from any thread but the callbacks of
    :meth:`stream` should leave the commanding to others. Make one with :meth:`open`.

    Every method raises :class:`LinkLost` once the link is gone, and :class:`LinkTimeout` when the drone is
    silent.

    Attributes:
        uri: where the drone is.
        stop_path: stops the motors whatever else happens on this link, also when it is lost.
        round_trip: see :meth:`onboard.link.pings.Pings.round_trip`.
    """

    def __init__(
        self,
        connection: Connection,
        uri: str,
        clock: Timebase,
        reply_timeout_s: float,
        transfer_timeout_s: float,
    ) -> None:
        self.uri = uri
        self._crazyflie = crazyflie = connection.crazyflie
        self._exchange = connection.exchange
        contents = connection.contents
        self._parameters = Parameters(self._exchange, contents.parameters, reply_timeout_s)
        self._memories = Memories(self._exchange, contents.memories, transfer_timeout_s, clock)
        self._logs = LogStreams(crazyflie, self._exchange, contents.logs, reply_timeout_s, clock)
        self._commands = Commands(self._exchange, reply_timeout_s)
        self._policy = PolicyUpload(self._parameters, self._memories, transfer_timeout_s, clock)
        link = crazyflie.link
        if link is None:  # lost between its last answer and now
            raise broken_opening(uri, crazyflie.failure or "it was closed", heard=True)
        port = link.stop_port() if isinstance(link, ResendingUdpDriver) else CflibStopPort(link)
        self.stop_path = StopPath(port, clock)
        self._closing = threading.Event()
        self._pings = Pings(crazyflie, clock)
        self.round_trip = self._pings.round_trip
        self._watch = threading.Thread(target=self._watch_link, name="DroneLinkWatch", daemon=True)
        self._watch.start()

    @classmethod
    def open(
        cls,
        uri: str,
        *,
        timeout_s: float | None = None,
        clock: Timebase = WALL,
        toc_cache: Path | None = None,
        reply_timeout_s: float | None = None,
        transfer_timeout_s: float = 10.0,
    ) -> Self:
        """Connect, and return when it is known what the drone has.

        Args:
            uri: ``udp://HOST:PORT``, ``radio://...`` or ``usb://...``.
            timeout_s: deadline for connecting [s], by default what the URI says, or 10 s; later for a URI
                that asks for patience, and where answers are measured to take long.
            clock: the time that the link goes by.
            toc_cache: folder for tables of contents, which make the next connection faster; only one that
                this user alone can write to is used. By default in the user's cache.
            reply_timeout_s: deadline of calls that need one answer [s]; 2 s, or the silence that the URI
                allows where that is longer.
            transfer_timeout_s: deadline of memory transfers and of the drone's verdict on a policy [s].

        Raises:
            LinkInputError, DroneInUse, LinkError, LinkTimeout, LinkLost: see
            :func:`onboard.link.connection.connect`.
        """
        check_drone_uri(uri)
        limit = connect_limit(uri) if timeout_s is None else timeout_s * patience(uri)
        connection = connect(uri, timeout_s=limit, clock=clock, tables=TableCache(toc_cache))
        if reply_timeout_s is None:
            reply_timeout_s = max(_REPLY_TIMEOUT_S, silence_limit(uri))
        with closed_on_error(connection.crazyflie, uri):
            return cls(connection, uri, clock, reply_timeout_s, transfer_timeout_s)

    # Parameters and logs

    def has_param(self, name: str) -> bool:
        """Whether the drone has a parameter of this complete name."""
        return name in self._parameters

    def has_log(self, name: str) -> bool:
        """Whether the drone has a log variable of this complete name."""
        return name in self._logs

    def param(self, name: str) -> float | int:
        """The parameter's value, read from the drone now.

        Raises:
            NoSuchVariable: the drone has no such parameter.
        """
        return self._parameters.read(name)

    def set_param(self, name: str, value: float, *, retry_s: float | None = None) -> None:
        """Set a parameter; returns when the drone has echoed exactly this value.

        `retry_s`: say it again so often until then, s; None: as the link needs it.

        The echo says that the value arrived, not what the firmware makes of it: where it answers through
        another parameter or log (arming, committing), read that.

        Raises:
            NoSuchVariable: the drone has no such parameter.
            LinkInputError: the value does not fit its type.
            CommandRefused: it is read-only, or the drone echoes another value.
        """
        self._parameters.write(name, value, retry_s)

    def set_params(self, values: Mapping[str, float]) -> None:
        """Set several parameters in the given order; stops at the first error."""
        for name, value in values.items():
            self._parameters.write(name, value)

    def stream(
        self,
        variables: Sequence[str],
        period_ms: int,
        callback: Callable[[LogSample], None],
        *,
        halves: Collection[str] = (),
    ) -> LogStream:
        """Let the drone send log variables periodically.

        Args:
            variables: complete names; at most 18 with 26 bytes together. More than 9 must leave less room
                than the largest of them takes.
            period_ms: 10 to 2540 in steps of 10 [ms].
            callback: gets every sample, on the stream's own thread; it may take its time, but when it falls
                256 samples behind, the oldest are dropped and counted.
            halves: those of them to be sent in half precision, 2 bytes each: 11 bits, up to 65504.

        Raises:
            NoSuchVariable, LinkInputError, CommandRefused.
        """
        return self._logs.start(variables, period_ms, callback, halves)

    # Memory and policy

    def read_memory(self, type_id: int, address: int, length: int) -> bytes:
        """Read from the first memory of a type.

        Raises:
            NoSuchVariable: no memory of this type.
            LinkInputError: it has no such bytes.
            CommandRefused: the drone refuses the read, or gives fewer bytes.
        """
        return self._memories.read(type_id, address, length)

    def upload_policy(self, bundle: bytes) -> int:
        """Make ``bundle`` the live policy: write, read back, compare, commit, wait for the drone's verdict.

        Returns:
            The CRC-32 of the live policy, as the drone reports it (that of ``bundle``).

        Raises:
            PolicyRefused: with the drone's reason; it keeps the policy that it had.
            NoSuchVariable: the firmware has no perching app.
        """
        return self._policy.upload(bundle)

    def active_policy_crc(self) -> int:
        """CRC-32 of the live policy; 0 when there is none (always after a reboot)."""
        return self._policy.active_crc()

    # Supervisor

    def supervisor_info(self) -> SupervisorInfo:
        """The drone's supervisor, asked now; raises rather than guess."""
        return self._commands.supervisor_info()

    def arm(self) -> None:
        """Arm; the motors may turn after this.

        Raises:
            CommandRefused: with the supervisor's state in the message.
        """
        self._commands.arm(True)

    def disarm(self) -> None:
        """Disarm. A firmware that arms by itself will do so again (``supervisor_info().auto_arm``)."""
        self._commands.arm(False)

    def recover(self) -> None:
        """Leave the crashed state; the drone must lie upright."""
        self._commands.recover()

    def emergency_stop(self, confirm_s: float = 0.5) -> None:
        """Stop the motors at once, wherever the drone is; only a reboot makes it fly again.

        It leaves by :attr:`stop_path`, and is repeated there also after this has returned or raised.

        Raises:
            LinkTimeout: no confirmation within ``confirm_s``. The drone may or may not have stopped.
        """
        self.stop_path.trigger()
        report = self.stop_path.wait(confirm_s)
        if report is None or not report.locked:
            why = "" if report is None else f": {report.reason}"
            raise LinkTimeout(
                f"the emergency stop was sent but not confirmed within {confirm_s:g} s; cut the power{why}"
            )

    def kick_emergency_stop_watchdog(self) -> None:
        """Start or feed the drone's watchdog: 1 s without a kick stops the motors and locks it. It has no off
        switch."""
        self._commands.kick_emergency_stop_watchdog()

    # Flying

    def send_pose(self, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Send a pose from motion capture to the drone's estimator, unanswered.

        The firmware's message has neither time nor uncertainty. Over UDP this never blocks; over the radio it
        waits for its turn, at most 20 ms, and is then given up.

        Args:
            position: x, y, z [m], world (ENU).
            quaternion: x, y, z, w, body to world.

        Raises:
            LinkInputError: a number is not finite (the drone would believe it).
        """
        self._commands.send_pose(position, quaternion)

    def takeoff(
        self,
        height: float,
        duration: float,
        yaw: float | None = None,
        *,
        wanted: Callable[[], bool] = always,
    ) -> None:
        """Climb to ``height`` [m, world z] within ``duration`` [s]; ``yaw`` [rad], None: the present one.
        No copy is sent any more once it is not ``wanted``.

        Raises:
            CommandRefused: the drone's supervisor does not let it fly.
            Superseded: another thread gave the planner another command meanwhile, or it is not wanted.
        """
        self._commands.takeoff(height, duration, yaw, wanted)

    def go_to(
        self,
        x: float,
        y: float,
        z: float,
        yaw: float,
        duration: float,
        relative: bool = False,
        *,
        wanted: Callable[[], bool] = always,
    ) -> None:
        """Fly to a point [m, world] with ``yaw`` [rad] within ``duration`` [s]; ``relative`` to the present
        setpoint. The planner takes it also when it lands, and lands no more. Errors as :meth:`takeoff`.

        Raises:
            LinkTimeout: no answer. A relative move is sent once only, so it may or may not happen.
        """
        self._commands.go_to(x, y, z, yaw, duration, relative, wanted)

    def send_full_state(
        self, position: Vector, velocity: Vector, acceleration: Vector, yaw: float, yaw_rate: float
    ) -> None:
        """Send one setpoint of a stream, unanswered; it overrules the high-level commander.

        The drone levels 0.5 s after the last setpoint and stops its motors after 2 s, unless
        :meth:`end_setpoints` comes before.

        Args:
            position, velocity, acceleration: m, m/s, m/s2, world (ENU), sent in thousandths.
            yaw: rad.
            yaw_rate: rad/s.

        Raises:
            LinkInputError: a number is not finite or too large for the packet.
        """
        self._commands.full_state(position, velocity, acceleration, yaw, yaw_rate)

    def end_setpoints(self) -> None:
        """Say that the stream of setpoints is over: the high-level commander takes the drone where it is."""
        self._commands.end_setpoints()

    def land(
        self,
        height: float,
        duration: float,
        yaw: float | None = None,
        *,
        again: bool = False,
        wanted: Callable[[], bool] = always,
    ) -> None:
        """Descend to ``height`` [m, world z] within ``duration`` [s]; then :meth:`stop_motors`. ``again``:
        it may be landing already, and goes on. Errors as :meth:`takeoff`.
        """
        self._commands.land(height, duration, yaw, again, wanted)

    def stop_motors(self) -> None:
        """Stop the high-level commander and with it the motors."""
        self._commands.stop_motors()

    # The link itself

    def silence(self) -> float:
        """Seconds since the last packet from the drone; it is asked ten times a second."""
        return self._exchange.silence()

    @property
    def patience(self) -> float:
        """See :func:`onboard.link.uri.patience`."""
        return patience(self.uri)

    @property
    def lost(self) -> LinkLost | None:
        """Why the link broke, or None while it stands (or was closed on purpose)."""
        return self._exchange.lost

    def close(self) -> None:
        """Close the link; idempotent, takes at most 2 s, and a stop that is under way as long as it needs.

        When this link has armed or commanded the drone, this CUTS THE MOTORS (a zero setpoint ends the
        high-level commander). It lands nothing: land first. A link that was lost cannot do even that; the
        drone's own watchdogs have to. A drone that somebody else flies goes on flying.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self.stop_path.close()
        self._logs.stop_delivery()
        self._pings.close()
        self._exchange.close()
        self._crazyflie.close_within(_CLOSE_DEADLINE_S)
        self._watch.join(timeout=1.0)

    def _watch_link(self) -> None:
        """Notice the loss of the link at once, also over drivers that do not watch for silence by
        themselves."""
        watches_itself = isinstance(self._crazyflie.link, ResendingUdpDriver)
        while not self._closing.is_set():
            self._crazyflie.ended.wait(_WATCH_INTERVAL_S)
            if self._crazyflie.failure is not None:
                self._exchange.fail(self._crazyflie.failure)
                return
            if not watches_itself and self.silence() > SILENCE_LIMIT:
                self._exchange.fail(
                    f"no packet for {self.silence():.2f} s although it was asked ten times a second"
                )
                return
