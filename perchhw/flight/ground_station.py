"""A flight as a ground station sees it: what goes into the record also goes out as MAVLink.

The record's listener only fills mailboxes; the thread that sends is :mod:`mocap_bridge.mavlink.telemetry`'s
own, and nothing that happens to it reaches the flight.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from mocap_bridge.health import PoseVerdict
from onboard.record.recorder import Scalar
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.flight.recording import RecordListener
from perchhw.supervisor import Phase

if TYPE_CHECKING:
    from mocap_bridge.mavlink.telemetry import MavlinkTelemetry

EMERGENCY, ALERT, CRITICAL, NOTICE, INFO = 0, 1, 2, 5, 6
"""MAV_SEVERITY (https://mavlink.io/en/messages/common.html#MAV_SEVERITY)."""
_STANDBY, _ACTIVE, _IN_TROUBLE, _STOPPING = 3, 4, 5, 6
"""MAV_STATE."""
_ON_THE_GROUND = frozenset(
    {Phase.CHECKING, Phase.UPLOADING, Phase.READY, Phase.DISARMING, Phase.DONE},
)
_SAFETY_EVENTS = frozenset(
    {
        "CommandFailed",
        "StopConfirmed",
        "StopUnconfirmed",
        "LinkDown",
        "RecordLost",
        "InternalError",
        "HostStoodStill",
        "OperatorAbort",
    }
)
"""Events of the supervisor that are told word for word."""
_FINDINGS = {
    SupervisorBits.TUMBLED: "the drone has tumbled",
    SupervisorBits.CRASHED: "the drone has crashed: it flies again after a recovery command",
    SupervisorBits.LOCKED: "the drone is locked: only a reboot helps",
}
"""What the supervisor on board finds of a drone that others fly; in our flights the phases tell it."""


@contextmanager
def ground_station(uri: str | None) -> Iterator[RecordListener | None]:
    """What tells the ground station at `uri` (``mavlink://HOST:PORT``), while it is open; None for None.

    Raises:
        MocapUriError: the address cannot be used, or nobody knows the host.
    """
    if uri is None:
        yield None
        return
    from mocap_bridge.mavlink.address import parse_mavlink_address
    from mocap_bridge.mavlink.telemetry import MavlinkTelemetry

    with MavlinkTelemetry(parse_mavlink_address(uri)) as telemetry:
        yield GroundStation(telemetry)


class Listeners:
    """Several listeners as one.

    Args:
        listeners: in the order in which they hear; None is nobody.
    """

    def __init__(self, *listeners: RecordListener | None) -> None:
        self._listeners = [listener for listener in listeners if listener is not None]

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """To each."""
        for listener in self._listeners:
            listener.write(topic, t, values)

    def event(self, name: str, t: float, fields: Mapping[str, Any]) -> None:
        """To each."""
        for listener in self._listeners:
            listener.event(name, t, fields)


class GroundStation:
    """Turns topics and events of a record into telemetry (a ``RecordListener``).

    Args:
        telemetry: open.
    """

    def __init__(self, telemetry: "MavlinkTelemetry") -> None:
        self._telemetry = telemetry
        self._phase: Phase | None = None
        self._drone = SupervisorInfo(0)
        self._aborted_by: str | None = None
        self._alert: str | None = None

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """The newest values of what a ground station shows."""
        tell = _TOPICS.get(topic)
        if tell is not None:
            tell(self, t, values)

    def event(self, name: str, t: float, fields: Mapping[str, Any]) -> None:
        """What the supervisor says, in its own words."""
        say = self._telemetry.say
        if name == "phase":
            self._phase_changed(fields)
        elif name in _SAFETY_EVENTS:
            say(str(fields.get("what", name)), CRITICAL, safety=True)
        elif name == "command" and str(fields.get("command")).startswith("EmergencyStop"):
            say("emergency stop: motors are cut", ALERT, safety=True)
        elif name == "internal_error":
            say(f"internal error: {fields.get('error')}", CRITICAL, safety=True)
        elif name == "refused":
            say(f"refused: {fields.get('reason')}", CRITICAL, safety=True)
        elif name == "labelled":
            say(f"outcome: {fields.get('outcome')}", NOTICE)

    def _phase_changed(self, fields: Mapping[str, Any]) -> None:
        phase, aborted_by, alert = Phase(fields["phase"]), fields.get("aborted_by"), fields.get("alert")
        if phase is not self._phase:
            self._telemetry.say(phase.value, INFO)
        if aborted_by is not None and aborted_by != self._aborted_by:
            self._telemetry.say(f"aborted: {aborted_by}", CRITICAL, safety=True)
        if alert is not None and alert != self._alert:
            self._telemetry.say(str(alert), EMERGENCY, safety=True)
        self._phase, self._aborted_by, self._alert = phase, aborted_by, alert
        self._tell_state()

    def _tell_state(self) -> None:
        self._telemetry.set_state(self._state(), self._drone.is_armed)

    def _state(self) -> int:
        """The MAV_STATE, by the flight's phase; of a drone that others fly, by its own supervisor."""
        if self._phase is None:
            in_trouble = self._drone.is_tumbled or self._drone.is_crashed or self._drone.is_locked
            return _IN_TROUBLE if in_trouble else _ACTIVE if self._drone.is_flying else _STANDBY
        if self._phase is Phase.STOPPING:
            return _STOPPING
        if self._phase in _ON_THE_GROUND:
            return _STANDBY
        return _ACTIVE if self._aborted_by is None else _IN_TROUBLE

    def _estimate(self, t: float, values: Mapping[str, Scalar]) -> None:
        where = [values.get(name) for name in ("x", "y", "z", "vx", "vy", "vz")]
        turned = [values.get(name) for name in ("qx", "qy", "qz", "qw")]
        if (numbers := _numbers(where)) is not None:
            x, y, z, vx, vy, vz = numbers
            self._telemetry.set_position(t, (x, y, z), (vx, vy, vz))
        if (numbers := _numbers(turned)) is not None:
            qx, qy, qz, qw = numbers
            self._telemetry.set_attitude(t, (qx, qy, qz, qw))

    def _rates(self, t: float, values: Mapping[str, Scalar]) -> None:
        if (numbers := _numbers([values.get(name) for name in ("gx", "gy", "gz")])) is not None:
            gx, gy, gz = numbers
            self._telemetry.set_rates((gx, gy, gz))

    def _power(self, t: float, values: Mapping[str, Scalar]) -> None:
        if (numbers := _numbers([values.get("vbat")])) is not None:
            self._telemetry.set_voltage(numbers[0])

    def _pose(self, t: float, values: Mapping[str, Scalar]) -> None:
        self._telemetry.set_poses_good(values.get("verdict") == PoseVerdict.OK.name)

    def _supervisor(self, t: float, values: Mapping[str, Scalar]) -> None:
        if (numbers := _numbers([values.get("bits")])) is not None:
            before, self._drone = self._drone, SupervisorInfo(int(numbers[0]))
            if self._phase is None:
                for finding, words in _FINDINGS.items():
                    if self._drone.bits & finding and not before.bits & finding:
                        self._telemetry.say(words, CRITICAL, safety=True)
            self._tell_state()


_TOPICS = {
    "estimate": GroundStation._estimate,
    "rates": GroundStation._rates,
    "power": GroundStation._power,
    "pose": GroundStation._pose,
    "supervisor": GroundStation._supervisor,
}


def _numbers(values: list[Scalar]) -> list[float] | None:
    """All of them as numbers, or None when one is missing."""
    numbers = [float(value) for value in values if isinstance(value, int | float)]
    return numbers if len(numbers) == len(values) else None
