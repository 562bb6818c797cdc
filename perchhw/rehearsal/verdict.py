"""The verdict on a rehearsal: the reference, given the drone's own inputs, must do what the drone did."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from onboard.app_interface import EndReason, LandingState
from onboard.arrays import FloatArray
from onboard.cues import optical_flow_cues
from onboard.landing.state_machine import LandingInputs, landing_limits, landing_step, new_landing_memory
from onboard.mixer import Thrusts
from onboard.policy.action import action_moment
from onboard.policy.model import CompiledPolicy, Policy
from onboard.policy.trigger import trigger_value
from onboard.ring import Ring, Table
from onboard.trajectory import ApproachPlan
from onboard.vehicle import Vehicle
from perchhw.rehearsal.poses import ideal_state

TRIGGER_VALUE_BOUND = 1e-6
A_ROT_BOUND = 1e-8
"""N m."""
FORCE_BOUND = 1e-6
"""N, of one motor."""

_CLIMBING = 0.05
"""m above the start from which a height tells where on its approach a drone is."""


@dataclass(frozen=True)
class ReferenceReplay:
    """What the reference makes of the drone's inputs.

    Attributes:
        trigger_values: (n,) of each period.
        a_rots: (n,) N m.
        trigger: the period in which it triggers; None: it does not.
        thrusts: of its flip, N, M1 to M4; None without one.
    """

    trigger_values: FloatArray
    a_rots: FloatArray
    trigger: int | None
    thrusts: Thrusts | None


def replay(ring: Ring, plan: ApproachPlan, policy: Policy, vehicle: Vehicle) -> ReferenceReplay:
    """The reference on what the drone's policy had in each period of an approach.

    The landing machine starts in the approach, with the drone's own attitude in each step: the ring begins
    after the approach has, and holds one step of five.
    """
    limits = landing_limits(vehicle, float(policy.tau_min))
    memory = new_landing_memory()
    memory.state, memory.arm_seen, memory.attitude_known = LandingState.APPROACH, 1, 1
    memory.start_time = int(ring.ticks[0]) / 1000.0
    values, moments = np.empty(len(ring.ticks)), np.empty(len(ring.ticks))
    trigger, thrusts = None, None
    for i, inputs in enumerate(_inputs(ring, plan, policy.compiled())):
        values[i], moments[i] = inputs.trigger_value, inputs.a_rot
        if memory.state == LandingState.APPROACH:
            memory.attitude[:] = ring.periods[i]["law"][0]["own_attitude"]
            output = landing_step(memory, inputs, plan, limits)
            if memory.state == LandingState.FLIP:
                trigger, thrusts = i, output.thrusts
    return ReferenceReplay(values, moments, trigger, thrusts)


def _inputs(ring: Ring, plan: ApproachPlan, policy: CompiledPolicy) -> Iterator[LandingInputs]:
    for tick, period in zip(ring.ticks, ring.periods, strict=True):
        estimate = period["law"][0]["estimate"]
        position, velocity = _numbers(estimate["position"]), _numbers(estimate["velocity"])
        cues = optical_flow_cues(position[2], velocity[0], velocity[2], plan.ceiling_z)
        tau, theta_x, d_ceil = (float(cue) for cue in cues)
        yield LandingInputs(
            time=int(tick) / 1000.0,
            dt=0.0,  # the own attitude is given, not propagated
            position=position,
            velocity=velocity,
            quaternion=_numbers(estimate["quaternion"]),
            gyro=_numbers(estimate["gyro"]),
            pose_age=0.0,
            tau=tau,
            theta_x=theta_x,
            d_ceil=d_ceil,
            evaluated=True,
            trigger_value=float(trigger_value(policy, tau, theta_x, d_ceil)),
            a_rot=float(action_moment(policy, tau, theta_x, d_ceil)),
            policy_armed=True,
            trajectory_armed=True,
            go=False,
            abort=False,
            flying=True,
        )


def _numbers(values: Any) -> Any:
    return tuple(values.tolist())


@dataclass(frozen=True)
class RehearsalVerdict:
    """Whether drone and reference did the same, and where not.

    Attributes:
        failures: what was not as it must be, a sentence each; none: passed.
        reason: why the drone's approach ended.
        trigger_sample_difference: samples (10 ms) by which the reference triggers later than the drone; None
            where one of them does not.
        trigger_value_difference, a_rot_difference_n_m: largest of all samples.
        force_difference_n: largest of a motor in the flip; None where one of them has none.
        input_difference: the drone's inputs against the ideal approach at the same heights. Largest of the
            climb up to the trigger: ``position_m`` (along x and y), ``velocity_m_s``; at the trigger:
            ``tau_s``, ``theta_x_1_s``. None where the ring has no climb.
    """

    failures: tuple[str, ...]
    reason: EndReason
    trigger_sample_difference: int | None
    trigger_value_difference: float
    a_rot_difference_n_m: float
    force_difference_n: float | None
    input_difference: dict[str, float] | None

    @property
    def passed(self) -> bool:
        """Whether drone and reference did the same."""
        return not self.failures


def judge(
    ring: Ring, reason: EndReason, plan: ApproachPlan, policy: Policy, vehicle: Vehicle
) -> RehearsalVerdict:
    """The verdict on one rehearsal.

    Args:
        ring: what the drone recorded.
        reason: why its approach ended, as it says.
        plan: the approach.
        policy: what the drone shall have computed with.
        vehicle: what its firmware was built for.
    """
    reference = replay(ring, plan, policy, vehicle)
    at = _trigger_of(ring, reason)
    samples = force = None
    if at is not None and reference.trigger is not None:
        samples = reference.trigger - at
    if at is not None and reference.thrusts is not None:
        force = float(np.abs(ring.periods["law"]["thrusts"][at] - np.asarray(reference.thrusts)).max())
    value = _largest(ring.periods["trigger_value"], reference.trigger_values)
    a_rot = _largest(ring.periods["a_rot"], reference.a_rots)
    return RehearsalVerdict(
        tuple(_failures(reason, at, reference, samples, value, a_rot, force)),
        reason,
        samples,
        value,
        a_rot,
        force,
        _input_difference(ring.periods[: len(ring.ticks) if at is None else at + 1], plan, vehicle),
    )


def _trigger_of(ring: Ring, reason: EndReason) -> int | None:
    """The period in which the drone triggered."""
    found = np.flatnonzero(ring.ticks == ring.end_tick)
    return int(found[0]) if reason is EndReason.TRIGGERED and len(found) else None


def _largest(a: Any, b: FloatArray) -> float:
    """Largest difference; infinite where only one is a number."""
    if not np.array_equal(np.isfinite(a), np.isfinite(b)):
        return float("inf")
    return float(np.abs(a - b)[np.isfinite(b)].max(initial=0.0))


def _failures(
    reason: EndReason,
    at: int | None,
    reference: ReferenceReplay,
    samples: int | None,
    value: float,
    a_rot: float,
    force: float | None,
) -> Iterator[str]:
    if reason is not EndReason.TRIGGERED:
        yield f"the drone did not trigger: its approach ended with {reason.name.lower()}"
    elif at is None:
        yield "the drone's ring does not hold its trigger"
    if reference.trigger is None:
        yield "the reference does not trigger on the drone's inputs"
    if samples:
        yield f"the reference triggers {samples:+d} samples after the drone"
    bounded = (
        ("the trigger's value", value, TRIGGER_VALUE_BOUND, ""),
        ("the flip's moment", a_rot, A_ROT_BOUND, " N m"),
        ("a motor's force", force, FORCE_BOUND, " N"),
    )
    for what, difference, bound, unit in bounded:
        if difference is not None and not difference <= bound:
            yield f"{what} differs by {difference:.2g}{unit}, more than {bound:g}{unit}"


def _input_difference(periods: Table, plan: ApproachPlan, vehicle: Vehicle) -> dict[str, float] | None:
    """The drone's inputs against those of an exact flight, where that is at the same height."""
    smoothing = landing_limits(vehicle).smoothing
    times = np.arange(0.0, plan.impact_time + 2.0 * smoothing, 1e-3)
    ideal = np.array([np.concatenate(ideal_state(plan, smoothing, t)) for t in times])
    estimate = periods["law"]["estimate"][:, 0]
    climbs = estimate["position"][:, 2] > plan.z0 + _CLIMBING
    if not climbs.any():
        return None
    found = np.hstack([estimate["position"], estimate["velocity"]]).astype(np.float64)[climbs]
    begun = ideal[:, 2] > plan.z0 + 0.5 * _CLIMBING
    wanted = np.column_stack([np.interp(found[:, 2], ideal[begun, 2], ideal[begun, i]) for i in range(6)])
    position = np.linalg.norm((found - wanted)[:, :2], axis=1)
    velocity = np.linalg.norm((found - wanted)[:, 3:], axis=1)
    mine, its = (optical_flow_cues(s[2], s[3], s[5], plan.ceiling_z) for s in (found[-1], wanted[-1]))
    return {
        "position_m": float(position.max()),
        "velocity_m_s": float(velocity.max()),
        "tau_s": float(mine[0] - its[0]),
        "theta_x_1_s": float(mine[1] - its[1]),
    }
