"""The approach to the ceiling: along x, then along z, then at constant velocity (paper errata 9).

From a hover at (x0, y, z0) the vehicle accelerates along x at `ax` with z held, then along z at `az` with v_x
held, and reaches (V cos phi, V sin phi) `tau0` seconds before its origin would reach the ceiling at the
impact point. World frame; x is the direction of flight.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, TypeAlias

from onboard.arrays import Vector
from onboard.errors import InputError, OnboardError
from onboard.jit import inner, kernel
from onboard.room import RoomGeometry
from onboard.unit_slip import unit_hint

Setpoint: TypeAlias = tuple[Vector, Vector, Vector]

TAU0_CHOICES = (0.5, 0.4, 0.3)
"""s. What the authors flew: 0.5 s, less for faster or steeper approaches (errata 9)."""

ACCELERATION_X_CHOICES = (1.0, 1.5, 2.0, 3.0)
"""m/s2. The authors flew 1.0, with a longer run-up than many rooms have; 3.0 is a tilt of 17 deg."""

ACCELERATION_Z_CHOICES = (3.1, 3.5)
"""m/s2. The authors' default, and the most that they flew."""

_CHOICES = tuple(itertools.product(TAU0_CHOICES, ACCELERATION_Z_CHOICES, ACCELERATION_X_CHOICES))
"""The last one is the least demanding: it has the shortest run-up."""

SPEED_MAX, CLIMB_MIN = 10.0, 0.05
"""m/s. Slower than the one, and climbing at least as fast as the other, is an approach."""

ANGLE_MIN_DEG = 0.5 * math.pi
"""deg. No approach as flat climbs to its trigger before it is under the ceiling; radians are not more."""

_USUAL_SPEED_MIN = 0.5
"""m/s. What is slower in another unit was not meant in that."""

_SPEEDS = tuple(0.05 * step for step in range(1, 200))
_ANGLES = tuple(0.5 * step for step in range(1, 181))
_HEIGHTS = tuple(0.01 * step for step in range(100, 401))
"""m/s, deg and m: what is offered instead of what does not fit."""


class ApproachError(OnboardError, InputError):
    """An approach that cannot be flown."""


class ApproachPlan(NamedTuple):
    """One approach. Times in s from its start, lengths in m, world frame.

    Attributes:
        x0, y0, z0: start, and y of the whole flight.
        t_x, t_z: durations of the acceleration along x and along z.
        vx, vz: velocity after both, m/s.
        ax, az: accelerations, m/s2.
        tau0: time at constant velocity before the ceiling.
        impact_x: x at which the origin would meet the ceiling.
        ceiling_z: height of the ceiling.
    """

    x0: float
    y0: float
    z0: float
    t_x: float
    t_z: float
    vx: float
    vz: float
    ax: float
    az: float
    tau0: float
    impact_x: float
    ceiling_z: float

    @property
    def impact_time(self) -> float:
        """Time at which the body's origin would reach the ceiling, s."""
        return self.t_x + self.t_z + self.tau0


@kernel
def plan_from_velocity(
    vx: float,
    vz: float,
    impact_x: float,
    impact_y: float,
    ceiling_z: float,
    ax: float,
    az: float,
    tau0: float,
) -> ApproachPlan:
    """The approach that reaches (vx, vz) m/s `tau0` s before the ceiling; see :func:`approach_is_sound`."""
    t_x = vx / ax
    t_z = vz / az
    z0 = ceiling_z - tau0 * vz - 0.5 * az * t_z * t_z
    x0 = impact_x - (vx * (t_x + t_z) - 0.5 * ax * t_x * t_x) - tau0 * vx
    return ApproachPlan(x0, impact_y, z0, t_x, t_z, vx, vz, ax, az, tau0, impact_x, ceiling_z)


@kernel
def approach_is_sound(plan: ApproachPlan, start_z_min: float) -> bool:
    """Whether the numbers make an approach: finite, climbing, forward or straight up, and not from below
    `start_z_min` (m). False for anything that is not a number.
    """
    return (
        0.0 <= plan.vx < 10.0
        and 0.05 <= plan.vz < 10.0
        and 0.05 <= plan.ax < 20.0
        and 0.05 <= plan.az < 20.0
        and 0.05 <= plan.tau0 < 5.0
        and math.isfinite(plan.x0)
        and math.isfinite(plan.y0)
        and start_z_min <= plan.z0 < plan.ceiling_z < 100.0
    )


def _velocity_problem(speed: float, angle_deg: float) -> str | None:
    """What is wrong with a speed (m/s) and an angle (deg) in any room, or None."""
    if not speed > 0.0:
        return f"speed {speed:g} m/s; give a speed of more than 0"
    if not speed < SPEED_MAX:
        return f"speed {speed:g} m/s is too fast; give a speed of less than {SPEED_MAX:g} m/s"
    if not (ANGLE_MIN_DEG < angle_deg <= 90.0):
        return f"angle {angle_deg:g} deg; give an angle of more than {ANGLE_MIN_DEG:.2f} and at most 90"
    if not _velocity(speed, angle_deg)[1] >= CLIMB_MIN:
        least = math.degrees(math.asin(min(1.0, CLIMB_MIN / speed)))
        climb = _velocity(speed, angle_deg)[1]
        return (
            f"{speed:g} m/s at {angle_deg:g} deg climbs at {climb:.3g} m/s, too slowly to reach the ceiling; "
            f"climb at {CLIMB_MIN:g} m/s or more"
            + (f", at {speed:g} m/s from {least + 0.01:.2f} deg on" if speed > CLIMB_MIN else "")
        )
    return None


def _meant(speed: float, angle_deg: float) -> str:
    """The units in which a refused speed or angle was probably meant, as the end of a sentence."""
    too_fast, flat = not speed < SPEED_MAX, not angle_deg > ANGLE_MIN_DEG
    return (unit_hint(speed, "m/s", lambda v: _USUAL_SPEED_MIN <= v < SPEED_MAX) if too_fast else "") + (
        unit_hint(angle_deg, "deg", lambda a: ANGLE_MIN_DEG < a <= 90.0) if flat else ""
    )


def _velocity(speed: float, angle_deg: float) -> tuple[float, float]:
    """(v_x, v_z) in m/s of a flight at `speed` and `angle_deg` above the horizon."""
    angle = math.radians(angle_deg)
    vx = 0.0 if angle_deg == 90.0 else speed * math.cos(angle)
    return vx, speed * math.sin(angle)


def plan_approach(
    speed: float,
    angle_deg: float,
    impact_x: float,
    ceiling_z: float,
    ax: float,
    az: float,
    tau0: float,
    impact_y: float = 0.0,
) -> ApproachPlan:
    """The approach at `speed` (m/s) and `angle_deg` above the horizon.

    Args:
        speed: magnitude V of the velocity at the ceiling, m/s.
        angle_deg: flight angle phi, more than `ANGLE_MIN_DEG` and up to 90 deg.
        impact_x: x (m) at which the origin would meet the ceiling.
        ceiling_z: height of the ceiling, m.
        ax: acceleration along x, m/s2.
        az: acceleration along z, m/s2.
        tau0: time at constant velocity before the ceiling, s.
        impact_y: y (m) of the flight.

    Raises:
        ApproachError: the numbers make no approach, or it would start below the floor.
    """
    problem = _velocity_problem(speed, angle_deg)
    if problem is not None:
        raise ApproachError(f"approach: {problem}{_meant(speed, angle_deg)}")
    vx, vz = _velocity(speed, angle_deg)
    if not (ax > 0.0 and az > 0.0):
        raise ApproachError(f"approach: accelerations {ax}, {az} m/s2; both must be more than 0")
    plan = plan_from_velocity(vx, vz, impact_x, impact_y, ceiling_z, ax, az, tau0)
    if not approach_is_sound(plan, 0.0):
        raise ApproachError(
            f"approach: {speed} m/s at {angle_deg} deg with az {az} m/s2 and tau0 {tau0} s would start at "
            f"z = {plan.z0:.2f} m under a ceiling at {ceiling_z} m; take a smaller tau0, a larger az or a "
            "lower speed"
        )
    return plan


def fit_approach(
    speed: float,
    angle_deg: float,
    room: RoomGeometry,
    *,
    impact_x: float = 0.0,
    impact_y: float = 0.0,
    start_z_min: float = 0.4,
    wall_margin: float = 0.25,
) -> ApproachPlan:
    """The approach that starts inside the room, with tau0 and accelerations as near to the authors' as fit.

    Tried in order: tau0 of `TAU0_CHOICES`, then az, then ax. `start_z_min` (m) is the lowest hover, and
    `wall_margin` (m) the distance of the start from the side walls.

    Raises:
        ApproachError: none of the choices fits; the message gives the run-up that the least demanding needs,
            and the nearest speed, angle and height of the ceiling that fit.
    """
    ceiling = room.ceiling_at(impact_x, impact_y)
    if not 0.0 < ceiling < 100.0:
        raise ApproachError(f"approach: the ceiling is at {ceiling} m; give a height between 0 and 100 m")

    def shortest(speed: float, angle_deg: float, ceiling: float = ceiling) -> tuple[ApproachPlan, str | None]:
        """The approach with the shortest run-up, and where it starts when that is outside."""
        vx, vz = _velocity(speed, angle_deg)
        *_, (tau0, az, ax) = _CHOICES
        plan = plan_from_velocity(vx, vz, impact_x, impact_y, ceiling, ax, az, tau0)
        under = room if ceiling == room.ceiling_at(impact_x, impact_y) else replace(room, ceiling_z=ceiling)
        return plan, start_outside(plan, under, start_z_min, wall_margin)

    def fits(speed: float, angle_deg: float, ceiling: float = ceiling) -> bool:
        return _velocity_problem(speed, angle_deg) is None and shortest(speed, angle_deg, ceiling)[1] is None

    problem = _velocity_problem(speed, angle_deg)
    if problem is not None:
        instead = _meant(speed, angle_deg) or _what_fits(speed, angle_deg, fits)
        raise ApproachError(f"approach: {problem}{instead}")
    vx, vz = _velocity(speed, angle_deg)
    for tau0, az, ax in _CHOICES:
        plan = plan_from_velocity(vx, vz, impact_x, impact_y, ceiling, ax, az, tau0)
        outside = start_outside(plan, room, start_z_min, wall_margin)
        if approach_is_sound(plan, start_z_min) and outside is None:
            return plan
    plan, outside = shortest(speed, angle_deg)
    higher = next((h for h in _HEIGHTS if h > ceiling and fits(speed, angle_deg, h)), None)
    raise ApproachError(
        f"approach: {speed} m/s at {angle_deg} deg does not fit the room: with tau0 {plan.tau0} s, ax "
        f"{plan.ax} and az {plan.az} m/s2 it would start at {outside}{_what_fits(speed, angle_deg, fits)}"
        + ("" if higher is None else f"; or under a ceiling at {higher:.2f} m")
    )


def _what_fits(speed: float, angle_deg: float, fits: Callable[[float, float], bool]) -> str:
    """The nearest speed and the nearest angle that fit, as the end of a sentence; empty when none does."""
    speeds = sorted(_SPEEDS, key=lambda v: abs(v - speed)) if 0.0 < speed < math.inf else ()
    angles = sorted(_ANGLES, key=lambda a: abs(a - angle_deg)) if 0.0 < angle_deg < math.inf else ()
    slower = next((v for v in speeds if fits(v, angle_deg)), None)
    other = next((a for a in angles if fits(speed, a)), None)
    found = [f"{slower:g} m/s at {angle_deg:g} deg"] if slower is not None else []
    found += [f"{speed:g} m/s at {other:g} deg"] if other is not None else []
    return f". What fits: {', or '.join(found)}" if found else ""


def start_outside(
    plan: ApproachPlan, room: RoomGeometry, start_z_min: float, wall_margin: float
) -> str | None:
    """Where `plan` starts and what the room allows on each axis, when it does not; else ``None``.

    Args:
        plan: the approach.
        room: where it is to be flown.
        start_z_min: lowest start, m.
        wall_margin: distance of the start from the side walls, m.
    """
    ceiling = min(plan.ceiling_z, room.ceiling_at(plan.x0, plan.y0))
    axes = {
        "x": (plan.x0, room.x_min + wall_margin, room.x_max - wall_margin),
        "y": (plan.y0, room.y_min + wall_margin, room.y_max - wall_margin),
        "z": (plan.z0, start_z_min, ceiling),
    }
    beyond = []
    for axis, (value, low, high) in axes.items():
        if not low <= high:
            beyond.append(f"nothing is left along {axis}")
        elif not value >= low:
            beyond.append(f"{axis} is less than {low:.2f} m")
        elif not value <= high:
            beyond.append(f"{axis} is more than {high:.2f} m")
    if not beyond:
        return None
    places = ", ".join(
        f"{axis} = {value:.2f} m (from {low:.2f} to {high:.2f} m)"
        for axis, (value, low, high) in axes.items()
    )
    return f"{places}, which leaves {wall_margin:g} m to each wall: {', '.join(beyond)}"


@kernel
def sample_approach(plan: ApproachPlan, t: float) -> Setpoint:
    """Position (m), velocity (m/s) and acceleration (m/s2) of the setpoint `t` s after the start.

    Before the start it is the hover; after the impact time it goes on at constant velocity (what ends the
    flight is the landing state machine).
    """
    if t <= 0.0:
        return (plan.x0, plan.y0, plan.z0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if t < plan.t_x:
        return (
            (plan.x0 + 0.5 * plan.ax * t * t, plan.y0, plan.z0),
            (plan.ax * t, 0.0, 0.0),
            (plan.ax, 0.0, 0.0),
        )
    x = plan.x0 + plan.vx * (t - 0.5 * plan.t_x)
    s = t - plan.t_x
    if s < plan.t_z:
        return (
            (x, plan.y0, plan.z0 + 0.5 * plan.az * s * s),
            (plan.vx, 0.0, plan.az * s),
            (0.0, 0.0, plan.az),
        )
    return (
        (x, plan.y0, plan.z0 + plan.vz * (s - 0.5 * plan.t_z)),
        (plan.vx, 0.0, plan.vz),
        (0.0, 0.0, 0.0),
    )


@inner
def _speed_up(
    t: float, start: float, duration: float, acceleration: float
) -> tuple[float, float, float, float]:
    """One constant acceleration from `start` on: it, velocity, displacement and its integral, at `t`."""
    s = t - start
    if s <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if s < duration:
        return acceleration, acceleration * s, 0.5 * acceleration * s * s, acceleration * s**3 / 6.0
    speed, middle = acceleration * duration, s - 0.5 * duration
    integral = acceleration * duration**3 / 6.0 + 0.5 * speed * (middle * middle - 0.25 * duration * duration)
    return 0.0, speed, speed * middle, integral


@kernel
def smooth_approach(plan: ApproachPlan, t: float, half_width: float) -> tuple[Vector, Vector, Vector, Vector]:
    """The approach with its steps of acceleration rounded off: what motors with a lag can follow.

    The moving average of :func:`sample_approach` over `half_width` (s) to both sides, which is exact on the
    line of constant velocity and in the hover. Its acceleration is a trapezoid.

    Returns:
        Position (m), velocity (m/s), acceleration (m/s2) and jerk (m/s3).
    """
    width = 2.0 * half_width
    a1, v1, d1, i1 = _speed_up(t + half_width, 0.0, plan.t_x, plan.ax)
    a0, v0, d0, i0 = _speed_up(t - half_width, 0.0, plan.t_x, plan.ax)
    c1, w1, e1, j1 = _speed_up(t + half_width, plan.t_x, plan.t_z, plan.az)
    c0, w0, e0, j0 = _speed_up(t - half_width, plan.t_x, plan.t_z, plan.az)
    return (
        (plan.x0 + (i1 - i0) / width, plan.y0, plan.z0 + (j1 - j0) / width),
        ((d1 - d0) / width, 0.0, (e1 - e0) / width),
        ((v1 - v0) / width, 0.0, (w1 - w0) / width),
        ((a1 - a0) / width, 0.0, (c1 - c0) / width),
    )
