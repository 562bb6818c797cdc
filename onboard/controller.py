"""Geometric tracking controller on SE(3) (Lee, Leok, McClamroch, Asian J. Control 15(2), 2013).

    F = -kp e_x - kd e_v - ki int(e_x) + m g e_3 + m a_d          collective = F . b3
    M = -kr e_R - kw e_Omega + Omega x J Omega
    commanded moments = (lead_zero s + 1) / (lead_pole s + 1) M

with the desired body axis b3 along F and the heading from the setpoint's yaw. The desired body rate is zero,
as in the authors' firmware (SIM@4c815026:crazyflie_control/src/controller_gtc.c). The lead undoes part of the
motors' lag, which would otherwise leave the attitude loop no margin
(:mod:`onboard.attitude_margins`). Compiled, no state: the position integral and the lead's memory
are the caller's and go through :func:`integrate_position_error` and :func:`lead_moments`.
"""

import math
from typing import NamedTuple, TypeAlias

from onboard.arrays import Vector
from onboard.gravity import GRAVITY
from onboard.jit import inner, kernel, outlined
from onboard.rotation import Indexable, body_x, body_y, body_z
from onboard.vehicle.model import Vehicle

Wrench: TypeAlias = tuple[float, float, float, float]


class ControllerGains(NamedTuple):
    """Gains of the controller with the mass and inertia that it assumes.

    Attributes:
        kp_xy, kp_z: N/m. kd_xy, kd_z: N s/m. ki_xy, ki_z: N/(m s).
        integral_limit: m s, bound of each part of the position integral.
        kr_xy, kr_z: N m (per rad of e_R). kw_xy, kw_z: N m s/rad.
        lead_zero, lead_pole: s, time constants of the lead; equal ones: no lead.
        tilt_tangent: tangent of the largest angle between b3 desired and vertical.
        collective_min, collective_max: N, bounds of the commanded collective.
        mass: kg. inertia_xx, inertia_yy, inertia_zz: kg m2.
    """

    kp_xy: float
    kd_xy: float
    ki_xy: float
    kp_z: float
    kd_z: float
    ki_z: float
    integral_limit: float
    kr_xy: float
    kw_xy: float
    kr_z: float
    kw_z: float
    lead_zero: float
    lead_pole: float
    tilt_tangent: float
    collective_min: float
    collective_max: float
    mass: float
    inertia_xx: float
    inertia_yy: float
    inertia_zz: float


DEFAULT_GAINS = ControllerGains(
    kp_xy=0.4,
    kd_xy=0.32,
    ki_xy=0.07,
    kp_z=1.1,
    kd_z=0.9,
    ki_z=0.1,
    integral_limit=0.3,
    kr_xy=0.0055,
    kw_xy=0.0009,
    kr_z=0.001,
    kw_z=0.0004,
    lead_zero=0.09,
    lead_pole=0.0125,
    tilt_tangent=math.tan(math.radians(50.0)),
    collective_min=0.0,
    collective_max=0.9 * 4.0 * 0.147,
    mass=0.0381,
    inertia_xx=27.93e-6,
    inertia_yy=30.46e-6,
    inertia_zz=47.12e-6,
)
"""Gains for the 38.1 g vehicle of the paper.

Integral gains are the authors'. The other position gains were chosen by us in simulation, over motor lags of
0.05/0.05, 0.05/0.15 and 0.08/0.20 s (up/down), 7 % missing thrust and 10 ms of pose delay, for a step of
0.47 m and an approach of 2.5 m/s at 40 deg. Attitude gains and the lead were chosen by the margins: at least
35 deg and 15 ms over motor lags of 50 to 150 ms, also with inertias 10 % off
(:mod:`onboard.attitude_margins`); by approaches that end, at the trigger, as those of a law without
lead did, for which the shipped policy lands; and by the gyro's noise, which the lead makes
(lead_zero + 2 ms) / (lead_pole + 2 ms) = 6.3 times as large: yaw, whose moments cost the most thrust, is the
softest.
"""

AUTHORS_GAINS = DEFAULT_GAINS._replace(
    kp_xy=0.4, kd_xy=0.35, kp_z=1.2, kd_z=0.35,
    kr_xy=0.004, kw_xy=0.0017, kr_z=0.003, kw_z=0.001, lead_zero=0.0, lead_pole=0.0,
)  # fmt: skip
"""The gains of the authors (SIM@4c815026:crazyflie_launch/config/Model_Types.yaml, CtrlGains): no lead."""


def controller_gains(vehicle: Vehicle) -> ControllerGains:
    """The default gains for a vehicle: position gains scaled with its mass, attitude gains with its inertia.

    The closed loop is then the same as that of the paper's vehicle. The collective is limited to 90 % of
    what four motors give, so that attitude keeps some thrust (errata 1).
    """
    body = vehicle.body
    base = DEFAULT_GAINS
    mass = body.mass.value / base.mass
    lateral = 0.5 * (body.inertia_xx.value / base.inertia_xx + body.inertia_yy.value / base.inertia_yy)
    yaw = body.inertia_zz.value / base.inertia_zz
    return base._replace(
        kp_xy=base.kp_xy * mass,
        kd_xy=base.kd_xy * mass,
        ki_xy=base.ki_xy * mass,
        kp_z=base.kp_z * mass,
        kd_z=base.kd_z * mass,
        ki_z=base.ki_z * mass,
        kr_xy=base.kr_xy * lateral,
        kw_xy=base.kw_xy * lateral,
        kr_z=base.kr_z * yaw,
        kw_z=base.kw_z * yaw,
        collective_max=0.9 * 4.0 * vehicle.motors.thrust_max.value,
        mass=body.mass.value,
        inertia_xx=body.inertia_xx.value,
        inertia_yy=body.inertia_yy.value,
        inertia_zz=body.inertia_zz.value,
    )


@inner
def _desired_force(
    position: Indexable,
    velocity: Indexable,
    integral: Indexable,
    target_position: Indexable,
    target_velocity: Indexable,
    target_acceleration: Indexable,
    gains: ControllerGains,
) -> Vector:
    """Force (N, world) that the position loop wants, with its tilt limited."""
    mass = gains.mass
    fx = (
        -gains.kp_xy * (position[0] - target_position[0])
        - gains.kd_xy * (velocity[0] - target_velocity[0])
        - gains.ki_xy * integral[0]
        + mass * target_acceleration[0]
    )
    fy = (
        -gains.kp_xy * (position[1] - target_position[1])
        - gains.kd_xy * (velocity[1] - target_velocity[1])
        - gains.ki_xy * integral[1]
        + mass * target_acceleration[1]
    )
    fz = (
        -gains.kp_z * (position[2] - target_position[2])
        - gains.kd_z * (velocity[2] - target_velocity[2])
        - gains.ki_z * integral[2]
        + mass * (target_acceleration[2] + GRAVITY)
    )
    # A force that points down or is tiny has no attitude of its own: attitude comes from at least a fifth of
    # the weight, the collective from the projection of the force on the real b3.
    most = gains.tilt_tangent * max(fz, 0.2 * mass * GRAVITY)
    lateral_squared = fx * fx + fy * fy
    if lateral_squared > most * most:
        scale = most / math.sqrt(lateral_squared)
        fx *= scale
        fy *= scale
    return (fx, fy, fz)


@inner
def _attitude_error(quaternion: Indexable, force: Vector, yaw: float, least_z: float) -> Vector:
    """e_R = 1/2 vee(R_d^T R - R^T R_d), with R_d from the force and the heading; body frame."""
    fx, fy, fz = force[0], force[1], max(force[2], least_z)
    inverse = 1.0 / math.sqrt(fx * fx + fy * fy + fz * fz)
    d3x, d3y, d3z = fx * inverse, fy * inverse, fz * inverse
    cos_yaw, sin_yaw = 1.0, 0.0
    if yaw != 0.0:
        cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
    # b2_d = b3_d x b1_c / |..|, b1_d = b2_d x b3_d
    d2x, d2y, d2z = -d3z * sin_yaw, d3z * cos_yaw, d3x * sin_yaw - d3y * cos_yaw
    inverse = 1.0 / math.sqrt(d2x * d2x + d2y * d2y + d2z * d2z)
    d2x, d2y, d2z = d2x * inverse, d2y * inverse, d2z * inverse
    d1x = d2y * d3z - d2z * d3y
    d1y = d2z * d3x - d2x * d3z
    d1z = d2x * d3y - d2y * d3x
    b1, b2, b3 = body_x(quaternion), body_y(quaternion), body_z(quaternion)
    return (
        0.5 * ((d3x * b2[0] + d3y * b2[1] + d3z * b2[2]) - (d2x * b3[0] + d2y * b3[1] + d2z * b3[2])),
        0.5 * ((d1x * b3[0] + d1y * b3[1] + d1z * b3[2]) - (d3x * b1[0] + d3y * b1[1] + d3z * b1[2])),
        0.5 * ((d2x * b1[0] + d2y * b1[1] + d2z * b1[2]) - (d1x * b2[0] + d1y * b2[1] + d1z * b2[2])),
    )


@inner
def _moments(error: Vector, omega: Indexable, gains: ControllerGains) -> Vector:
    """-kr e_R - kw Omega + Omega x J Omega, N m in the body frame."""
    wx, wy, wz = omega[0], omega[1], omega[2]
    jx, jy, jz = gains.inertia_xx, gains.inertia_yy, gains.inertia_zz
    return (
        -gains.kr_xy * error[0] - gains.kw_xy * wx + (jz - jy) * wy * wz,
        -gains.kr_xy * error[1] - gains.kw_xy * wy + (jx - jz) * wz * wx,
        -gains.kr_z * error[2] - gains.kw_z * wz + (jy - jx) * wx * wy,
    )


@kernel
def geometric_control(
    position: Indexable,
    velocity: Indexable,
    quaternion: Indexable,
    omega: Indexable,
    integral: Indexable,
    target_position: Indexable,
    target_velocity: Indexable,
    target_acceleration: Indexable,
    target_yaw: float,
    gains: ControllerGains,
) -> Wrench:
    """Collective (N) and body moments (N m) that track a setpoint.

    Args:
        position, velocity: m, m/s, world frame.
        quaternion: attitude, body to world.
        omega: rad/s, body frame.
        integral: m s, position integral; zeros to go without.
        target_position, target_velocity, target_acceleration: m, m/s, m/s2, world frame.
        target_yaw: rad.
        gains: the gains.

    Returns:
        (collective, tau_x, tau_y, tau_z).
    """
    force = _desired_force(
        position, velocity, integral, target_position, target_velocity, target_acceleration, gains
    )
    error = _attitude_error(quaternion, force, target_yaw, 0.2 * gains.mass * GRAVITY)
    tau_x, tau_y, tau_z = _moments(error, omega, gains)
    b3 = body_z(quaternion)
    collective = force[0] * b3[0] + force[1] * b3[1] + force[2] * b3[2]
    collective = min(max(collective, gains.collective_min), gains.collective_max)
    return (collective, tau_x, tau_y, tau_z)


@outlined
def attitude_control(
    quaternion: Indexable, omega: Indexable, collective: float, target_yaw: float, gains: ControllerGains
) -> Wrench:
    """(`collective`, tau_x, tau_y, tau_z) that hold the body level at a heading, whatever its position."""
    error = _attitude_error(quaternion, (0.0, 0.0, 1.0), target_yaw, 1.0)
    tau_x, tau_y, tau_z = _moments(error, omega, gains)
    return (collective, tau_x, tau_y, tau_z)


@inner
def _lead(moment: float, lagged: float, gains: ControllerGains, dt: float) -> tuple[float, float]:
    """One axis of :func:`lead_moments`: the moment with its lead, and the memory after it."""
    difference = moment - lagged
    if not math.isfinite(difference):
        return moment, lagged
    per_time = 1.0 / (gains.lead_pole + dt)
    return (
        moment + (gains.lead_zero - gains.lead_pole) * per_time * difference,
        lagged + dt * per_time * difference,
    )


@kernel
def lead_moments(
    wrench: Wrench, lagged: Indexable, gains: ControllerGains, dt: float
) -> tuple[Wrench, Vector]:
    """The wrench whose moments lead by (lead_zero s + 1) / (lead_pole s + 1), by the backward Euler rule.

    Args:
        wrench: (collective, tau_x, tau_y, tau_z), N and N m.
        lagged: memory, N m: the moments so far through the lag of `lead_pole`; zeros while the motors stand.
        gains: the gains.
        dt: s since the last call.

    Returns:
        The wrench for the mixer, and the memory for the next call. A moment that is not a number passes, and
        leaves its memory.
    """
    tau_x, lagged_x = _lead(wrench[1], lagged[0], gains, dt)
    tau_y, lagged_y = _lead(wrench[2], lagged[1], gains, dt)
    tau_z, lagged_z = _lead(wrench[3], lagged[2], gains, dt)
    return (wrench[0], tau_x, tau_y, tau_z), (lagged_x, lagged_y, lagged_z)


@kernel
def integrate_position_error(
    integral: Indexable, position: Indexable, target_position: Indexable, dt: float, limit: float
) -> Vector:
    """The position integral (m s) after `dt` s, each part within +-`limit`; an error of NaN leaves it."""
    x, y, z = integral[0], integral[1], integral[2]
    ex = (position[0] - target_position[0]) * dt
    ey = (position[1] - target_position[1]) * dt
    ez = (position[2] - target_position[2]) * dt
    if not (math.isfinite(ex) and math.isfinite(ey) and math.isfinite(ez)):
        return (x, y, z)
    return (
        min(max(x + ex, -limit), limit),
        min(max(y + ey, -limit), limit),
        min(max(z + ez, -limit), limit),
    )
