"""What a commander asks of the controller: one setpoint, with a mode for each axis, in SI and FLU signs.

The firmware's ``setpoint_t`` (``stabilizer_types.h``) keeps degrees and the legacy sign of pitch (nose up
positive); both are converted where packets are decoded (:mod:`sim_backend.crazyflie.commander`), so that only
this form is used inside.
"""

from typing import NamedTuple

from onboard.arrays import Vector
from onboard.follower import Mode

__all__ = ["ZERO", "Mode", "Setpoint"]

ZERO: Vector = (0.0, 0.0, 0.0)


class Setpoint(NamedTuple):
    """Desired state. The default is the null setpoint: everything disabled, motors off.

    It never changes, so that an engine knows one again by its identity; when it was set goes beside it.

    position [m], velocity [m/s] and acceleration [m/s2] in the world frame (velocity x and y in the
    yaw-aligned body frame with `velocity_body`); roll, pitch, yaw [rad] and rates [rad/s] about the body's
    FLU axes; quaternion (x, y, z, w) body to world; thrust 0 to 65535 (used when the z axis is disabled).
    """

    mode_x: Mode = Mode.DISABLED
    mode_y: Mode = Mode.DISABLED
    mode_z: Mode = Mode.DISABLED
    mode_roll: Mode = Mode.DISABLED
    mode_pitch: Mode = Mode.DISABLED
    mode_yaw: Mode = Mode.DISABLED
    mode_quat: Mode = Mode.DISABLED
    position: Vector = ZERO
    velocity: Vector = ZERO
    acceleration: Vector = ZERO
    velocity_body: bool = False
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    rates: Vector = ZERO
    quaternion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    thrust: float = 0.0

    @property
    def is_null(self) -> bool:
        """Whether the setpoint asks for nothing: the motors stop."""
        return self.thrust == 0.0 and not (
            self.mode_x
            or self.mode_y
            or self.mode_z
            or self.mode_roll
            or self.mode_pitch
            or self.mode_yaw
            or self.mode_quat
        )


def complete_setpoint(
    position: Vector,
    velocity: Vector = (0.0, 0.0, 0.0),
    acceleration: Vector = (0.0, 0.0, 0.0),
    yaw: float = 0.0,
) -> Setpoint:
    """A setpoint with everything that the position controller tracks: m, m/s, m/s2, rad."""
    return Setpoint(
        mode_x=Mode.ABSOLUTE,
        mode_y=Mode.ABSOLUTE,
        mode_z=Mode.ABSOLUTE,
        mode_yaw=Mode.ABSOLUTE,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        yaw=yaw,
    )
