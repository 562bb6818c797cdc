"""Getting away from the ceiling: how far a climbing vehicle still rises, and where it goes then.

The thrust falls with the first-order lag tau of the motors, the body stays level: from v_0 and an upward
acceleration a_0 (thrust above weight, per mass),

    v(t) = v_0 + (g + a_0) tau (1 - e^(-t/tau)) - g t
    z(t) = v_0 t + (g + a_0) tau (t - tau (1 - e^(-t/tau))) - g t^2 / 2
"""

import math
from typing import Any

from onboard.gravity import GRAVITY
from onboard.jit import kernel
from onboard.landing.model import LandingLimits
from onboard.trajectory import ApproachPlan, Setpoint


@kernel
def stopping_distance(speed: float, acceleration: float, motor_lag: float) -> float:
    """Rise (m) until standstill after the motors are told to stop.

    Args:
        speed: v_0, climb speed, m/s; nothing rises for 0 and less.
        acceleration: a_0, upward acceleration at that moment, m/s2, at least -g.
        motor_lag: tau, time constant of falling thrust, s.
    """
    if not speed > 0.0:
        return 0.0
    push = (GRAVITY + acceleration) * motor_lag
    # v(t) is concave, so Newton's method from a time after the standstill comes down to it without passing.
    t = (speed + push) / GRAVITY
    for _ in range(20):
        decay = math.exp(-t / motor_lag)
        v = speed + push * (1.0 - decay) - GRAVITY * t
        slope = push / motor_lag * decay - GRAVITY
        if slope >= 0.0:
            break
        step = v / slope
        t -= step
        if abs(step) < 1e-9:
            break
    decay = math.exp(-t / motor_lag)
    return speed * t + push * (t - motor_lag * (1.0 - decay)) - 0.5 * GRAVITY * t * t


@kernel
def hold_setpoint(memory: Any, time: float, plan: ApproachPlan, limits: LandingLimits) -> Setpoint:
    """Stop sideways with the hold's acceleration, sink to `hold_clearance` below the ceiling, stay there."""
    t = max(0.0, time - memory.hold_time)
    p, v = memory.hold_position, memory.hold_velocity
    a = limits.hold_acceleration
    speed = math.hypot(v[0], v[1])
    s = min(t, speed / a)
    slowed = 1.0 - a * s / speed if speed > 1e-6 else 0.0
    travel = s * (1.0 + slowed) / 2.0
    pull = -a / speed if t < speed / a and speed > 1e-6 else 0.0
    x, vx, ax = p[0] + v[0] * travel, v[0] * slowed, v[0] * pull
    y, vy, ay = p[1] + v[1] * travel, v[1] * slowed, v[1] * pull

    lowest = plan.ceiling_z - limits.hold_clearance
    if p[2] > lowest:
        z = max(lowest, p[2] - limits.descent_speed * t)
        vz = -limits.descent_speed if z > lowest else 0.0
        return (x, y, z), (vx, vy, vz), (ax, ay, 0.0)
    s = min(t, abs(v[2]) / a)
    sign = 1.0 if v[2] >= 0.0 else -1.0
    z = p[2] + v[2] * s - 0.5 * sign * a * s * s
    vz = v[2] - sign * a * s
    az = -sign * a if t < abs(v[2]) / a else 0.0
    return (x, y, z), (vx, vy, vz), (ax, ay, az)
