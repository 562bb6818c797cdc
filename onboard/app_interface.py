"""The interface of our firmware app: parameters, logs and memory, as ground and drone both see it.

One place for the names, types and enumerations that the link, the simulated drone and the app in C share.
Parameter group ``perch``; log groups ``perch`` (now), ``perchT`` (snapshot at the trigger) and ``perchM``
(the model of the vehicle, in a rehearsal on it). Parameters are volatile: after a reboot they have their
defaults and there is no policy.

`OWN_LAW` says who flies take-off, hover and level-out, as the planner asks: 1 our law, 0 the firmware's PID.
The simulated drone has no such PID; there it is always 1.
`MOTOR_TOKEN` is written again and again by a host whose bench test runs motors through ``motorPowerSet``.
Once it has been written, the app unsets them when it has not been written for `MOTOR_TOKEN_MS`; the motors
are off within `MOTOR_STOP_MS` of the last write.

`REHEARSE` switches a rehearsal on the desk (`Rehearsal`): landing machine, policy and law compute as in
flight, on poses that the host sends or on a model of the vehicle that the drone flies itself, and nothing
turns. An approach that is armed finds the model hovering at its start. A rehearsal is taken only while the
supervisor is neither armed nor flying, no motor has a thrust and the landing machine is IDLE; otherwise it
reads back 0. While it is on the drone cannot be armed, and a thrust that is seen ends it. However it ends,
all switches are off then, and the machine IDLE.

The recorder runs from the arming of an approach until 0.3 s after its end, and is read from `RECORD_ADDRESS`
on.

Policy upload: write the bundle to the app memory from address 0, read it back, set `POLICY_LENGTH` and
`POLICY_CRC`, write 1 to `POLICY_COMMIT`, then read `POLICY_STATUS` and `POLICY_ACTIVE_CRC`.

The drone answers late. A write is echoed before the app knows of it: the app's callback runs after the echo,
in the firmware's parameter task, and packets for that task queue behind it. The callback of `TRAJECTORY_ARM`
posts a request with a snapshot of the plan and waits, `REQUEST_TIMEOUT_MS` at most, until the control loop
has consumed it; until then `TRAJECTORY_STATUS` is NONE. `GO` and `ABORT` are flags that the control loop
consumes and clears, once. Switches that are cleared in HOLD hand the drone back; `STATE` says when it has
happened.
"""

from dataclasses import dataclass
from enum import IntEnum, StrEnum

AVERAGED_MS = 10
"""`Log.MEAN_M1` to `MEAN_M4` are the means of the motor ratios that the law gave in so long a time. Steps of
2 ms that were logged one by one would tell what happens to coincide with the log: each correction of the
estimate by a pose, and none of its answers (aliasing)."""

INTERFACE_VERSION = 2
"""Value of `Parameter.VERSION`; a host refuses any other."""

REQUEST_TIMEOUT_MS = 20
"""Longest wait of a callback for the control loop: other parameters and the link must not starve."""

MOTOR_STOP_MS = 250
"""Motors of a bench test outlive the last write of `Parameter.MOTOR_TOKEN` by this at most."""

MOTOR_TOKEN_MS = 220
"""How long the drone takes such a write for a living host; the rest is for tasks that must wait."""

MEMORY_TYPE_APP = 0x18
"""Memory type that the firmware reserves for apps (MEM_TYPE_APP)."""

MEMORY_SIZE = 5120
"""Bytes of the app memory that can be written; the bundle is staged from `BUNDLE_ADDRESS` on."""

BUNDLE_ADDRESS = 0

RECORD_ADDRESS = 0x10000
"""Where the recorder begins in the app memory, to be read only: :mod:`onboard.ring`."""


class PolicyStatus(IntEnum):
    """`Parameter.POLICY_STATUS`: 16 and above say why the last commit was refused.

    A refusal keeps the previous policy live.
    """

    NONE = 0
    ACTIVE = 1
    REFUSED_LENGTH = 16
    REFUSED_CRC = 17
    REFUSED_FORMAT = 18
    REFUSED_RANGE = 19
    REFUSED_FLYING = 20
    REFUSED_VECTORS = 21


class TrajectoryStatus(IntEnum):
    """`Parameter.TRAJECTORY_STATUS`: 16 and above say why the last arming was refused."""

    NONE = 0
    ARMED = 1
    FLYING = 2
    REFUSED_TOO_FAR = 16
    REFUSED_NUMBERS = 17
    REFUSED_NOT_FLYING = 18


class LandingState(IntEnum):
    """State of the landing state machine (:mod:`onboard.landing.state_machine`): `Log.STATE`, and to be asked
    for as `Parameter.STATE`."""

    IDLE = 0
    TRAJECTORY_ARMED = 1
    APPROACH = 2
    FLIP = 3
    CUT = 4
    BRAKE = 5
    HOLD = 6
    FAULT = 7


class EndReason(IntEnum):
    """Why an approach ended, `Log.REASON`."""

    NONE = 0
    TRIGGERED = 1
    MISSED_TRIGGER = 2
    ABORT = 3
    DISARMED = 4
    BAD_ESTIMATE = 5
    OFF_TRACK = 6
    TILT = 7
    CONTACT = 8
    NOT_FLYING = 9
    POSE_LOST = 10


class RecorderState(IntEnum):
    """What the drone's recorder does (:mod:`onboard.ring`); only that of one that is OFF is complete."""

    OFF = 0
    RUNS = 1
    ENDS = 2


class Rehearsal(IntEnum):
    """`Parameter.REHEARSE`: where a drone on the desk believes to be; any other number is refused."""

    OFF = 0
    POSES = 1
    """Where the host's poses say."""
    MODEL = 2
    """Where its own model of the vehicle flies (:mod:`onboard.flight_model`)."""


class EngineCode(IntEnum):
    """`Parameter.ENGINE`: which code computes on the drone."""

    REFERENCE = 0
    C = 1


class ValueType(StrEnum):
    """Type of a parameter or log variable, spelled as in the firmware's tables."""

    UINT8 = "uint8_t"
    UINT16 = "uint16_t"
    UINT32 = "uint32_t"
    FLOAT = "float"


class Parameter(StrEnum):
    """Complete names of the app's parameters."""

    POLICY_LENGTH = "perch.polLen"
    POLICY_CRC = "perch.polCrc"
    POLICY_COMMIT = "perch.polCommit"
    POLICY_STATUS = "perch.polStat"
    POLICY_ACTIVE_CRC = "perch.polActCrc"
    POLICY_ARM = "perch.polArm"
    TRAJECTORY_ARM = "perch.trjArm"
    TRAJECTORY_STATUS = "perch.trjStat"
    GO = "perch.go"
    ABORT = "perch.abort"
    CEILING_Z = "perch.zCeil"
    IMPACT_X = "perch.xImp"
    IMPACT_Y = "perch.yImp"
    SPEED_X = "perch.vx"
    SPEED_Z = "perch.vz"
    ACCELERATION_X = "perch.ax"
    ACCELERATION_Z = "perch.az"
    TAU_START = "perch.tau0"
    STATE = "perch.state"
    VEHICLE_CRC = "perch.vehCrc"
    VERSION = "perch.version"
    ENGINE = "perch.engine"
    OWN_LAW = "perch.ownLaw"
    MOTOR_TOKEN = "perch.motTok"
    REHEARSE = "perch.rehearse"


class Log(StrEnum):
    """Complete names of the app's log variables."""

    STATE = "perch.state"
    REASON = "perch.reason"
    TAU = "perch.tau"
    THETA_X = "perch.thetaX"
    D_CEIL = "perch.dCeil"
    TRIGGER_VALUE = "perch.trigVal"
    A_ROT = "perch.aRot"
    POLICY_CRC = "perch.polCrc"
    POLICY_STATUS = "perch.polStat"
    MEAN_M1 = "perch.m1"
    MEAN_M2 = "perch.m2"
    MEAN_M3 = "perch.m3"
    MEAN_M4 = "perch.m4"
    SNAPSHOT_TICK = "perchT.tick"
    SNAPSHOT_TAU = "perchT.tau"
    SNAPSHOT_THETA_X = "perchT.thetaX"
    SNAPSHOT_D_CEIL = "perchT.dCeil"
    SNAPSHOT_TRIGGER_VALUE = "perchT.trigVal"
    SNAPSHOT_A_ROT = "perchT.aRot"
    SNAPSHOT_VX = "perchT.vx"
    SNAPSHOT_VY = "perchT.vy"
    SNAPSHOT_VZ = "perchT.vz"
    SNAPSHOT_Z = "perchT.z"
    SNAPSHOT_PITCH = "perchT.pitch"
    SNAPSHOT_COUNT = "perchT.count"
    MODEL_X = "perchM.x"
    MODEL_Y = "perchM.y"
    MODEL_Z = "perchM.z"
    MODEL_VX = "perchM.vx"
    MODEL_VY = "perchM.vy"
    MODEL_VZ = "perchM.vz"


@dataclass(frozen=True)
class ParameterEntry:
    """One parameter of the app: name, type, whether the ground may only read it, value after a reboot."""

    name: Parameter
    type: ValueType
    read_only: bool = False
    default: int | float = 0


@dataclass(frozen=True)
class LogEntry:
    """One log variable of the app: name and type."""

    name: Log
    type: ValueType


PARAMETERS: tuple[ParameterEntry, ...] = (
    ParameterEntry(Parameter.POLICY_LENGTH, ValueType.UINT16),
    ParameterEntry(Parameter.POLICY_CRC, ValueType.UINT32),
    ParameterEntry(Parameter.POLICY_COMMIT, ValueType.UINT8),
    ParameterEntry(Parameter.POLICY_STATUS, ValueType.UINT8, read_only=True),
    ParameterEntry(Parameter.POLICY_ACTIVE_CRC, ValueType.UINT32, read_only=True),
    ParameterEntry(Parameter.POLICY_ARM, ValueType.UINT8),
    ParameterEntry(Parameter.TRAJECTORY_ARM, ValueType.UINT8),
    ParameterEntry(Parameter.TRAJECTORY_STATUS, ValueType.UINT8, read_only=True),
    ParameterEntry(Parameter.GO, ValueType.UINT8),
    ParameterEntry(Parameter.ABORT, ValueType.UINT8),
    ParameterEntry(Parameter.CEILING_Z, ValueType.FLOAT),
    ParameterEntry(Parameter.IMPACT_X, ValueType.FLOAT),
    ParameterEntry(Parameter.IMPACT_Y, ValueType.FLOAT),
    ParameterEntry(Parameter.SPEED_X, ValueType.FLOAT),
    ParameterEntry(Parameter.SPEED_Z, ValueType.FLOAT),
    ParameterEntry(Parameter.ACCELERATION_X, ValueType.FLOAT),
    ParameterEntry(Parameter.ACCELERATION_Z, ValueType.FLOAT),
    ParameterEntry(Parameter.TAU_START, ValueType.FLOAT),
    ParameterEntry(Parameter.STATE, ValueType.UINT8, read_only=True),
    ParameterEntry(Parameter.VEHICLE_CRC, ValueType.UINT32, read_only=True),
    ParameterEntry(Parameter.VERSION, ValueType.UINT8, read_only=True, default=INTERFACE_VERSION),
    ParameterEntry(Parameter.ENGINE, ValueType.UINT8, read_only=True),
    ParameterEntry(Parameter.OWN_LAW, ValueType.UINT8),
    ParameterEntry(Parameter.MOTOR_TOKEN, ValueType.UINT8),
    ParameterEntry(Parameter.REHEARSE, ValueType.UINT8),
)
"""Every parameter of the app, in the order of its table of contents."""

LOGS: tuple[LogEntry, ...] = (
    LogEntry(Log.STATE, ValueType.UINT8),
    LogEntry(Log.REASON, ValueType.UINT8),
    LogEntry(Log.TAU, ValueType.FLOAT),
    LogEntry(Log.THETA_X, ValueType.FLOAT),
    LogEntry(Log.D_CEIL, ValueType.FLOAT),
    LogEntry(Log.TRIGGER_VALUE, ValueType.FLOAT),
    LogEntry(Log.A_ROT, ValueType.FLOAT),
    LogEntry(Log.POLICY_CRC, ValueType.UINT32),
    LogEntry(Log.POLICY_STATUS, ValueType.UINT8),
    LogEntry(Log.MEAN_M1, ValueType.UINT16),
    LogEntry(Log.MEAN_M2, ValueType.UINT16),
    LogEntry(Log.MEAN_M3, ValueType.UINT16),
    LogEntry(Log.MEAN_M4, ValueType.UINT16),
    LogEntry(Log.SNAPSHOT_TICK, ValueType.UINT32),
    LogEntry(Log.SNAPSHOT_TAU, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_THETA_X, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_D_CEIL, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_TRIGGER_VALUE, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_A_ROT, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_VX, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_VY, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_VZ, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_Z, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_PITCH, ValueType.FLOAT),
    LogEntry(Log.SNAPSHOT_COUNT, ValueType.UINT8),
    LogEntry(Log.MODEL_X, ValueType.FLOAT),
    LogEntry(Log.MODEL_Y, ValueType.FLOAT),
    LogEntry(Log.MODEL_Z, ValueType.FLOAT),
    LogEntry(Log.MODEL_VX, ValueType.FLOAT),
    LogEntry(Log.MODEL_VY, ValueType.FLOAT),
    LogEntry(Log.MODEL_VZ, ValueType.FLOAT),
)
"""Every log variable of the app (s, 1/s, m, N m, m/s, rad, ms), in the order of its table of contents.

The control loop writes the snapshot's fields first and `Log.SNAPSHOT_COUNT` last, and the firmware samples
log blocks in between: a host that has the count in each block of the snapshot takes the blocks for one
snapshot only when their counts agree.
"""
