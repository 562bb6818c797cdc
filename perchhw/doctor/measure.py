"""Takes the readings: asks the drone, listens to it and to the motion capture for some seconds."""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.correction import PoseCorrection
from mocap_bridge.health import PoseVerdict
from mocap_bridge.pose import PoseSample
from onboard.app_interface import LOGS, MEMORY_SIZE, MEMORY_TYPE_APP, PARAMETERS, Parameter
from onboard.errors import InputError
from onboard.lab_time import open_timebase
from onboard.link.errors import LinkError
from onboard.room import RoomGeometry
from onboard.timebase import Timebase
from onboard.vehicle import Vehicle
from perchhw.doctor.drone_checks import REVISION, SETTINGS
from perchhw.doctor.readings import DroneReadings, HostReadings, MocapReadings, Readings
from perchhw.doctor.usb import usb_devices
from perchhw.lab.flying import correction_of, limits_of
from perchhw.lab.hardware import require_lab
from perchhw.supervisor import SafetyLimits

if TYPE_CHECKING:
    from onboard.lab_file import LabFile
    from onboard.link import DroneLink, LogSample

ROUND_TRIPS = 20
_LOGGED: Final = ("pm.vbat", "acc.x", "acc.y", "acc.z")
_PERIOD_MS = 10
_ASKED: Final = (REVISION, Parameter.VERSION, Parameter.VEHICLE_CRC, Parameter.REHEARSE, *SETTINGS)


def take_readings(
    *,
    drone: str | None,
    mocap: str | None,
    vehicle: Vehicle,
    lab: "LabFile | None",
    folder: Path,
    seconds: float,
) -> Readings:
    """Look at everything that was asked for. A drone that cannot be reached is a reading as well.

    Args:
        drone, mocap: addresses, None: not asked for.
        vehicle: what the drone is believed to be.
        lab: the lab file that counts.
        folder: where records go.
        seconds: how long to listen.

    Raises:
        InputError: an address that cannot be used. DroneInUse: somebody else talks to the drone.
    """
    host = host_readings(drone, mocap, lab, folder)
    with open_timebase("doctor", *(uri for uri in (drone, mocap) if uri is not None)) as time:
        ages: list[float] = []
        bridge = _bridge(mocap, time, correction_of(lab), ages)
        if bridge is not None:
            bridge.start()
        try:
            answered = None if drone is None else _drone(drone, time, seconds)
            if bridge is not None:
                bridge.wait_for(lambda _: False, seconds)
            heard = None if bridge is None else _mocap(bridge, ages)
        finally:
            if bridge is not None:
                bridge.stop()
    return Readings(
        host=host,
        vehicle=vehicle,
        limits=SafetyLimits() if drone is None else limits_of(lab, RoomGeometry(), drone),
        drone_uri=drone,
        drone=answered,
        mocap_uri=mocap,
        mocap=heard,
    )


def host_readings(drone: str | None, mocap: str | None, lab: "LabFile | None", folder: Path) -> HostReadings:
    """This computer, and whether a flight here needs a lab file that there is not."""
    place = folder if folder.exists() else Path.cwd()
    free, problem = None, None
    try:
        free = shutil.disk_usage(place).free
        with tempfile.TemporaryFile(dir=place) as probe:
            probe.write(bytes(65536))
    except OSError as error:
        problem = error.strerror or str(error)
    lab_problem = None
    if drone is not None and mocap is not None:
        try:
            require_lab(drone, mocap, lab)
        except InputError as error:
            lab_problem = str(error)
    return HostReadings(
        folder=str(place), disk_free=free, disk_problem=problem, usb=usb_devices(), lab_problem=lab_problem
    )


def _drone(uri: str, time: Timebase, seconds: float) -> DroneReadings | str:
    """Its answers, or why there are none."""
    from onboard.link import DroneLink

    try:
        with DroneLink.open(uri, clock=time) as link:
            return _answers(link, time, seconds)
    except LinkError as error:
        if isinstance(error, InputError):
            raise
        return str(error)


def _answers(link: "DroneLink", time: Timebase, seconds: float) -> DroneReadings:
    parameters = {str(name): float(link.param(name)) for name in _ASKED if link.has_param(name)}
    absent = [str(entry.name) for entry in PARAMETERS if not link.has_param(entry.name)]
    absent += [str(entry.name) for entry in LOGS if not link.has_log(entry.name)]
    round_trips = []
    for _ in range(ROUND_TRIPS):
        asked_at = time()
        link.supervisor_info()
        round_trips.append(time() - asked_at)
    samples: list[LogSample] = []
    _listen(link, time, seconds, samples.append)
    means = {name: sum(s.values[name] for s in samples) / len(samples) for name in _LOGGED if samples}
    return DroneReadings(
        round_trips=tuple(round_trips),
        parameters=parameters,
        missing=tuple(dict.fromkeys(absent)),
        app_memory_problem=_memory_problem(link),
        supervisor=link.supervisor_info(),  # last: a drone that has just booted cannot arm yet
        voltage=means.get("pm.vbat"),
        acceleration=(means["acc.x"], means["acc.y"], means["acc.z"]) if means else None,
        clock_rate=_clock_rate(samples),
    )


def _listen(link: "DroneLink", time: Timebase, seconds: float, take: Callable[["LogSample"], None]) -> None:
    """Log for some seconds, where the firmware has what is logged."""
    if not all(link.has_log(name) for name in _LOGGED):
        return
    with link.stream(_LOGGED, _PERIOD_MS, take):
        time.event().wait(seconds)


def _memory_problem(link: "DroneLink") -> str | None:
    """Why the last bytes of the app's memory cannot be read."""
    try:
        link.read_memory(MEMORY_TYPE_APP, MEMORY_SIZE - 4, 4)
    except LinkError as error:
        return str(error)
    return None


def _clock_rate(samples: list["LogSample"]) -> float | None:
    if len(samples) < 2:
        return None
    ours = samples[-1].receipt_time - samples[0].receipt_time
    theirs = (samples[-1].drone_time_ms - samples[0].drone_time_ms) / 1e3
    return theirs / ours if ours > 0.0 else None


def _bridge(
    uri: str | None, time: Timebase, correction: PoseCorrection, ages: list[float]
) -> PoseBridge | None:
    def note_age(sample: PoseSample, _: PoseVerdict) -> None:
        if sample.latency is not None or sample.source_time is not None or correction.latency > 0.0:
            ages.append(sample.receipt_time - sample.capture_time)

    if uri is None:
        return None
    return PoseBridge(uri, sink=None, clock=time, on_sample=note_age, correction=correction)


def _mocap(bridge: PoseBridge, ages: list[float]) -> MocapReadings:
    status = bridge.status()
    ordered = sorted(ages)
    good = status.last_good
    return MocapReadings(
        verdict=status.verdict.value,
        error=status.error,
        rate=status.rate_hz,
        age=ordered[int(0.99 * (len(ordered) - 1))] if ordered else None,
        attitude=None if good is None else good.quaternion,
    )
