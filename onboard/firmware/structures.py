"""The core's structures as ctypes has them: the fields of ``core/*.h``, in their order and types."""

from ctypes import Structure, c_bool, c_float, c_uint8, c_uint16, c_uint32
from typing import Any, ClassVar, TypeAlias

Fields: TypeAlias = list[tuple[str, Any]]


def _floats(names: str) -> Fields:
    return [(name, c_float) for name in names.split()]


class PerchVector(Structure):
    """``perch_vector``."""

    _fields_: ClassVar[Fields] = _floats("x y z")


class PerchQuaternion(Structure):
    """``perch_quaternion``: scalar last, body to world."""

    _fields_: ClassVar[Fields] = _floats("x y z w")


class PerchCues(Structure):
    """``perch_cues``: s, rad/s, m."""

    _fields_: ClassVar[Fields] = _floats("tau theta_x d_ceil")


class PerchPlan(Structure):
    """``perch_plan``: the fields of :class:`onboard.trajectory.ApproachPlan`."""

    _fields_: ClassVar[Fields] = _floats("x0 y0 z0 t_x t_z vx vz ax az tau0 impact_x ceiling_z")


class PerchApproach(Structure):
    """``perch_approach``: the arguments of :func:`onboard.trajectory.plan_from_velocity`, in their order."""

    _fields_: ClassVar[Fields] = _floats("vx vz impact_x impact_y ceiling_z ax az tau0")


class PerchMotion(Structure):
    """``perch_motion``: m, m/s, m/s2, world frame."""

    _fields_: ClassVar[Fields] = [
        ("position", PerchVector),
        ("velocity", PerchVector),
        ("acceleration", PerchVector),
    ]


class PerchWrench(Structure):
    """``perch_wrench``: N, N m."""

    _fields_: ClassVar[Fields] = _floats("collective tau_x tau_y tau_z")


class PerchEstimate(Structure):
    """``perch_estimate``: m, m/s, world; body to world; rad/s, body."""

    _fields_: ClassVar[Fields] = [
        ("position", PerchVector),
        ("velocity", PerchVector),
        ("quaternion", PerchQuaternion),
        ("gyro", PerchVector),
    ]


class PerchSetpoint(Structure):
    """``perch_setpoint``: the fields of :class:`sim_backend.crazyflie.setpoint.Setpoint`."""

    _fields_: ClassVar[Fields] = [
        ("mode", c_uint8 * 3),
        ("mode_roll", c_uint8),
        ("mode_pitch", c_uint8),
        ("mode_yaw", c_uint8),
        ("mode_quaternion", c_uint8),
        ("velocity_body", c_bool),
        ("position", PerchVector),
        ("velocity", PerchVector),
        ("acceleration", PerchVector),
        *_floats("roll pitch yaw"),
        ("rates", PerchVector),
        ("quaternion", PerchQuaternion),
        ("thrust", c_float),
        ("age", c_float),
    ]


class PerchInputs(Structure):
    """``perch_inputs``."""

    _fields_: ClassVar[Fields] = [
        ("tick", c_uint32),
        ("pose_age", c_uint32),
        ("estimate", PerchEstimate),
        ("voltage", c_float),
        ("flying", c_bool),
        ("levelling", c_bool),
        ("thrust_seen", c_bool),
        ("setpoint", PerchSetpoint),
    ]


class PerchPolicySample(Structure):
    """``perch_policy_sample``."""

    _fields_: ClassVar[Fields] = [("cues", PerchCues), *_floats("trigger_value a_rot")]


class PerchOutputs(Structure):
    """``perch_outputs``."""

    _fields_: ClassVar[Fields] = [
        ("thrusts", c_float * 4),
        ("duties", c_float * 4),
        ("mean_ratios", c_uint16 * 4),
        ("wrench", PerchWrench),
        ("motion", PerchMotion),
        ("mode", c_uint8),
        ("events", c_uint8),
        ("state", c_uint8),
        ("reason", c_uint8),
        ("trajectory_status", c_uint8),
        ("trajectory_armed", c_bool),
        ("policy_armed", c_bool),
        ("rehearses", c_bool),
        ("policy", PerchPolicySample),
        ("filtered_voltage", c_float),
    ]


class PerchSnapshot(Structure):
    """``perch_snapshot``: the sample that triggered the last flip."""

    _fields_: ClassVar[Fields] = [
        ("tick", c_uint32),
        ("cues", PerchCues),
        *_floats("trigger_value a_rot"),
        ("velocity", PerchVector),
        *_floats("z pitch"),
        ("count", c_uint32),
    ]


class PerchFlightModel(Structure):
    """``perch_flight_model``."""

    _fields_: ClassVar[Fields] = [
        ("estimate", PerchEstimate),
        ("thrusts", c_float * 4),
        ("asked", c_float * 4),
    ]


class PerchView(Structure):
    """``perch_view``."""

    _fields_: ClassVar[Fields] = [
        ("outputs", PerchOutputs),
        ("snapshot", PerchSnapshot),
        ("model", PerchFlightModel),
    ]


class PerchLawSample(Structure):
    """``perch_law_sample``."""

    _fields_: ClassVar[Fields] = [
        ("estimate", PerchEstimate),
        ("own_attitude", PerchQuaternion),
        ("voltage", c_float),
        ("thrusts", c_float * 4),
    ]


class PerchPeriod(Structure):
    """``perch_period``: 10 ms."""

    _fields_: ClassVar[Fields] = [("policy", PerchPolicySample), ("law", PerchLawSample * 2)]


PERIODS = 70
"""Periods that the recorder holds."""


class PerchRecorder(Structure):
    """``perch_recorder``."""

    _fields_: ClassVar[Fields] = [
        ("begun", c_uint32),
        ("last_tick", c_uint32),
        ("stop_tick", c_uint32),
        ("period_bytes", c_uint16),
        ("periods", c_uint8),
        ("state", c_uint8),
        ("period", PerchPeriod * PERIODS),
    ]


class PerchLandingInputs(Structure):
    """``perch_landing_inputs``."""

    _fields_: ClassVar[Fields] = [
        ("tick", c_uint32),
        ("pose_age", c_uint32),
        ("dt", c_float),
        ("position", PerchVector),
        ("velocity", PerchVector),
        ("quaternion", PerchQuaternion),
        ("gyro", PerchVector),
        ("cues", PerchCues),
        *_floats("trigger_value a_rot policy_tau_min"),
        *(
            (name, c_bool)
            for name in ("evaluated", "policy_armed", "trajectory_armed", "go", "abort", "flying")
        ),
    ]


class PerchLandingMemory(Structure):
    """``perch_landing_memory``."""

    _fields_: ClassVar[Fields] = [
        *((name, c_uint8) for name in ("state", "trajectory_status", "reason")),
        *((name, c_bool) for name in ("arm_seen", "go_seen", "attitude_known")),
        ("attitude", PerchQuaternion),
        *((name, c_uint32) for name in ("start_tick", "flip_tick", "usable_tick", "hold_tick")),
        ("hold_position", PerchVector),
        ("hold_velocity", PerchVector),
        ("snapshot", PerchSnapshot),
    ]


class PerchLandingOutput(Structure):
    """``perch_landing_output``."""

    _fields_: ClassVar[Fields] = [
        ("mode", c_uint32),
        ("motion", PerchMotion),
        ("collective", c_float),
        ("thrusts", c_float * 4),
    ]
