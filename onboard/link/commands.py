"""Commands that fly and arm: CRTP ports 6 (pose), 7, 8 (high-level commander) and 9 (supervisor).

Port 6 channel 1: ``08``, then x y z [m] and qx qy qz qw as float32; no answer.
Port 7 channel 0: ``06``, then position, velocity, acceleration as i16 [mm, mm/s, mm/s2], attitude in
32 bits and rates i16 [mrad/s]; no answer. Port 7 channel 1: ``00``, then u32 ms: no more setpoints come
(notify-setpoints-stop); no answer.
Port 8 channel 0: command, group mask, arguments -> the first three bytes and an errno (cflib listens to none
of it). Port 9 channel 0: ``0C`` -> ``8C``, bits u16. Channel 1: ``01 on`` -> ``81 success armed``; ``02`` ->
``82 success recovered``; ``04`` kick of the emergency stop's watchdog has no answer. Little endian. The stop
itself, ``03``, is in :mod:`onboard.link.stop`.
"""

import errno
import math
import struct
from collections.abc import Callable, Sequence

from cflib.crtp.crtpstack import CRTPPort
from cflib.utils.encoding import compress_quaternion

from onboard.arrays import Vector
from onboard.link.errors import CommandRefused, LinkInputError
from onboard.link.exchange import Exchange, always
from onboard.supervisor_info import SupervisorBits, SupervisorInfo

_POSE_CHANNEL, _POSE_COMMAND = 1, 0x08
_STOP, _TAKEOFF, _LAND, _GO_TO = 3, 7, 8, 12
_ALL_GROUPS = 0
_INFO_CHANNEL, _COMMAND_CHANNEL = 0, 1
_GET_INFO, _ARM, _RECOVER, _WATCHDOG = 0x0C, 0x01, 0x02, 0x04
_ANSWER = 0x80
_META_CHANNEL, _NOTICE_COPIES = 1, 2
_SETPOINTS_STOPPED = struct.pack("<BI", 0, 0)
_COMMANDER_RETRY_S = 0.1
_PLANNER = b"planner"
"""What all its commands write to: of two the newer one counts, and the older one is not repeated any more."""
_PLANNER_REFUSES = 1
"""The firmware's planner, to a take-off when it flies and to a landing when it lands (``planner.c``)."""
_POSE = struct.Struct("<B7f")
_SETPOINT_CHANNEL, _FULL_STATE = 0, 6
_FULL_STATE_LAYOUT = struct.Struct("<B9hI3h")
_LARGEST_SETPOINT = 32.0


class Commands:
    """Sends commands and says no when the drone does."""

    def __init__(self, exchange: Exchange, reply_timeout_s: float) -> None:
        self._exchange = exchange
        self._within = reply_timeout_s

    def send_pose(self, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Send an external pose; nothing answers.

        The drone feeds it to its estimator unchecked, so nothing but finite numbers leaves here.

        Raises:
            LinkInputError: a number is not finite, or there are not three and four of them.
            LinkLost: the link is gone.
        """
        numbers = (*position, *quaternion)
        if len(position) != 3 or len(quaternion) != 4 or not all(map(math.isfinite, numbers)):
            raise LinkInputError(f"a pose is three and four finite numbers, not {position} and {quaternion}")
        payload = _POSE.pack(_POSE_COMMAND, *numbers)
        self._exchange.send(CRTPPort.LOCALIZATION, _POSE_CHANNEL, payload)

    def takeoff(
        self, height: float, duration: float, yaw: float | None, wanted: Callable[[], bool] = always
    ) -> None:
        """Climb to ``height``; see :meth:`onboard.link.drone.DroneLink.takeoff`.

        A setpoint of higher priority may still be in force: cflib sends one when it closes a link, and then
        the drone would not follow the high-level commander. The notice that setpoints have stopped also tells
        the planner where the drone is now.
        """
        self.end_setpoints()
        self._high_level(
            "takeoff",
            struct.pack("<BBff?f", _TAKEOFF, _ALL_GROUPS, height, yaw or 0.0, yaw is None, duration),
            wanted=wanted,
            refuses_copies=True,
        )

    def land(
        self,
        height: float,
        duration: float,
        yaw: float | None,
        again: bool = False,
        wanted: Callable[[], bool] = always,
    ) -> None:
        """Descend to ``height``; see :meth:`onboard.link.drone.DroneLink.land`."""
        self._high_level(
            "land",
            struct.pack("<BBff?f", _LAND, _ALL_GROUPS, height, yaw or 0.0, yaw is None, duration),
            wanted=wanted,
            refuses_copies=True,
            is_copy=again,
        )

    def go_to(
        self,
        x: float,
        y: float,
        z: float,
        yaw: float,
        duration: float,
        relative: bool,
        wanted: Callable[[], bool] = always,
    ) -> None:
        """Fly to a point; see :meth:`onboard.link.drone.DroneLink.go_to`."""
        payload = struct.pack("<BB??5f", _GO_TO, _ALL_GROUPS, relative, False, x, y, z, yaw, duration)
        # A relative move that arrives twice goes twice as far, so it is sent once; a lost answer is then an
        # error.
        self._high_level("go_to", payload, wanted=wanted, repeatable=not relative)

    def stop_motors(self) -> None:
        """End the trajectory and stop the motors."""
        self._high_level("stop", struct.pack("<BB", _STOP, _ALL_GROUPS))

    def supervisor_info(self) -> SupervisorInfo:
        """The drone's supervisor bits, asked for now."""
        reply = self._supervisor(_INFO_CHANNEL, bytes((_GET_INFO,)), 3, "supervisor information")
        return SupervisorInfo(int.from_bytes(reply[1:3], "little"))

    def arm(self, on: bool) -> None:
        """Arm or disarm."""
        reply = self._supervisor(_COMMAND_CHANNEL, bytes((_ARM, on)), 3, "arm" if on else "disarm")
        if not reply[1] or bool(reply[2]) is not on:
            raise CommandRefused(f"the drone does not {'arm' if on else 'disarm'}: {self._why()}")

    def recover(self) -> None:
        """Leave the crashed state."""
        reply = self._supervisor(_COMMAND_CHANNEL, bytes((_RECOVER,)), 3, "recover from a crash")
        if not reply[1] or not reply[2]:
            raise CommandRefused(f"the drone does not recover, it must lie upright: {self._why()}")

    def kick_emergency_stop_watchdog(self) -> None:
        """Start or feed the watchdog; nothing answers."""
        self._exchange.send(CRTPPort.SUPERVISOR, _COMMAND_CHANNEL, bytes((_WATCHDOG,)))

    def full_state(
        self, position: Vector, velocity: Vector, acceleration: Vector, yaw: float, yaw_rate: float
    ) -> None:
        """Send a setpoint; see :meth:`onboard.link.drone.DroneLink.send_full_state`."""
        numbers = (*position, *velocity, *acceleration)
        if not all(abs(number) < _LARGEST_SETPOINT for number in (*numbers, yaw, yaw_rate)):
            raise LinkInputError(
                f"the setpoint {numbers}, {yaw} rad, {yaw_rate} rad/s does not fit into a packet: every "
                f"number must be finite and below {_LARGEST_SETPOINT:g}"
            )
        attitude = compress_quaternion((0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)))
        milli = (round(1000.0 * number) for number in numbers)
        payload = _FULL_STATE_LAYOUT.pack(_FULL_STATE, *milli, attitude, 0, 0, round(1000.0 * yaw_rate))
        self._exchange.send(CRTPPort.COMMANDER_GENERIC, _SETPOINT_CHANNEL, payload)

    def end_setpoints(self) -> None:
        """Give the high-level commander its turn; see :meth:`onboard.link.drone.DroneLink.end_setpoints`."""
        for _ in range(_NOTICE_COPIES):
            self._exchange.send(CRTPPort.COMMANDER_GENERIC, _META_CHANNEL, _SETPOINTS_STOPPED)

    def _high_level(
        self,
        name: str,
        payload: bytes,
        *,
        wanted: Callable[[], bool] = always,
        repeatable: bool = True,
        refuses_copies: bool = False,
        is_copy: bool = False,
    ) -> None:
        head = payload[:3]
        reply, copies = self._exchange.ask(
            CRTPPort.SETPOINT_HL,
            0,
            payload,
            accepts=lambda data: len(data) >= 4 and data[: len(head)] == head,
            within=self._within,
            what=f"{name} command",
            retry_s=_COMMANDER_RETRY_S if repeatable else None,
            place=_PLANNER,
            wanted=wanted,
        )
        if reply[3] == errno.EBUSY:
            raise CommandRefused(
                f"the drone refuses {name}, its supervisor does not let it fly: {self._why()}"
            )
        if refuses_copies and reply[3] == _PLANNER_REFUSES and (copies > 1 or is_copy):
            return  # a copy came first, whose answer may be lost: the drone does already what was asked
        if reply[3] != 0:
            raise CommandRefused(f"the drone refuses {name}: error {reply[3]}")

    def _supervisor(self, channel: int, request: bytes, size: int, what: str) -> bytes:
        answer = request[0] | _ANSWER
        reply, _ = self._exchange.ask(
            CRTPPort.SUPERVISOR,
            channel,
            request,
            accepts=lambda data: len(data) >= size and data[0] == answer,
            within=self._within,
            what=what,
        )
        return reply

    def _why(self) -> str:
        """The supervisor's bits in words, for a message about a refusal."""
        bits = SupervisorBits(self.supervisor_info().bits)
        return "supervisor says " + (
            ", ".join(str(bit.name).lower() for bit in bits) or "nothing is possible"
        )
