"""What the doctor has measured, before anybody judges it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from onboard.arrays import Quaternion, Vector
from onboard.supervisor_info import SupervisorInfo
from onboard.vehicle import Vehicle
from perchhw.supervisor import SafetyLimits


@dataclass(frozen=True, kw_only=True)
class UsbDevice:
    """A radio or a Crazyflie on this computer's USB: its name, and whether we may use it."""

    name: str
    node: str
    usable: bool


@dataclass(frozen=True, kw_only=True)
class HostReadings:
    """This computer.

    Attributes:
        folder: where records go. disk_free: bytes free there; None when it cannot be told.
        disk_problem: why a file cannot be written there, or None.
        usb: what is plugged in of radios and Crazyflies.
        lab_problem: why hardware must not fly without a lab file, or None.
    """

    folder: str
    disk_free: int | None
    disk_problem: str | None
    usb: tuple[UsbDevice, ...]
    lab_problem: str | None


@dataclass(frozen=True, kw_only=True)
class DroneReadings:
    """What a drone answered.

    Attributes:
        round_trips: s, of one question each, in the order in which they were asked.
        parameters: by complete name; those that it does not have are missing here.
        missing: complete names of the landing app's parameters and logs that its tables lack.
        app_memory_problem: why the end of the app's memory cannot be read, or None.
        supervisor: what its supervisor says.
        voltage: V, mean. acceleration: mean of the accelerometer, body, g; None when nothing was logged.
        clock_rate: s of its clock in a second of ours; None when nothing was logged.
    """

    round_trips: tuple[float, ...]
    parameters: Mapping[str, float]
    missing: tuple[str, ...]
    app_memory_problem: str | None
    supervisor: SupervisorInfo
    voltage: float | None
    acceleration: Vector | None
    clock_rate: float | None


@dataclass(frozen=True, kw_only=True)
class MocapReadings:
    """What a source of poses delivered.

    Attributes:
        verdict: of the health monitor at the end, and `error` why the source is not open.
        rate: frames a second. age: s, of the latest of a hundred poses at receipt; None: nothing tells it.
        attitude: of the last good pose, body to world.
    """

    verdict: str
    error: str | None
    rate: float
    age: float | None
    attitude: Quaternion | None


@dataclass(frozen=True, kw_only=True)
class Readings:
    """Everything; None for what was not asked for.

    Attributes:
        drone_uri, mocap_uri: addresses.
        drone: its readings, or why there are none.
        mocap: likewise.
        vehicle: what the drone is believed to be.
        limits: those of its flights, with what the lab file says of them.
    """

    host: HostReadings
    vehicle: Vehicle
    limits: SafetyLimits = field(default_factory=SafetyLimits)
    drone_uri: str | None = None
    drone: DroneReadings | str | None = None
    mocap_uri: str | None = None
    mocap: MocapReadings | None = None
