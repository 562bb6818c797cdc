"""What a ground station is told of a flight, by a thread that the flight never waits for.

The flight's threads leave what is new in mailboxes of one value each, and words in bounded queues: no lock,
no socket, no wait. The thread here takes them 50 times a second and sends; what came in between is replaced.
"""

import math
import time
from collections.abc import Sequence
from typing import Any

from mocap_bridge.mavlink.address import MavlinkAddress
from mocap_bridge.mavlink.endpoint import MESSAGES
from mocap_bridge.mavlink.frames import swap_attitude, swap_body, swap_world
from mocap_bridge.mavlink.sender import MavlinkSender
from mocap_bridge.mavlink.status_texts import REPEATS_S, StatusTexts
from onboard.arrays import Quaternion, Vector
from onboard.clock import Clock, monotonic

COMPONENT = MESSAGES.MAV_COMP_ID_AUTOPILOT1
"""Who we are to a ground station."""
PERIOD_S = 0.02
HEARTBEAT_PERIOD_S = 1.0
STATUS_PERIOD_S = 0.5
CLOSE_S = 0.4
"""How long the end waits for what is still to be repeated."""
_UNKNOWN_MV = 0xFFFF
_BOOT_MS = 1 << 32


class MavlinkTelemetry(MavlinkSender):
    """A context manager: sends while it is open. All ``set_`` methods and `say` return at once, from any
    thread. Vectors and quaternions are ours (ENU, FLU, x y z w); times are s of the flight's clock.

    Args:
        address: where to.
        clock: the clock by which is sent: the machine's, also where a lab keeps its own.

    Attributes:
        sent: messages so far, those that are lost on the way among them.

    Raises:
        MocapUriError: nobody knows the host.
    """

    def __init__(self, address: MavlinkAddress, clock: Clock = monotonic) -> None:
        super().__init__(address, COMPONENT, clock, "mavlink-telemetry", ends_within=2.0 * CLOSE_S)
        self.sent = 0
        self._texts = StatusTexts()
        self._mail: dict[str, Any] = {}
        self._rates: Vector = (0.0, 0.0, 0.0)
        self._begin: float | None = None
        self._voltage = math.nan
        self._poses_good: bool | None = None
        self._armed = False
        self._state = MESSAGES.MAV_STATE_STANDBY
        self._next_heartbeat = self._next_status = -math.inf

    # From the flight's threads

    def set_position(self, t: float, position: Vector, velocity: Vector) -> None:
        """Estimated position (m) and velocity (m/s) at time `t`."""
        self._mail["position"] = (t, position, velocity)

    def set_attitude(self, t: float, quaternion: Quaternion) -> None:
        """Estimated attitude at time `t`."""
        self._mail["attitude"] = (t, quaternion)

    def set_rates(self, rates: Vector) -> None:
        """Body rates (rad/s), sent with the attitude."""
        self._rates = rates

    def set_voltage(self, volts: float) -> None:
        """Battery voltage (V)."""
        self._voltage = volts

    def set_poses_good(self, good: bool) -> None:
        """Whether motion capture is believed."""
        self._poses_good = good

    def set_state(self, state: int, armed: bool) -> None:
        """The vehicle's MAV_STATE, and whether its motors are armed."""
        self._state, self._armed = state, armed

    def say(self, text: str, severity: int, *, safety: bool = False) -> None:
        """Words of MAV_SEVERITY `severity`; those about `safety` are repeated and numbered."""
        self._texts.say(text, severity, safety=safety)

    # The thread

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._round(self._clock())
            self._endpoint.wait(PERIOD_S)
            if self._listen():
                self._stopping.wait(PERIOD_S)  # who talks much does not make us send more
        for later in REPEATS_S:
            self._round(self._clock() + later)
            if not self._texts.waiting:
                break
            time.sleep(CLOSE_S / len(REPEATS_S))

    def _listen(self) -> bool:
        heard = False
        for received in self._endpoint.receive():
            heard = True
            if (text := self._answer(received)) is not None:
                self.say(text, MESSAGES.MAV_SEVERITY_WARNING)
        return heard

    def _round(self, now: float) -> None:
        for line in self._texts.due(now):
            self._send(MESSAGES.MAVLink_statustext_message(line.severity, line.text.encode(), line.number, 0))
        if (news := self._mail.pop("position", None)) is not None:
            t, position, velocity = news
            self._send(
                MESSAGES.MAVLink_local_position_ned_message(
                    self._boot_ms(t), *swap_world(position), *swap_world(velocity)
                )
            )
        if (news := self._mail.pop("attitude", None)) is not None:
            t, quaternion = news
            x, y, z, w = swap_attitude(quaternion)
            self._send(
                MESSAGES.MAVLink_attitude_quaternion_message(
                    self._boot_ms(t), w, x, y, z, *swap_body(self._rates)
                )
            )
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + HEARTBEAT_PERIOD_S
            self._send(heartbeat(self._state, self._armed))
        if now >= self._next_status:
            self._next_status = now + STATUS_PERIOD_S
            for message in status(self._voltage, self._poses_good, self._armed):
                self._send(message)

    def _boot_ms(self, t: float) -> int:
        """Milliseconds since the first time that was told; another flight's clock begins anew."""
        if self._begin is None or t < self._begin:
            self._begin = t
        return round(1000.0 * (t - self._begin)) % _BOOT_MS

    def _send(self, message: Any) -> None:
        self.sent += 1
        self._endpoint.send(message, self._to)


def heartbeat(state: int, armed: bool) -> Any:
    """A quadrotor's heartbeat: its MAV_STATE, armed or not."""
    mode = MESSAGES.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (MESSAGES.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    return MESSAGES.MAVLink_heartbeat_message(
        MESSAGES.MAV_TYPE_QUADROTOR, MESSAGES.MAV_AUTOPILOT_GENERIC, mode, 0, state, 3
    )


def status(voltage: float, poses_good: bool | None, armed: bool) -> Sequence[Any]:
    """SYS_STATUS and BATTERY_STATUS. `voltage` (V) is NaN while nobody knows it, `poses_good` None where
    nobody judges motion capture; charge and current never are known."""
    poses, battery = MESSAGES.MAV_SYS_STATUS_SENSOR_VISION_POSITION, MESSAGES.MAV_SYS_STATUS_SENSOR_BATTERY
    motors = MESSAGES.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    known = math.isfinite(voltage) and 0.0 <= voltage < 65.0
    millivolts = round(1000.0 * voltage) if known else _UNKNOWN_MV
    poses = 0 if poses_good is None else poses
    present = poses | battery | motors
    health = motors | (poses if poses_good else 0) | (battery if known else 0)
    enabled = present if armed else poses | battery
    return (
        MESSAGES.MAVLink_sys_status_message(
            present, enabled, health, 0, millivolts, -1, -1, 0, 0, 0, 0, 0, 0
        ),
        MESSAGES.MAVLink_battery_status_message(
            0,
            MESSAGES.MAV_BATTERY_FUNCTION_ALL,
            MESSAGES.MAV_BATTERY_TYPE_LIPO,
            0x7FFF,
            [millivolts, *([_UNKNOWN_MV] * 9)],
            -1,
            -1,
            -1,
            -1,
        ),
    )
