"""What the drone and the room last said: streams into the record, and one :class:`Observation` on demand."""

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from mocap_bridge.bridge import BridgeStatus, PoseBridge
from mocap_bridge.health import PoseVerdict
from mocap_bridge.pose import PoseSample
from onboard.app_interface import EndReason, LandingState, Log, Parameter
from onboard.arrays import Quaternion
from onboard.gravity import GRAVITY
from onboard.supervisor_info import SupervisorInfo
from onboard.timebase import Timebase
from perchhw.flight.downlink import Downlink
from perchhw.flight.host_load import Lateness
from perchhw.flight.readback import ReadBack
from perchhw.flight.recording import FlightRecorder
from perchhw.supervisor import Observation

if TYPE_CHECKING:
    from onboard.link import DroneLink, LogSample

_E = TypeVar("_E", LandingState, EndReason)

_RAD = 0.017453292519943295


class LoggedField(NamedTuple):
    """A field of a record's topic, the factor that brings the drone's unit to the record's, and whether the
    drone sends it in half precision."""

    topic: str
    name: str
    scale: float = 1.0
    half: bool = False


def _fields(
    group: str, topic: str, names: str, targets: str, scale: float = 1.0, *, half: bool = False
) -> dict[str, LoggedField]:
    return {
        f"{group}.{a}": LoggedField(topic, b, scale, half)
        for a, b in zip(names.split(), targets.split(), strict=True)
    }


class TelemetryBlock(NamedTuple):
    """One log block (at most 26 bytes): its period and where its variables go in the record."""

    period_ms: int
    variables: dict[str, LoggedField]

    def averaged(self) -> "TelemetryBlock":
        """The same with the mean motor ratios of our law in the place of those of an instant."""
        return self._replace(
            variables={
                name.replace("motor.", "perch.") if field.topic == "motors" else name: field
                for name, field in self.variables.items()
            }
        )


_MOTION = {
    **_fields("stateEstimateZ", "estimate", "x y z vx vy vz", "x y z vx vy vz", 1e-3),
    **_fields("stateEstimate", "estimate", "qx qy qz qw", "qx qy qz qw", half=True),
}
"""mm and mm/s as int16: the room may be 65 m wide, and what is beyond comes back at the other end."""

_MOTORS = _fields("motor", "motors", "m1 m2 m3 m4", "m1 m2 m3 m4")

_MEAN_AGE_MS = 4
"""By so much a mean over five steps (:data:`onboard.app_interface.AVERAGED_MS`) is older than the last."""

_POWER = {"pm.vbat": LoggedField("power", "vbat", half=True), "pm.state": LoggedField("power", "state")}

_ACCELERATION = _fields("acc", "acceleration", "x y z", "ax ay az", GRAVITY, half=True)

BLOCKS: tuple[TelemetryBlock, ...] = (
    TelemetryBlock(10, {**_MOTION, **_fields("gyro", "rates", "x y z", "gx gy gz", _RAD, half=True)}),
    TelemetryBlock(
        10,
        {
            **_fields(
                "perch",
                "cues",
                "tau thetaX dCeil trigVal aRot",
                "tau theta_x d_ceil trigger_value a_rot",
                half=True,
            ),
            "perch.state": LoggedField("cues", "state"),
            "perch.reason": LoggedField("cues", "reason"),
            "perchT.count": LoggedField("trigger", "count"),
            "supervisor.info": LoggedField("supervisor", "bits"),
            **_MOTORS,
            **_POWER,
        },
    ),
    TelemetryBlock(50, {**_ACCELERATION, "perch.polCrc": LoggedField("", "policy_crc")}),
    TelemetryBlock(
        50,
        {
            **_fields(
                "perchT",
                "trigger",
                "tick tau thetaX dCeil trigVal aRot",
                "tick_ms tau theta_x d_ceil trigger_value a_rot",
            ),
            "perchT.count": LoggedField("", "count_of_cues"),
        },
    ),
    TelemetryBlock(
        50,
        {
            **_fields("perchT", "trigger", "vx vy vz z pitch", "vx vy vz z pitch"),
            "perchT.count": LoggedField("", "count_of_motion"),
        },
    ),
)
"""The log blocks of a landing attempt. Variables with an empty topic are watched but not recorded.

They are 260 packets a second, of the 300 that Bitcraze's tests of the radio demand: what does not fit fills
the drone's queue of 200 packets, and every answer then waits behind them.
"""

TEST_FLIGHT_BLOCKS: tuple[TelemetryBlock, ...] = (
    TelemetryBlock(10, {**_MOTION, "supervisor.info": LoggedField("supervisor", "bits"), **_POWER}),
    TelemetryBlock(10, {**_fields("gyro", "rates", "x y z", "gx gy gz", _RAD), **_ACCELERATION, **_MOTORS}),
)
"""The log blocks of a test flight: what the gap finder uses at 100 Hz, nothing of the landing app."""


_RATE_NEEDS_S = 1.0
"""Shortest time that tells the rate of a clock, s."""


class _Latest(NamedTuple):
    """The newest content of a block: receipt time (s), drone time (ms), by how much it was later than the
    quickest (s), values by (topic, field)."""

    receipt_time: float
    drone_time_ms: int
    late_s: float
    values: dict[tuple[str, str], float]


class Telemetry:
    """Subscribes to the drone's log blocks, records them, and keeps the newest of each.

    A block whose drone time does not advance is not new: a frozen drone's values grow old here. Nor is one
    that has waited on its way: by as much as it is later than the quickest it is older, as far as the link's
    round trips bear that out. A simulated drone on a machine that is too busy falls behind without a wait.

    Args:
        link: an open link; `start` opens the log blocks.
        bridge: the running pose bridge.
        record: where everything goes.
        readback: what the drone was asked, and not logs.
        clock: time of the flight.
        blocks: what to subscribe to.
        lateness: is told how long each message waited, from its receipt on.
    """

    def __init__(
        self,
        link: "DroneLink",
        bridge: PoseBridge,
        record: FlightRecorder,
        readback: ReadBack,
        clock: Timebase,
        blocks: tuple[TelemetryBlock, ...] = BLOCKS,
        lateness: Lateness | None = None,
    ) -> None:
        self._blocks = blocks
        self._link = link
        self._bridge = bridge
        self._flight_record = record
        self._readback = readback
        self._clock = clock
        self._latest: dict[int, _Latest] = {}
        self._first: dict[int, _Latest] = {}
        self._block_of = {
            (field.topic, field.name): index
            for index, block in enumerate(blocks)
            for field in block.variables.values()
        }
        self._lock = threading.Lock()
        self._lateness = Lateness() if lateness is None else lateness
        self._trigger_written = False
        self._averaged = False

    def start(self) -> None:
        """Open all log blocks on the drone."""
        self._averaged = self._link.has_log(Log.MEAN_M1) and self._link.param(Parameter.OWN_LAW) == 1
        for index, block in enumerate(self._blocks):
            if self._averaged:
                block = block.averaged()
            halves = {name for name, field in block.variables.items() if field.half}
            receive = self._receiver(index, block)
            self._link.stream(tuple(block.variables), block.period_ms, receive, halves=halves)

    def _receiver(self, index: int, block: TelemetryBlock) -> "Callable[[LogSample], None]":
        downlink = Downlink()

        def receive(sample: "LogSample") -> None:
            self._lateness.note(self._clock() - sample.receipt_time)
            values = {
                (target.topic, target.name): sample.values[variable] * target.scale
                for variable, target in block.variables.items()
            }
            late = downlink.late(sample.receipt_time, sample.drone_time_ms)
            with self._lock:
                previous = self._latest.get(index)
                if previous is not None and sample.drone_time_ms <= previous.drone_time_ms:
                    return
                self._latest[index] = _Latest(sample.receipt_time, sample.drone_time_ms, late, values)
                self._first.setdefault(index, self._latest[index])
            self._record(sample.receipt_time, sample.drone_time_ms, values)

        return receive

    def _record(self, receipt_time: float, drone_time_ms: int, values: dict[tuple[str, str], float]) -> None:
        by_topic: dict[str, dict[str, float]] = {}
        for (topic, name), value in values.items():
            by_topic.setdefault(topic, {})[name] = value
        for topic, fields in by_topic.items():
            if topic in ("", "trigger"):
                continue
            age = _MEAN_AGE_MS if topic == "motors" and self._averaged else 0
            stamped = {**fields, "drone_time_ms": drone_time_ms - age}
            self._flight_record.write(topic, receipt_time - 1e-3 * age, stamped)

    def value(self, topic: str, name: str) -> float | None:
        """The newest value of a field, or ``None`` when it never came."""
        return self._with_age(topic, name)[0]

    def _with_age(self, topic: str, name: str) -> tuple[float | None, float | None]:
        latest = self._latest.get(self._block_of.get((topic, name), -1))
        if latest is None:
            return None, None
        waited = min(latest.late_s, self._link.round_trip()) if latest.late_s > 0.0 else 0.0
        return latest.values[topic, name], self._clock() - latest.receipt_time + waited

    def drone_clock_rate(self) -> float | None:
        """Seconds of the drone's clock in a second of the flight's, over all that came; ``None``: too little.

        A crystal is within 1e-4 of one. A simulated lab that should live in real time and does not is below.
        """
        with self._lock:
            first, latest = self._first.get(0), self._latest.get(0)
        if first is None or latest is None or latest.receipt_time - first.receipt_time < _RATE_NEEDS_S:
            return None
        elapsed_ms = latest.drone_time_ms - first.drone_time_ms
        return elapsed_ms / 1000.0 / (latest.receipt_time - first.receipt_time)

    def trigger_snapshot(self) -> dict[str, float] | None:
        """The drone's snapshot of its trigger, or ``None`` when it never fired, or is torn.

        It comes in two blocks; each brings the count that it belongs to, which the drone writes last.
        """
        count = self.value("trigger", "count")
        if (
            not count
            or self.value("", "count_of_cues") != count
            or self.value("", "count_of_motion") != count
        ):
            return None
        with self._lock:
            return {
                name: value
                for latest in self._latest.values()
                for (topic, name), value in latest.values.items()
                if topic == "trigger"
            }

    def _triple(self, topic: str, names: str) -> tuple[float, float, float] | None:
        x, y, z = (self.value(topic, name) for name in names.split())
        return None if x is None or y is None or z is None else (x, y, z)

    def _quaternion(self) -> Quaternion | None:
        x, y, z, w = (self.value("estimate", name) for name in ("qx", "qy", "qz", "qw"))
        return None if x is None or y is None or z is None or w is None else (x, y, z, w)

    def observe(self) -> Observation:
        """Everything that is known now, with ages; what never came is ``None``."""
        pose = self._bridge.status()
        good = pose.last_good
        bits, bits_age = self._with_age("supervisor", "bits")
        vbat, vbat_age = self._with_age("power", "vbat")
        landing, landing_age = self._with_age("cues", "state")
        reason = self.value("cues", "reason")
        count = self.value("trigger", "count")
        crc, crc_age = self._with_age("", "policy_crc")
        return Observation(
            link_silence=self._link.silence(),
            pose_verdict=pose.verdict,
            pose_problem=_pose_problem(pose),
            pose_age=pose.age,
            pose_position=None if good is None else good.position,
            pose_quaternion=None if good is None else good.quaternion,
            estimate_age=self._with_age("estimate", "x")[1],
            estimate_position=self._triple("estimate", "x y z"),
            estimate_velocity=self._triple("estimate", "vx vy vz"),
            rates_age=self._with_age("rates", "gx")[1],
            body_rates=self._triple("rates", "gx gy gz"),
            estimate_quaternion=self._quaternion(),
            drone=None if bits is None else SupervisorInfo(int(bits)),
            drone_age=bits_age,
            battery_voltage=vbat,
            battery_age=vbat_age,
            landing_state=None if landing is None else _known(LandingState, landing),
            landing_age=landing_age,
            end_reason=None if reason is None else _known(EndReason, reason),
            active_policy_crc=None if crc is None else int(crc),
            policy_crc_age=crc_age,
            trigger_count=None if count is None else int(count),
            policy_armed=self._readback.policy_armed,
            trajectory_armed=self._readback.trajectory_armed,
            parameters_ok=self._readback.parameters_ok,
            parameters_problem=self._readback.parameters_problem,
        )


def _known(kind: type[_E], value: float) -> _E | None:
    """The member of an enumeration, or ``None`` for a value that this version does not know."""
    return next((member for member in kind if member == value), None)


def _pose_problem(pose: BridgeStatus) -> str | None:
    """Why there are no good poses, in words, or ``None``."""
    if pose.error is not None or pose.verdict is PoseVerdict.OK:
        return pose.error
    refused = ", ".join(
        f"{count} {verdict.name.lower()}" for verdict, count in pose.health.rejects.items() if count
    )
    return f"refused so far: {refused}" if refused else None


def pose_recorder(flight_record: FlightRecorder) -> Callable[[PoseSample, PoseVerdict], None]:
    """A callback for the pose bridge that records every sample with the verdict given to it."""

    def record(sample: PoseSample, verdict: PoseVerdict) -> None:
        x, y, z = sample.position or (None, None, None)
        qx, qy, qz, qw = sample.quaternion or (None, None, None, None)
        flight_record.write(
            "pose",
            sample.receipt_time,
            {
                **{"x": x, "y": y, "z": z, "qx": qx, "qy": qy, "qz": qz, "qw": qw},
                "frame": sample.frame,
                "verdict": verdict.name,
                "capture_time": sample.capture_time,
            },
        )

    return record
