"""The corridor of the approach: position, velocity and attitude stay about the plan up to the trigger."""

from math import acos, degrees, dist, hypot
from typing import NamedTuple

from onboard.arrays import Vector
from onboard.gravity import GRAVITY
from onboard.jit import interpreted
from onboard.rotation import body_z
from onboard.trajectory import ApproachPlan, sample_approach
from perchhw.supervisor.limits import SafetyLimits
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.violation import Violation, at_most

_STEPS = 8
"""Planned states that the window of times is searched at; at 3 m/s they are 0.15 m apart."""

_planned, _thrust_axis = interpreted(sample_approach), interpreted(body_z)
"""The drone's own reference, interpreted: a first call in flight must not compile."""


class Deviation(NamedTuple):
    """How far from the plan: m, m/s, deg."""

    distance: float
    speed: float
    tilt: float


def deviation(
    plan: ApproachPlan, elapsed: float, window: float, position: Vector, velocity: Vector, thrust_axis: Vector
) -> Deviation:
    """The least deviation of each kind from the plan `elapsed` s after its start, give or take `window` s.

    The three need not be least at the same time: an attitude leads its velocity, and that its position.
    """
    distance = speed = tilt = float("inf")
    for step in range(-_STEPS // 2, _STEPS // 2 + 1):
        place, motion, acceleration = _planned(plan, elapsed + 2.0 * window * step / _STEPS)
        thrust = (acceleration[0], acceleration[1], acceleration[2] + GRAVITY)
        along = sum(a * b for a, b in zip(thrust, thrust_axis, strict=True)) / hypot(*thrust)
        distance = min(distance, dist(place, position))
        speed = min(speed, dist(motion, velocity))
        tilt = min(tilt, degrees(acos(max(-1.0, min(1.0, along)))))
    return Deviation(distance, speed, tilt)


def inside_corridor(
    o: Admitted, plan: ApproachPlan, elapsed: float, limits: SafetyLimits
) -> Violation | None:
    """The drone follows the planned approach, of which `elapsed` s have passed."""
    if o.estimate_position is None or o.estimate_velocity is None or o.estimate_quaternion is None:
        return Violation("corridor", "unknown", "known")
    axis = _thrust_axis(o.estimate_quaternion)
    off = deviation(plan, elapsed, limits.corridor_time, o.estimate_position, o.estimate_velocity, axis)
    return (
        at_most("corridor_distance", off.distance, limits.corridor_distance, "m")
        or at_most("corridor_speed", off.speed, limits.corridor_speed, "m/s")
        or at_most("corridor_tilt", off.tilt, degrees(limits.corridor_tilt), "deg")
    )
