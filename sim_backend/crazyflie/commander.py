"""The simulated drone's commander: decodes setpoint packets and decides which one is in force.

Packet layouts: CRTP port 3 (roll, pitch, yaw rate, thrust) and port 7 (generic types); priorities and the
hand-over to the high-level commander as in bitcraze/crazyflie-firmware 2026.08 (``commander.c``,
``crtp_commander_generic.c``, ``crtp_commander_rpyt.c``). A generic packet of the wrong length trips an assert
in the firmware: here :class:`FirmwareAssertion`, on which the drone stops its motors and reboots. Not
modelled: CPPM emulation (type 3, a null setpoint here) and the ``flightmode`` parameters (angle mode always).
"""

import math
import struct
from collections.abc import Callable
from enum import IntEnum

from onboard.arrays import Vector
from sim_backend.crazyflie.interfaces import FirmwareAssertion
from sim_backend.crazyflie.ports.localization import decompress_quaternion
from sim_backend.crazyflie.setpoint import Mode, Setpoint

MINIMUM_THRUST = 1000
MAXIMUM_THRUST = 60000
DEG = math.pi / 180.0


class Priority(IntEnum):
    """Who may overwrite whom."""

    DISABLED = 0
    HIGH_LEVEL = 1
    CRTP = 2
    EXTERNAL_RECEIVER = 3


def compress_quaternion(quaternion: tuple[float, float, float, float]) -> int:
    """The 32-bit form of a unit quaternion (x, y, z, w) as in ``quatcompress.h``."""
    largest = max(range(4), key=lambda i: abs(quaternion[i]))
    negate = quaternion[largest] < 0
    packed = largest
    for index in range(4):
        if index == largest:
            continue
        negative = (quaternion[index] < 0) != negate
        magnitude = int(511.0 * abs(quaternion[index]) / math.sqrt(0.5) + 0.5)
        packed = (packed << 10) | (int(negative) << 9) | min(magnitude, 511)
    return packed


def _velocity(payload: bytes, yaw_sign: float, body: bool) -> Setpoint:
    vx, vy, vz_or_z, yaw_rate = struct.unpack("<4f", payload)
    return Setpoint(
        mode_x=Mode.VELOCITY,
        mode_y=Mode.VELOCITY,
        mode_z=Mode.ABSOLUTE if body else Mode.VELOCITY,
        mode_yaw=Mode.VELOCITY,
        velocity=(vx, vy, 0.0 if body else vz_or_z),
        velocity_body=body,
        rates=(0.0, 0.0, yaw_sign * yaw_rate * DEG),
    )


def _hover(payload: bytes, yaw_sign: float) -> Setpoint:
    vx, vy, yaw_rate, z = struct.unpack("<4f", payload)
    level = _velocity(struct.pack("<4f", vx, vy, 0.0, yaw_rate), yaw_sign, body=True)
    return level._replace(position=(0.0, 0.0, z))


def _level(payload: bytes, yaw_sign: float, z_mode: Mode) -> Setpoint:
    roll, pitch, yaw_rate, z = struct.unpack("<4f", payload)
    return Setpoint(
        mode_z=z_mode,
        mode_roll=Mode.ABSOLUTE,
        mode_pitch=Mode.ABSOLUTE,
        mode_yaw=Mode.VELOCITY,
        position=(0.0, 0.0, z if z_mode is Mode.ABSOLUTE else 0.0),
        velocity=(0.0, 0.0, z if z_mode is Mode.VELOCITY else 0.0),
        roll=roll * DEG,
        pitch=-pitch * DEG,
        rates=(0.0, 0.0, yaw_sign * yaw_rate * DEG),
    )


def _full_state(payload: bytes) -> Setpoint:
    x, y, z, vx, vy, vz, ax, ay, az, packed, wx, wy, wz = struct.unpack("<9hI3h", payload)

    def milli(a: int, b: int, c: int) -> Vector:
        return (a / 1000.0, b / 1000.0, c / 1000.0)

    return Setpoint(
        mode_x=Mode.ABSOLUTE,
        mode_y=Mode.ABSOLUTE,
        mode_z=Mode.ABSOLUTE,
        mode_quat=Mode.ABSOLUTE,
        position=milli(x, y, z),
        velocity=milli(vx, vy, vz),
        acceleration=milli(ax, ay, az),
        quaternion=decompress_quaternion(packed),
        rates=milli(wx, wy, wz),
    )


def _position(payload: bytes) -> Setpoint:
    # The only layout whose length the firmware does not check; what is missing reads as left-over zeros here.
    x, y, z, yaw = struct.unpack("<4f", payload[:16].ljust(16, b"\0"))
    return Setpoint(
        mode_x=Mode.ABSOLUTE,
        mode_y=Mode.ABSOLUTE,
        mode_z=Mode.ABSOLUTE,
        mode_yaw=Mode.ABSOLUTE,
        position=(x, y, z),
        yaw=yaw * DEG,
    )


def _manual(payload: bytes) -> Setpoint:
    roll, pitch, yaw_rate, thrust, rate_mode = struct.unpack("<fffHB", payload)
    mode = Mode.VELOCITY if rate_mode else Mode.ABSOLUTE
    return Setpoint(
        mode_roll=mode,
        mode_pitch=mode,
        mode_yaw=Mode.VELOCITY,
        roll=0.0 if rate_mode else roll * DEG,
        pitch=0.0 if rate_mode else -pitch * DEG,
        # Rates are about the body's axes already: no legacy sign.
        rates=(roll * DEG if rate_mode else 0.0, pitch * DEG if rate_mode else 0.0, yaw_rate * DEG),
        thrust=float(thrust),
    )


_DECODERS: dict[int, Callable[[bytes], Setpoint]] = {
    0: lambda payload: Setpoint(),
    1: lambda payload: _velocity(payload, -1.0, body=False),
    2: lambda payload: _level(payload, -1.0, Mode.ABSOLUTE),
    4: lambda payload: _level(payload, 1.0, Mode.VELOCITY),
    5: lambda payload: _hover(payload, -1.0),
    6: _full_state,
    7: _position,
    8: lambda payload: _velocity(payload, 1.0, body=False),
    9: lambda payload: _level(payload, 1.0, Mode.ABSOLUTE),
    10: lambda payload: _hover(payload, 1.0),
    11: _manual,
}


def decode_generic(payload: bytes) -> Setpoint:
    """Setpoint of a port 7 channel 0 payload (type byte, then data).

    Raises:
        FirmwareAssertion: wrong length for the type.
    """
    if not payload:
        raise FirmwareAssertion("ASSERT failed: empty generic setpoint")
    decoder = _DECODERS.get(payload[0])
    if decoder is None:
        return Setpoint()
    try:
        return decoder(payload[1:])
    except struct.error:
        raise FirmwareAssertion(
            f"ASSERT failed: generic setpoint type {payload[0]} with {len(payload) - 1} bytes of data"
        ) from None


class Commander:
    """Keeps the setpoint in force, the ms since boot at which it was set, and its priority.

    Args:
        high_level_stop: called when a setpoint above high-level priority arrives.
        high_level_tell_state: called when priority is relaxed: the next plan starts where the drone is.
    """

    def __init__(
        self, high_level_stop: Callable[[], None], high_level_tell_state: Callable[[], None]
    ) -> None:
        self.setpoint, self.set_at = Setpoint(), 0
        self.priority = Priority.DISABLED
        self._high_level_stop = high_level_stop
        self._high_level_tell_state = high_level_tell_state
        self._thrust_locked = True

    def set(self, setpoint: Setpoint, priority: Priority, tick_ms: int) -> None:
        """Put `setpoint` in force unless one of higher priority is."""
        if priority < self.priority:
            return
        self.setpoint, self.set_at = setpoint, tick_ms
        self.priority = priority
        if priority > Priority.HIGH_LEVEL:
            self._high_level_stop()

    def relax(self) -> None:
        """Give the high-level commander its turn again (notify-setpoints-stop)."""
        self._high_level_tell_state()
        self.priority = Priority.HIGH_LEVEL

    def generic(self, payload: bytes, tick_ms: int) -> None:
        """A packet on port 7, channel 0. Raises FirmwareAssertion on a wrong length."""
        self.set(decode_generic(payload), Priority.CRTP, tick_ms)

    def rpyt(self, payload: bytes, tick_ms: int) -> None:
        """A packet on port 3: roll, pitch [deg], yaw rate [deg/s], thrust; short packets are dropped."""
        if len(payload) < 14:
            return
        roll, pitch, yaw_rate, thrust = struct.unpack_from("<fffH", payload)
        if self.priority is Priority.DISABLED:
            self._thrust_locked = True
        if thrust == 0:
            self._thrust_locked = False
        usable = 0 if self._thrust_locked or thrust < MINIMUM_THRUST else min(thrust, MAXIMUM_THRUST)
        setpoint = Setpoint(
            mode_roll=Mode.ABSOLUTE,
            mode_pitch=Mode.ABSOLUTE,
            mode_yaw=Mode.VELOCITY,
            roll=roll * DEG,
            pitch=-pitch * DEG,
            rates=(0.0, 0.0, -yaw_rate * DEG),
            thrust=float(usable),
        )
        self.set(setpoint, Priority.CRTP, tick_ms)
