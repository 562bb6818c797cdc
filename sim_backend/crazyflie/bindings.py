"""Which parameters and log variables of the real tables are live in the simulated firmware.

All other variables of the table exist, too: parameters keep what is written, log variables read 0. Degrees,
g and the legacy sign of pitch belong to the firmware's tables and are made here.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from onboard.battery import FULL_RATIO
from onboard.gravity import GRAVITY
from sim_backend.crazyflie.commander import compress_quaternion
from sim_backend.crazyflie.kalman import BODY_VELOCITY, P_ATTITUDE, P_POSITION, P_VELOCITY
from sim_backend.crazyflie.tables import Number

if TYPE_CHECKING:
    from sim_backend.crazyflie.firmware import Firmware

Sources = dict[str, Callable[[], Number]]
DEG = 180.0 / math.pi
_I16 = 32767
_NOISE = ("pNAcc_xy", "pNAcc_z", "mNGyro_rollpitch", "mNGyro_yaw", "pNVel", "pNPos", "pNAtt")
_DRAG = ("dragB_x", "dragB_y", "dragB_z", "cop_x", "cop_y", "cop_z")


def _i16(value: float) -> int:
    """As the firmware's compressed logs: truncated to int16; saturated where C would wrap, 0 for NaN."""
    return 0 if math.isnan(value) else int(max(-_I16, min(_I16, value)))


def parameter_setters(fw: "Firmware") -> dict[str, Callable[[Number], None]]:
    """What to do with a parameter's value, at boot and whenever a client writes it.

    The objects behind change with every reboot, so that each setter looks them up when it is called.
    """
    setters: dict[str, Callable[[Number], None]] = {}

    def bind(name: str, target: Callable[[], object], attribute: str, kind: type = float) -> None:
        setters[name] = lambda value: setattr(target(), attribute, kind(value))

    bind("stabilizer.stop", lambda: fw.supervisor, "stop_parameter", bool)
    bind("supervisor.tmblChckEn", lambda: fw.supervisor, "tumble_check_enabled", bool)
    bind("supervisor.prefltTimeout", lambda: fw.supervisor, "preflight_timeout_ms", int)
    bind("supervisor.landedTimeout", lambda: fw.supervisor, "landed_timeout_ms", int)
    bind("supervisor.spinupTimeout", lambda: fw.supervisor, "spinup_timeout_ms", int)
    bind("supervisor.crashDetectGs", lambda: fw.supervisor.tumble, "crash_detection_g")
    bind("locSrv.extPosStdDev", lambda: fw.estimator.settings, "position_deviation")
    bind("locSrv.extQuatStdDev", lambda: fw.estimator.settings, "attitude_deviation")
    bind("kalman.maxPos", lambda: fw.estimator.settings, "max_position")
    bind("kalman.maxVel", lambda: fw.estimator.settings, "max_velocity")
    bind("hlCommander.vtoff", lambda: fw.high_level, "takeoff_velocity")
    bind("hlCommander.vland", lambda: fw.high_level, "landing_velocity")
    bind("pm.lowVoltage", lambda: fw.power, "low_voltage")
    bind("powerDist.idleThrust", lambda: fw, "idle_thrust", int)

    def set_noise(index: int, value: Number) -> None:
        fw.estimator.noise[index] = value

    def set_drag(index: int, value: Number) -> None:
        fw.estimator.drag[index] = value

    def set_motor(index: int, value: Number) -> None:
        fw.motor_override[index] = int(value)

    for index, name in enumerate(_NOISE):
        setters[f"kalman.{name}"] = partial(set_noise, index)
    for index, name in enumerate(_DRAG):
        setters[f"kalman.{name}"] = partial(set_drag, index)
    for index, name in enumerate(("initialX", "initialY", "initialZ", "initialYaw")):
        setters[f"kalman.{name}"] = partial(_set_initial, fw, index)
    for index, name in enumerate(("enable", "m1", "m2", "m3", "m4")):
        setters[f"motorPowerSet.{name}"] = partial(set_motor, index)
    setters["kalman.resetEstimation"] = partial(_reset_estimation, fw)
    return setters


def _set_initial(fw: "Firmware", index: int, value: Number) -> None:
    initial = list(fw.estimator.settings.initial)
    initial[index] = float(value)
    fw.estimator.settings.initial = (initial[0], initial[1], initial[2], initial[3])


def _reset_estimation(fw: "Firmware", value: Number) -> None:
    if value:
        fw.estimator.reset()
        fw.params["kalman.resetEstimation"] = 0  # the firmware clears it, so that writing 1 again works


def log_sources(fw: "Firmware") -> Sources:
    """Where the live log variables come from."""
    return _state_sources(fw) | _sensor_sources(fw) | _system_sources(fw) | _target_sources(fw)


def _state_sources(fw: "Firmware") -> Sources:
    def estimate(index: int, factor: float = 1.0) -> float:
        return factor * float(fw.estimator.state[index])

    def milli(index: int, offset: float = 0.0) -> int:
        return _i16(1000.0 * (float(fw.estimator.state[index]) + offset))

    def euler(index: int, sign: float) -> float:
        return sign * DEG * fw.estimator.roll_pitch_yaw()[index]

    def rate(index: int, sign: float) -> int:
        return _i16(sign * 1000.0 * float(fw.sensors.gyro[index]))

    sources: Sources = {
        "stateEstimateZ.quat": partial(_packed_attitude, fw),
        "stabilizer.thrust": lambda: fw.engine.wrench[0] / (4.0 * fw.thrust_max) * FULL_RATIO,
        "estimator.rtApnd": lambda: fw.pose_rate,
        "estimator.rtRej": lambda: fw.rejected_rate,
    }
    for i, axis in enumerate("xyz"):
        sources[f"stateEstimate.{axis}"] = partial(estimate, i)
        sources[f"stateEstimate.v{axis}"] = partial(estimate, 3 + i)
        # acceleration in g with gravity taken out, as state_t has it
        sources[f"stateEstimate.a{axis}"] = partial(estimate, 10 + i, 1.0 / GRAVITY)
        sources[f"stateEstimateZ.{axis}"] = partial(milli, i)
        sources[f"stateEstimateZ.v{axis}"] = partial(milli, 3 + i)
        sources[f"stateEstimateZ.a{axis}"] = partial(milli, 10 + i, GRAVITY if axis == "z" else 0.0)
        sources[f"kalman.state{axis.upper()}"] = partial(estimate, i)
        sources[f"kalman.stateP{axis.upper()}"] = partial(estimate, BODY_VELOCITY + i)
        sources[f"kalman.var{axis.upper()}"] = partial(estimate, P_POSITION + i)
        sources[f"kalman.varP{axis.upper()}"] = partial(estimate, P_VELOCITY + i)
        sources[f"kalman.varD{i}"] = partial(estimate, P_ATTITUDE + i)
    for i, part in enumerate(("qx", "qy", "qz", "qw")):
        sources[f"stateEstimate.{part}"] = partial(estimate, 6 + i)
        sources[f"kalman.q{(i + 1) % 4}"] = partial(estimate, 6 + i)
    for i, (angle, sign) in enumerate((("roll", 1.0), ("pitch", -1.0), ("yaw", 1.0))):
        sources[f"stateEstimate.{angle}"] = partial(euler, i, sign)
        sources[f"stabilizer.{angle}"] = partial(euler, i, sign)
        sources[f"stateEstimateZ.rate{angle.capitalize()}"] = partial(rate, i, sign)
    return sources


def _packed_attitude(fw: "Firmware") -> int:
    quaternion = fw.estimator.quaternion()
    return 0 if any(math.isnan(part) for part in quaternion) else compress_quaternion(quaternion)


def _sensor_sources(fw: "Firmware") -> Sources:
    def gyro(index: int) -> float:
        return DEG * float(fw.sensors.gyro[index])

    def gyro_raw(index: int) -> int:
        return _i16(gyro(index) * 32768.0 / 2000.0)

    def acc(index: int) -> float:
        return float(fw.sensors.acc[index]) / GRAVITY

    def pose(index: int) -> float:
        return fw.last_pose[index]

    sources: Sources = {"locSrvZ.tick": lambda: (fw.last_pose_tick or 0) & 0xFFFF}
    for i, axis in enumerate("xyz"):
        sources[f"gyro.{axis}"] = partial(gyro, i)
        sources[f"gyro.{axis}Raw"] = partial(gyro_raw, i)
        sources[f"acc.{axis}"] = partial(acc, i)
    for i, part in enumerate(("x", "y", "z", "qx", "qy", "qz", "qw")):
        sources[f"locSrv.{part}"] = partial(pose, i)
    return sources


def _system_sources(fw: "Firmware") -> Sources:
    def applied(index: int) -> int:
        return int(fw.ratios[index])

    def requested(index: int) -> int:
        return int(fw.engine.ratios[index])

    sources: Sources = {
        "pm.vbat": lambda: fw.power.voltage,
        "pm.vbatMV": lambda: int(1000.0 * fw.power.voltage),
        "pm.batteryLevel": lambda: fw.power.level,
        "pm.state": lambda: int(fw.power.state),
        "supervisor.info": fw.supervisor_info,
        "supervisor.accNorm": lambda: fw.supervisor.tumble.acc_norm_g,
        "sys.canfly": lambda: int(fw.supervisor.can_fly),
        "sys.isFlying": lambda: int(fw.supervisor.is_flying),
        "sys.isTumbled": lambda: int(fw.supervisor.is_tumbled),
        "radio.isConnected": lambda: 1,
        "radio.rssi": lambda: 40,
    }
    for i in range(4):
        sources[f"motor.m{i + 1}"] = partial(applied, i)
        sources[f"motor.m{i + 1}req"] = partial(requested, i)
    return sources


def _target_sources(fw: "Firmware") -> Sources:
    def part(field: str, index: int) -> float:
        return float(getattr(fw.setpoint, field)[index])

    def milli(field: str, index: int) -> int:
        return _i16(1000.0 * part(field, index))

    def mode(name: str) -> int:
        return int(getattr(fw.setpoint, name))

    sources: Sources = {
        "ctrltarget.roll": lambda: DEG * fw.setpoint.roll,
        "ctrltarget.pitch": lambda: -DEG * fw.setpoint.pitch,
        "ctrltarget.yaw": lambda: DEG * fw.setpoint.yaw,
        "ctrltarget.thrust": lambda: fw.setpoint.thrust,
    }
    for prefix, field in (("", "position"), ("v", "velocity"), ("a", "acceleration")):
        for i, axis in enumerate("xyz"):
            sources[f"ctrltarget.{prefix}{axis}"] = partial(part, field, i)
            sources[f"ctrltargetZ.{prefix}{axis}"] = partial(milli, field, i)
    for name in ("x", "y", "z", "roll", "pitch", "yaw", "quat"):
        sources[f"ctrltarget.mode_{name}"] = partial(mode, f"mode_{name}")
    return sources
