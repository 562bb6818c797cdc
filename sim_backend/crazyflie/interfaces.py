"""What the CRTP side of a simulated Crazyflie needs from the firmware behind it.

The ports and the server know the firmware only through these protocols. Everything is called from one
thread, the one that runs the server's event loop and advances the world; nothing here may block.

Any method may raise :class:`FirmwareAssertion`: the server then calls :meth:`FirmwarePort.assert_failed`.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from sim_backend.errors import SimulationError

if TYPE_CHECKING:
    from sim_backend.crazyflie.tables import LogTable, ParameterTable

#: Error numbers as the firmware's replies carry them (newlib's ``errno.h``).
ENOENT = 2
EIO = 5
E2BIG = 7
ENOEXEC = 8
ENOMEM = 12
EACCES = 13
EEXIST = 17
EINVAL = 22


class FirmwareAssertion(SimulationError):
    """An ``ASSERT`` of the firmware failed: motors stop at once and the microcontroller resets."""


class Memory(Protocol):
    """One memory of port 4. Ids are the order in :attr:`FirmwarePort.memories`."""

    @property
    def type_id(self) -> int:
        """Memory type, for example 0x18 for the app's memory."""
        ...

    @property
    def size(self) -> int:
        """Size in bytes as the client is told."""
        ...

    def read(self, address: int, length: int, /) -> bytes | None:
        """``length`` bytes from ``address``, or ``None`` (the client gets status EIO)."""
        ...

    def write(self, address: int, data: bytes, /) -> bool:
        """Write ``data``; False: refused, nothing written (the client gets status EIO)."""
        ...


class SupervisorPort(Protocol):
    """The supervisor as port 9 (and the legacy commands of ports 6 and 13) use it."""

    def info_bits(self) -> int:
        """The state as in the log ``supervisor.info`` (``onboard.supervisor_info``), up to 40 ms old."""
        ...

    @property
    def is_armed(self) -> bool:
        """Whether an arming request is in force now."""
        ...

    @property
    def is_crashed(self) -> bool:
        """Whether a crash waits for the recovery command now."""
        ...

    def arm(self, on: bool) -> bool:
        """Arm or disarm; True when the request was accepted."""
        ...

    def recover(self) -> bool:
        """Leave the crashed state; True when the request was accepted."""
        ...

    def emergency_stop(self) -> None:
        """Stop the motors and lock until reboot."""
        ...

    def kick_emergency_stop_watchdog(self) -> None:
        """Start or restart the 1000 ms watchdog; once started it cannot be cancelled."""
        ...


class CommanderPort(Protocol):
    """Setpoints of ports 3, 7 and 8. Payloads arrive with the length that the firmware demands."""

    def high_level(self, command: int, payload: bytes) -> int:
        """A command of port 8 with the bytes after the command byte; returns 0 or an errno."""
        ...

    def setpoint_generic(self, payload: bytes) -> None:
        """Port 7 channel 0: type byte and data. A type the firmware does not know is a null setpoint."""
        ...

    def setpoint_rpyt(self, payload: bytes) -> None:
        """Port 3: ``<fffH`` roll [deg], -pitch [deg], yaw rate [deg/s], thrust, 14 bytes."""
        ...

    def notify_setpoints_stop(self, remain_valid_ms: int) -> None:
        """Port 7 channel 1: let the high-level commander take over again."""
        ...


class Localization(Protocol):
    """External measurements of port 6 for this drone, not checked (as in the firmware: NaN goes through)."""

    def external_position(self, x: float, y: float, z: float) -> None:
        """Position [m], world."""
        ...

    def external_pose(self, x: float, y: float, z: float, qx: float, qy: float, qz: float, qw: float) -> None:
        """Position [m], world, and quaternion body to world."""
        ...

    def emergency_stop(self) -> None:
        """Legacy emergency stop (port 6, type 3)."""
        ...

    def emergency_stop_watchdog(self) -> None:
        """Legacy emergency stop watchdog kick (port 6, type 4)."""
        ...


class FirmwarePort(Protocol):
    """The whole firmware as the server sees it."""

    @property
    def params(self) -> "ParameterTable":
        """All parameters."""
        ...

    @property
    def logs(self) -> "LogTable":
        """All log variables."""
        ...

    @property
    def memories(self) -> Sequence[Memory]:
        """All memories in registration order."""
        ...

    @property
    def supervisor(self) -> SupervisorPort:
        """The supervisor."""
        ...

    @property
    def commander(self) -> CommanderPort:
        """The commander."""
        ...

    @property
    def localization(self) -> Localization:
        """The sink of external measurements."""
        ...

    @property
    def boot_count(self) -> int:
        """Increases with every boot. The server drops log blocks, peer and queues when it changes."""
        ...

    def tick_ms(self) -> int:
        """The drone's own clock: milliseconds since boot."""
        ...

    def on_packet(self) -> None:
        """A packet arrived over the radio, whatever it holds (null packets too)."""
        ...

    def battery_voltage(self) -> float:
        """Battery voltage [V] as the radio chip measures it, also while the microcontroller is off."""
        ...

    def power_off(self) -> None:
        """Power cut by the nRF: motors stop, nothing runs until :meth:`reboot`."""
        ...

    def reboot(self) -> None:
        """Power on or reset: RAM is lost, ``params.reset()``, tick 0, motors off, ``boot_count`` + 1."""
        ...

    def assert_failed(self, reason: str) -> None:
        """Motors stop at once, then reset as in :meth:`reboot`; ``reason`` goes to the console."""
        ...

    def take_console(self) -> list[str]:
        """Console text since the last call; each string is a piece with its own line ends."""
        ...
