"""Approaches and limits whose sums are exact, and what ends an approach."""

import math
from typing import Any

from onboard.landing.state_machine import EndReason, LandingLimits, LandingState
from onboard.trajectory import ApproachPlan, sample_approach
from tests.onboard.landing.rig import LIMITS, NAN, Rig

# Sums of these are exact, so that a limit itself can be shown.
EXACT_PLAN = ApproachPlan(
    x0=-1.0, y0=0.5, z0=0.5, t_x=1.0, t_z=0.5, vx=1.0, vz=1.5, ax=1.0, az=3.0, tau0=0.5,
    impact_x=0.5, ceiling_z=1.625,
)  # fmt: skip
EXACT_LIMITS = LIMITS._replace(
    start_distance=0.25,
    start_speed=0.25,
    start_z_min=0.5,
    pose_age_limit=0.125,
    speed_limit=5.0,
    hold_distance=1.0,
    useless_limit=0.5,
    lateral_limit=0.5,
    contact_distance=0.0625,
    flip_timeout=0.5,
    policy_tau_min=0.25,
)
STEP = 2.0**-10
A_BIT = 2.0**-40


def exact_rig(limits: LandingLimits = EXACT_LIMITS, plan: ApproachPlan = EXACT_PLAN) -> Rig:
    rig = Rig(plan, limits)
    rig.inputs = rig.inputs._replace(dt=STEP)
    return rig


def after(rig: Rig, elapsed: float, **changes: Any) -> tuple[LandingState, EndReason]:
    """State and reason of the step `elapsed` s into the approach."""
    rig.approach(elapsed - rig.inputs.dt)
    assert rig.state is LandingState.APPROACH
    position, velocity, _ = sample_approach(rig.plan, elapsed)
    rig.step(**{"position": position, "velocity": velocity, **changes})
    return rig.state, rig.reason


LEVEL_FLIGHT = (1.0, 0.0, 0.0)
GOES_ON = (LandingState.APPROACH, EndReason.NONE)
OFF_TRACK = (LandingState.BRAKE, EndReason.OFF_TRACK)
BAD_ESTIMATE = (LandingState.BRAKE, EndReason.BAD_ESTIMATE)
POSE_LOST = (LandingState.BRAKE, EndReason.POSE_LOST)
CONTACT = (LandingState.BRAKE, EndReason.CONTACT)
MISSED = (LandingState.BRAKE, EndReason.MISSED_TRIGGER)


AXES = [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.8, 0.0)]
UNKNOWN = (NAN, NAN, NAN, NAN)


def tip_over(tilt: float, axis: tuple[float, float, float] = AXES[0]) -> dict[str, Any]:
    """A step in which the gyro turns a level vehicle by `tilt` deg and the estimate says nothing."""
    return {
        "dt": 0.05,
        "gyro": tuple(math.radians(tilt) / 0.05 * part for part in axis),
        "quaternion": UNKNOWN,
    }
