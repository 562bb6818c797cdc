"""The one gate between what is reported and what is believed: what fails it is ``None``, hence denied.

A value is admitted when it is of its type, finite, in the range that a Crazyflie in a room can reach or the
message's format can hold, of unit length where it is a rotation, and fresh: its age is known, not negative
and within the limit. The battery's voltage is low-passed here, over the ticks.
"""

from dataclasses import dataclass
from math import exp, isfinite
from typing import TypeVar

from mocap_bridge.health import PoseVerdict
from onboard.app_interface import EndReason, LandingState
from onboard.arrays import Quaternion, Vector
from onboard.supervisor_info import SupervisorInfo
from perchhw.supervisor.limits import SafetyLimits
from perchhw.supervisor.observation import Admitted, Attitude, Observation

LONGEST_AGE = 3600.0
"""s. No value of a flight is older; a clock that says so is wrong."""
FARTHEST = 50.0
"""m from the origin of the world, along each axis. No flight room is larger; the firmware's Kalman filter
calls positions beyond 100 m out of bounds."""
FASTEST = 20.0
"""m/s along each axis: twice what the mocap health monitor believes; nothing flies so in a room."""
FASTEST_ROTATION = 40.0
"""rad/s about each axis: the drone's gyro saturates at 2000 deg/s = 34.9 rad/s."""
LOWEST_VOLTAGE, HIGHEST_VOLTAGE = 2.0, 4.5
"""V. One cell of lithium polymer: below, the drone's regulator has failed; above, no charger goes (4.35)."""
LARGEST_COUNT = 255
"""``perchT.count`` is a uint8."""
LARGEST_CRC = 2**32 - 1
LARGEST_BITS = 2**16 - 1
"""``supervisor.info`` is a uint16."""

_E = TypeVar("_E", PoseVerdict, LandingState, EndReason)


@dataclass(frozen=True, slots=True)
class GateMemory:
    """What the gate carries from tick to tick: the filtered voltage of the battery, V, and its time, s."""

    battery_voltage: float | None = None
    battery_time: float = 0.0


def admit(
    observation: Observation, memory: GateMemory, limits: SafetyLimits, now: float
) -> tuple[Admitted, GateMemory]:
    """What of `observation`, made at `now` (s), is fit to be believed, and what the next call has to know."""
    o = observation
    telemetry = limits.telemetry_age
    pose_age, estimate_age, rates_age = _age(o.pose_age), _age(o.estimate_age), _age(o.rates_age)
    drone_age, battery_age = _age(o.drone_age), _age(o.battery_age)
    landing_age, crc_age = _age(o.landing_age), _age(o.policy_crc_age)
    seen = _fresh(pose_age, limits.pose_age_bridged)
    estimated = _fresh(estimate_age, telemetry)
    landing = _fresh(landing_age, telemetry)
    voltage = _number(o.battery_voltage, LOWEST_VOLTAGE, HIGHEST_VOLTAGE)
    memory = _filtered(voltage if _fresh(battery_age, limits.battery_age) else None, memory, limits, now)
    admitted = Observation(
        link_silence=_age(o.link_silence),
        pose_verdict=_member(PoseVerdict, o.pose_verdict),
        pose_problem=o.pose_problem,
        pose_age=pose_age,
        pose_position=_vector(o.pose_position, FARTHEST) if seen else None,
        pose_quaternion=_rotation(o.pose_quaternion) if seen else None,
        estimate_age=estimate_age,
        estimate_position=_vector(o.estimate_position, FARTHEST) if estimated else None,
        estimate_velocity=_vector(o.estimate_velocity, FASTEST) if estimated else None,
        estimate_quaternion=_rotation(o.estimate_quaternion) if estimated else None,
        rates_age=rates_age,
        body_rates=_vector(o.body_rates, FASTEST_ROTATION) if _fresh(rates_age, telemetry) else None,
        drone=_supervisor(o.drone) if _fresh(drone_age, telemetry) else None,
        drone_age=drone_age,
        battery_voltage=memory.battery_voltage,
        battery_age=battery_age,
        landing_state=_member(LandingState, o.landing_state) if landing else None,
        landing_age=landing_age,
        end_reason=_member(EndReason, o.end_reason) if landing else None,
        trigger_count=_count(o.trigger_count, LARGEST_COUNT) if landing else None,
        active_policy_crc=_count(o.active_policy_crc, LARGEST_CRC) if _fresh(crc_age, telemetry) else None,
        policy_crc_age=crc_age,
        policy_armed=_switch(o.policy_armed),
        trajectory_armed=_switch(o.trajectory_armed),
        parameters_ok=_switch(o.parameters_ok),
        parameters_problem=o.parameters_problem,
    )
    return Admitted(admitted), memory


def _filtered(voltage: float | None, memory: GateMemory, limits: SafetyLimits, now: float) -> GateMemory:
    """The voltage low-passed with the time constant of the limits; it starts afresh after a gap."""
    if voltage is None:
        return GateMemory()
    if memory.battery_voltage is None:
        return GateMemory(voltage, now)
    share = 1.0 - exp(-max(0.0, now - memory.battery_time) / limits.battery_filter)
    return GateMemory(memory.battery_voltage + share * (voltage - memory.battery_voltage), now)


def _number(value: object, low: float, high: float) -> float | None:
    """`value` when it is a finite number between `low` and `high`."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if isfinite(value) and low <= value <= high else None


def _age(value: object) -> float | None:
    return _number(value, 0.0, LONGEST_AGE)


def _fresh(age: float | None, limit: float) -> bool:
    return age is not None and age <= limit


def _parts(value: object, length: int, largest: float) -> tuple[float, ...] | None:
    """`value` when it is a tuple of `length` finite numbers of at most `largest`."""
    if not isinstance(value, tuple) or len(value) != length:
        return None
    parts = [part for part in (_number(part, -largest, largest) for part in value) if part is not None]
    return tuple(parts) if len(parts) == length else None


def _vector(value: object, largest: float) -> Vector | None:
    parts = _parts(value, 3, largest)
    return None if parts is None else (parts[0], parts[1], parts[2])


def _rotation(value: object) -> Quaternion | None:
    parts = _parts(value, 4, 2.0)
    if parts is None:
        return None
    quaternion = (parts[0], parts[1], parts[2], parts[3])
    return None if Attitude.from_quaternion(quaternion) is None else quaternion


def _member(kind: type[_E], value: object) -> _E | None:
    """`value` when it is a member of the enumeration; another firmware may know others."""
    return value if isinstance(value, kind) else None


def _count(value: object, largest: int) -> int | None:
    known = isinstance(value, int) and not isinstance(value, bool)
    return value if isinstance(value, int) and known and 0 <= value <= largest else None


def _switch(value: object) -> bool | None:
    return value if isinstance(value, bool) else None


def _supervisor(value: object) -> SupervisorInfo | None:
    if not isinstance(value, SupervisorInfo) or _count(int(value.bits), LARGEST_BITS) is None:
        return None
    return value
