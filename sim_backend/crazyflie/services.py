"""What the ports of the simulated drone ask of its firmware: setpoints, and measurements from outside."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_backend.crazyflie.firmware import Firmware

MS = 0.001


class CommanderService:
    """``CommanderPort``: hands setpoints to the parts of the present boot."""

    def __init__(self, firmware: "Firmware") -> None:
        self._fw = firmware

    def high_level(self, command: int, payload: bytes) -> int:
        """Port 8."""
        return self._fw.high_level.command(command, payload, self._fw.tick_ms() * MS)

    def setpoint_generic(self, payload: bytes) -> None:
        """Port 7, channel 0."""
        self._fw.setpoints.generic(payload, self._fw.tick_ms())

    def setpoint_rpyt(self, payload: bytes) -> None:
        """Port 3."""
        self._fw.setpoints.rpyt(payload, self._fw.tick_ms())

    def notify_setpoints_stop(self, remain_valid_ms: int) -> None:
        """Port 7, channel 1; the firmware ignores the time."""
        self._fw.setpoints.relax()


class LocalizationService:
    """``Localization``: external measurements into the estimator, unchecked, with the echo logs."""

    def __init__(self, firmware: "Firmware") -> None:
        self._fw = firmware

    def external_position(self, x: float, y: float, z: float) -> None:
        """Position, m."""
        self._note((x, y, z, *self._fw.last_pose[3:]))
        self._fw.estimator.external_position(x, y, z)

    def external_pose(self, x: float, y: float, z: float, qx: float, qy: float, qz: float, qw: float) -> None:
        """Pose, m and quaternion."""
        self._note((x, y, z, qx, qy, qz, qw))
        self._fw.estimator.external_pose(x, y, z, qx, qy, qz, qw)

    def emergency_stop(self) -> None:
        """Legacy path."""
        self._fw.supervisor.emergency_stop()

    def emergency_stop_watchdog(self) -> None:
        """Legacy path."""
        self._fw.supervisor.kick_emergency_stop_watchdog()

    def _note(self, pose: tuple[float, ...]) -> None:
        self._fw.last_pose = pose
        self._fw.last_pose_tick = self._fw.tick_ms()
        self._fw.poses_received += 1
