"""One landing attempt from the placement under the ceiling to rest, as learning needs it by the thousand.

The attempt follows the authors' (paper errata 9 and 11): placed level at h - 0.5 V_z with exact velocity (or
as real approaches do, :mod:`launch`), the controller holds the velocity, the policy is armed 0.05 s later and
looks at the cues at 100 Hz; on the trigger the two front motors flip, and all motors stop when the body axis
falls below the horizon. Thrust commands are taken as delivered up to the motors' limit: the battery
compensation is perfect here, as in the authors' simulation.
"""

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from onboard.arrays import Vector
from onboard.controller import ControllerGains, geometric_control, lead_moments
from onboard.cues import optical_flow_cues
from onboard.mixer import Thrusts, flip_thrusts, mix
from onboard.rotation import body_z
from sim_backend.physics.decision import decide
from sim_backend.physics.effects.sensors import measured_rate, tracked_attitude, tracked_position
from sim_backend.physics.jit import alone, inner, kernel
from sim_backend.physics.launch import (
    EXACT,
    Launch,
    ceiling_error,
    flip_gains,
    launch_velocity,
    scattered_flip,
)
from sim_backend.physics.motors import decay
from sim_backend.physics.step import advance, is_finite


class End(IntEnum):
    """Why a rollout ended (paper errata 11)."""

    SETTLED = 0
    """0.5 s after the first contact with the ceiling"""
    FLIP_TIMEOUT = 1
    """2.25 s after the trigger without contact"""
    TIMEOUT = 2
    """5 s in all"""
    FALLING = 3
    NOT_FINITE = 4
    """a number in the state is not a number: a fault of the simulation, reported with its seed"""


class RolloutSettings(NamedTuple):
    """Rules of a rollout; the defaults are the authors' (paper errata 9 and 11).

    Attributes:
        dt: s, step of the physics.
        control_steps: steps between two runs of the controller (500 Hz).
        policy_steps: steps between two looks at the cues (100 Hz).
        start_time_to_ceiling: s, the vehicle starts this far below the ceiling at its commanded climb.
        arm_delay: s after the start.
        after_contact, after_trigger, at_most: s, ends of the rollout.
        fall_speed: m/s, fall_height: m: falling when v_z <= -fall_speed below fall_height.
        cue_delay_min, cue_delay_max: s, age of the cues, uniform, drawn once a rollout.
        velocity_bias: m/s, standard deviation of an error of v_x and v_z that lasts a rollout.
        velocity_noise: m/s, standard deviation of the error of each look.
        height_noise: m, likewise for the height.
        start_thrust: of the motors at the start, as a share of the weight; start_thrust_spread: its standard
            deviation.
        unseen: s, the controller takes the vehicle for standing still until a moment after the start that is
            uniform up to this.
        launch: how the approach and the flip differ from what they are told.
    """

    dt: float = 1e-3
    control_steps: int = 2
    policy_steps: int = 10
    start_time_to_ceiling: float = 0.5
    arm_delay: float = 0.05
    after_contact: float = 0.5
    after_trigger: float = 2.25
    at_most: float = 5.0
    fall_speed: float = 0.5
    fall_height: float = 1.5
    cue_delay_min: float = 0.0
    cue_delay_max: float = 0.0
    velocity_bias: float = 0.0
    velocity_noise: float = 0.0
    height_noise: float = 0.0
    start_thrust: float = 1.0
    start_thrust_spread: float = 0.0
    unseen: float = 0.0
    launch: Launch = EXACT


ROLLOUT = np.dtype(
    [
        ("speed", "f8"),  # m/s, commanded
        ("angle", "f8"),  # rad above the horizon, commanded
        ("triggered", "i8"),
        ("trigger_time", "f8"),  # s
        ("tau", "f8"),  # s, cue at the trigger as the policy saw it
        ("theta_x", "f8"),  # rad/s
        ("d_ceil", "f8"),  # m
        ("a_rot", "f8"),  # N m
        ("velocity_x", "f8"),  # m/s at the trigger, true
        ("velocity_z", "f8"),
        ("d_min", "f8"),  # m, least distance of the body origin to the ceiling
        ("contact", "i8"),  # anything touched the ceiling
        ("impact_time", "f8"),  # s
        ("impact_tilt", "f8"),  # rad between body axis and vertical at the first contact, 0..pi
        ("feet", "i8"),  # on the ceiling at the end
        ("body_contact", "i8"),
        ("end", "i8"),  # End
        ("duration", "f8"),  # s
    ],
    align=True,
)

_DELAY_STEPS = 128
"""Longest age of the cues in steps."""


@kernel
def place(state: Any, p: Any, velocity: Vector, time_to_ceiling: float, thrust: float) -> None:
    """Put a fresh state on the approach: level, velocity in m/s (world), thrust as share of the weight."""
    state.position[2] = p.ceiling_z - time_to_ceiling * velocity[2]
    state.velocity[0], state.velocity[1], state.velocity[2] = velocity
    for motor in range(4):
        state.thrust[motor] = 0.25 * thrust * p.mass * p.gravity


@kernel
def hold_velocity(
    state: Any, p: Any, seen: Vector, velocity: Vector, gains: ControllerGains, lagged: Vector, dt: float
) -> tuple[Thrusts, Vector]:
    """Motor thrusts (N) of the controller that sees one velocity and holds another, without a position loop.

    `lagged` is the memory of :func:`onboard.controller.lead_moments`, returned as it is after `dt` (s).
    """
    zero = (0.0, 0.0, 0.0)
    wanted = geometric_control(
        zero, seen, tracked_attitude(state, p), measured_rate(state, p), zero,
        zero, velocity, zero, 0.0, gains,
    )  # fmt: skip
    wrench, lagged = lead_moments(wanted, lagged, gains, dt)
    thrusts = mix(
        wrench[0], wrench[1], wrench[2], wrench[3], p.arm_x, p.arm_y, p.thrust_to_torque, p.thrust_max
    )
    return thrusts, lagged


@kernel
def limited(targets: Thrusts, most: float) -> Thrusts:
    """Thrusts no higher than a motor can give (N)."""
    return min(targets[0], most), min(targets[1], most), min(targets[2], most), min(targets[3], most)


@inner
def end_of(state: Any, out: Any, s: RolloutSettings) -> int:
    """The :class:`End` that holds now, -1 while the rollout goes on."""
    t = state.time
    if not is_finite(state):
        return 4
    if state.ceiling_contact and t - state.impact_time > s.after_contact:
        return 0
    if out.triggered and t - out.trigger_time > s.after_trigger:
        return 1
    if t > s.at_most:
        return 2
    if state.velocity[2] <= -s.fall_speed and state.position[2] <= s.fall_height:
        return 3
    return -1


@inner
def record_trigger(out: Any, state: Any, tau: float, theta_x: float, d_ceil: float, a_rot: float) -> None:
    """Keep what the policy saw and the true velocity."""
    out.triggered = 1
    out.trigger_time = state.time
    out.tau, out.theta_x, out.d_ceil, out.a_rot = tau, theta_x, d_ceil, a_rot
    out.velocity_x, out.velocity_z = state.velocity[0], state.velocity[2]


@kernel
def record_end(out: Any, state: Any, end: int) -> None:
    """Keep how the rollout ended."""
    feet = 0
    for leg in range(4):
        feet += state.foot_attached[leg]
    out.feet = feet
    out.body_contact = state.body_contact
    out.contact = state.ceiling_contact
    out.end = end
    out.duration = state.time
    out.impact_time = state.impact_time
    if state.ceiling_contact:
        out.impact_tilt = math.acos(min(max(body_z(state.impact_quaternion)[2], -1.0), 1.0))


@inner
def draw_pads(rng: Any, state: Any, p: Any) -> None:
    """How the pads of this landing differ; a vehicle whose pads have limits without spread draws nothing."""
    if p.capture_spread + p.preload_spread + p.pad_impulse_spread + p.pad_angle_spread > 0.0:
        state.pad_deviate[:] = rng.standard_normal()


@inner
def start_thrust(rng: Any, s: RolloutSettings) -> float:
    """Thrust of the motors at the start, as a share of the weight; without a spread nothing is drawn."""
    if s.start_thrust_spread <= 0.0:
        return s.start_thrust
    return max(0.0, s.start_thrust + s.start_thrust_spread * rng.standard_normal())


@inner
def first_seen(rng: Any, s: RolloutSettings) -> float:
    """When (s) the controller first sees that the vehicle moves; at once, nothing is drawn."""
    return s.unseen * rng.random() if s.unseen > 0.0 else 0.0


@alone
def rollout(
    rng: Any, state: Any, p: Any, gains: ControllerGains, policy: Any, speed: float, angle: float,
    s: RolloutSettings, out: Any,
) -> None:  # fmt: skip
    """Fly one attempt.

    Args:
        rng: numpy Generator, for the pads, the phase of the policy's clock and the errors of the cues.
        state: fresh record (:func:`sim_backend.physics.state.new_state`); holds the last state afterwards.
        p: physics parameters of this rollout.
        gains: of the controller, for the nominal vehicle.
        policy: :class:`sim_backend.physics.decision.ThresholdPolicy` or a compiled two-stage policy.
        speed: m/s. angle: rad above the horizon.
        s: rules.
        out: record of :data:`ROLLOUT`, zeroed; receives the result.
    """
    out.speed, out.angle = speed, angle
    held = launch_velocity(rng, speed, angle, s.launch)
    place(state, p, held, s.start_time_to_ceiling, start_thrust(rng, s))
    unseen = first_seen(rng, s)
    draw_pads(rng, state, p)
    too_low = ceiling_error(rng, s.launch)
    flip = flip_gains(rng, p, s.launch)
    up, down = decay(p, 0.5 * s.dt)
    phase = rng.integers(0, s.policy_steps)
    age = rng.uniform(s.cue_delay_min, s.cue_delay_max) + p.pose_delay
    delay = min(int(age / s.dt + 0.5), _DELAY_STEPS - 1)
    bias_x, bias_z = s.velocity_bias * rng.standard_normal(), s.velocity_bias * rng.standard_normal()
    seen = np.empty((_DELAY_STEPS, 3))
    out.d_min = math.inf
    cut = False
    targets = (0.0, 0.0, 0.0, 0.0)
    lagged = (0.0, 0.0, 0.0)
    count = 0
    end = -1
    while end < 0:
        if out.triggered == 0:
            now = count % _DELAY_STEPS
            seen[now, 0], seen[now, 1] = tracked_position(state, p)[2], state.velocity[0]
            seen[now, 2] = state.velocity[2]
            if state.time >= s.arm_delay and (count + phase) % s.policy_steps == 0:
                then = (count - min(delay, count)) % _DELAY_STEPS
                z = seen[then, 0] + too_low + s.height_noise * rng.standard_normal()
                seen_x = seen[then, 1] + bias_x + s.velocity_noise * rng.standard_normal()
                seen_z = seen[then, 2] + bias_z + s.velocity_noise * rng.standard_normal()
                tau, theta_x, d_ceil = optical_flow_cues(z, seen_x, seen_z, p.ceiling_z)
                fires, a_rot = decide(policy, float(tau), float(theta_x), float(d_ceil))
                if fires:
                    record_trigger(out, state, float(tau), float(theta_x), float(d_ceil), a_rot)
        if count % s.control_steps == 0:
            if out.triggered == 0:
                velocity = (state.velocity[0], state.velocity[1], state.velocity[2])
                if state.time < unseen:
                    velocity = (0.0, 0.0, 0.0)
                targets, lagged = hold_velocity(
                    state, p, velocity, held, gains, lagged, s.control_steps * s.dt
                )
            else:
                cut = cut or body_z(state.quaternion)[2] <= 0.0
                targets = (0.0, 0.0, 0.0, 0.0)
                if not cut:
                    told = flip_thrusts(out.a_rot, p.arm_x)
                    targets = limited(scattered_flip(told, flip), p.thrust_max)
        advance(state, p, targets, s.dt, up, down)
        out.d_min = min(out.d_min, p.ceiling_z - state.position[2])
        count += 1
        end = end_of(state, out, s)
    record_end(out, state, end)
