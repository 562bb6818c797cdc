"""The flip of a record, measured: when it began against the policy's region, how strong it was, and how the
body was turned when it first met the ceiling.

The turn is the angle about the body's left axis from upright, nose up positive: 180 deg is upside down.
Between 90 and 270 deg the feet reach higher than the rims of the propellers.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.flights import Flight, Trigger
from onboard.app_interface import LandingState
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.policy.action import action_moments
from onboard.policy.model import Policy
from onboard.policy.trigger import trigger_values
from onboard.rotation import to_matrices
from onboard.vehicle import Vehicle
from perchhw.label import LandingGeometry, landing_geometry

CUES = ("tau", "theta_x", "d_ceil")
_STEP_S = 1e-3
_AHEAD_S = 0.25
"""How far a state that fired too early is followed at constant velocity."""
_FLIP_S = (0.08, 0.7)
"""After the trigger: nothing is turned over sooner, nothing is still on its way up later."""
_BLOW_RAD_S = 2.0
"""Drop of the nose-up rate from one row to the next (10 ms) that only a blow causes."""
_BLOW_M_S = 0.45
"""Drop of the climb from one row to the next that only a ceiling causes: motors that push down while upside
down give 2 g, 0.2 m/s in 10 ms."""
_OLD_S = 0.035
"""For so long poses may show an older state; a blow slows for longer."""
_NEAR_CEILING_M = 0.35
_FOUND = 1.15
"""What the flips of the simulated lab deliver by this arithmetic (1.10 to 1.21); 1.0 where no delay of radio
and cameras is between the trigger and the poses."""
_QUARTER_TURN = math.pi / 2.0


class PoseTrack(NamedTuple):
    """Poses: times of capture (s), heights (m), turns (rad, unwrapped), attitudes (n, 3, 3)."""

    t: FloatArray
    height: FloatArray
    turn: FloatArray
    rotations: FloatArray


class Touchdown(NamedTuple):
    """The first blow of the ceiling.

    Attributes:
        after_s: after the trigger.
        turn_deg: turn of the body then.
        feet_margin_m: how much higher the feet reached than hull and propellers; negative: less high.
        ceiling_error_m: how much higher the ceiling was met than the record says it is.
    """

    after_s: float
    turn_deg: float
    feet_margin_m: float
    ceiling_error_m: float | None


@dataclass(frozen=True)
class Flip:
    """A flip as the record shows it; None where it does not.

    Attributes:
        tau_s: time to contact at the trigger, as the drone saw it.
        region_tau_s: time to contact where the region of the judging policy begins on this approach.
        late_s: by how much the flip began after the region did; negative: before.
        commanded: moment that was commanded as a share of what the judging policy asks for there.
        delivered: moment that turned the body as a share of the commanded one.
        estimate_late_s: how far the drone's estimate was behind mocap on its climb at the trigger.
        climb_m_s: vertical speed at the trigger.
        touch: the first blow of the ceiling.
        gap_m: least distance of feet, hull and propellers to where the record has the ceiling; negative:
            beyond.
    """

    tau_s: float | None
    region_tau_s: float | None
    late_s: float | None
    commanded: float | None
    delivered: float | None
    estimate_late_s: float | None
    climb_m_s: float | None
    touch: Touchdown | None
    gap_m: float | None


def measure_flip(flight: Flight, trigger: Trigger, vehicle: Vehicle, policy: Policy | None) -> Flip:
    """Measure the flip of a triggered flight.

    Args:
        flight: with poses and rates, as its record holds them.
        trigger: its trigger.
        vehicle: with legs.
        policy: whose region and moment the flip is held against; None: it is not.

    Raises:
        LabelError: the vehicle has no legs.
    """
    seen, geometry = trigger.snapshot, landing_geometry(vehicle)
    begins = None if policy is None else region_begins(flight, trigger, policy)
    asked = None if policy is None or begins is None else _moment(policy, begins[1])
    motion = _motion(flight)
    touch = None if motion is None else _touchdown(flight, trigger.t, motion, geometry)
    free_s = math.inf if touch is None else touch.after_s
    return Flip(
        tau_s=seen.get("tau"),
        region_tau_s=None if begins is None else float(begins[1][0]),
        late_s=None if begins is None else trigger.t - begins[0],
        commanded=seen["a_rot"] / asked if asked and "a_rot" in seen else None,
        delivered=None if motion is None else _delivered(motion, trigger, vehicle, free_s),
        estimate_late_s=None if motion is None else _estimate_late(motion, trigger),
        climb_m_s=seen.get("vz"),
        touch=touch,
        gap_m=None if motion is None else _least_gap(flight, trigger.t, motion, geometry),
    )


def region_begins(flight: Flight, trigger: Trigger, policy: Policy) -> tuple[float, FloatArray] | None:
    """When (s) and at which cues (3,) the region of `policy` begins on this approach; None: nowhere.

    Up to the trigger the cues are those that the drone saw, after it those of constant velocity.
    """
    if not flight.has(*CUES) or not all(name in trigger.snapshot for name in CUES):
        return None
    t, cues = approach_cues(flight)
    before = (t < trigger.t) & (t > trigger.t - 1.0)
    fired = np.array([trigger.snapshot[name] for name in CUES])
    ahead = np.arange(0.0, min(_AHEAD_S, 0.9 * float(fired[0])), _STEP_S)
    distance = fired[2] * (1.0 - ahead / fired[0])
    coming = np.column_stack([fired[0] - ahead, fired[1] * fired[2] / distance, distance])
    times = np.concatenate([t[before], trigger.t + ahead])
    states = np.concatenate([cues[before], coming])
    inside = np.flatnonzero(values_of(policy, states) >= 0.0)
    return (float(times[inside[0]]), states[inside[0]]) if inside.size else None


def approach_cues(flight: Flight) -> tuple[FloatArray, FloatArray]:
    """Times (n,) and cues (n, 3) from the beginning of the approach on, where they are finite."""
    t, cues = flight.series(*CUES)
    keep = np.isfinite(cues).all(axis=1)
    if flight.has("landing_state"):
        state_t, state = flight.series("landing_state")
        begun = state_t[state[:, 0] == LandingState.APPROACH]
        keep &= t >= (begun[0] if begun.size else math.inf)
    return t[keep], cues[keep]


def values_of(policy: Policy, states: FloatArray) -> FloatArray:
    """Trigger values (n,) of cues (n, 3)."""
    return np.asarray(trigger_values(policy.compiled(), _single(states)), dtype=np.float64)


def _moment(policy: Policy, cues: FloatArray) -> float:
    return float(action_moments(policy.compiled(), _single(cues[None, :]))[0])


def _single(states: FloatArray) -> NDArray[np.float32]:
    return np.ascontiguousarray(states, dtype=np.float32)


def _motion(flight: Flight) -> PoseTrack | None:
    if not flight.has("z", "qw"):
        return None
    names = ("z", "qx", "qy", "qz", "qw")
    t, pose = flight.series(*names, *(("capture_time",) if flight.has("capture_time") else ()))
    captured = pose[:, 5] if pose.shape[1] > 5 else t
    if captured.size < 3:
        return None
    rotations = to_matrices(pose[:, 1:5].copy())
    turn = np.unwrap(np.arctan2(rotations[:, 2, 0], rotations[:, 2, 2]))
    return PoseTrack(captured, pose[:, 0], turn, rotations)


def _delivered(motion: PoseTrack, trigger: Trigger, vehicle: Vehicle, free_s: float) -> float | None:
    """Moment that turned the body as a share of the commanded one, from how long a quarter turn took.

    None where the ceiling was met before it, `free_s` after the trigger.

    The front motors go from hover to nothing and the rear ones from hover to what the moment asks for, each
    with its lag (:func:`onboard.mixer.flip_thrusts`).
    """
    t, turn, moment = motion.t, motion.turn, -trigger.snapshot.get("a_rot", 0.0)
    over = np.flatnonzero((t > trigger.t) & (turn >= _QUARTER_TURN))
    if moment <= 0.0 or not over.size or over[0] == 0:
        return None
    k = int(over[0])
    share = (_QUARTER_TURN - turn[k - 1]) / (turn[k] - turn[k - 1])
    took = float(t[k - 1] + share * (t[k] - t[k - 1]) - trigger.t)
    if took > free_s:
        return None
    expected = _expected_turn(took, moment, vehicle)
    begin = float(np.interp(trigger.t, t, turn))
    return (_QUARTER_TURN - begin) / (expected * _FOUND) if expected > 0.0 else None


def _expected_turn(t: float, moment: float, vehicle: Vehicle) -> float:
    """Turn (rad) that the commanded `moment` (N m) gives in `t` s from a hover, without any air."""
    motors, arm = vehicle.motors, vehicle.body.arm_x.value
    hover, rear = vehicle.body.mass.value * GRAVITY / 4.0, moment / (2.0 * arm)
    down = motors.time_constant_down.value
    lag = motors.time_constant_up.value if rear > hover else down
    impulse = rear * t * t / 2.0 + (hover - rear) * _fading(t, lag) - hover * _fading(t, down)
    return 2.0 * arm * impulse / vehicle.body.inertia_yy.value


def _fading(t: float, lag: float) -> float:
    """Double integral (s2) over `t` s of what is 1 at first and fades with the time constant `lag` (s)."""
    return lag * t - lag * lag * (1.0 - math.exp(-t / lag))


def _estimate_late(motion: PoseTrack, trigger: Trigger) -> float | None:
    """Height that the estimate lacked at the trigger, as time (s) on the climb."""
    z, climb = trigger.snapshot.get("z"), trigger.snapshot.get("vz")
    if z is None or climb is None or climb <= 0.0:
        return None
    return (float(np.interp(trigger.t, motion.t, motion.height)) - z) / climb


def _touchdown(
    flight: Flight, trigger_t: float, motion: PoseTrack, geometry: LandingGeometry
) -> Touchdown | None:
    blow = _first_blow(flight, trigger_t, motion)
    if blow is None:
        return None
    attitude = motion.rotations[int(np.argmin(np.abs(motion.t - blow)))]
    reach = max(float(geometry.feet_top(attitude[None])[0]), float(geometry.body_top(attitude[None])[0]))
    height = float(np.interp(blow, motion.t, motion.height))
    return Touchdown(
        after_s=blow - trigger_t,
        turn_deg=math.degrees(float(np.interp(blow, motion.t, motion.turn))),
        feet_margin_m=geometry.touch_margin(attitude),
        ceiling_error_m=None if flight.ceiling_z is None else height + reach - flight.ceiling_z,
    )


def _first_blow(flight: Flight, trigger_t: float, motion: PoseTrack) -> float | None:
    """Time (s) of the last row before the first blow of a ceiling, by the gyro or by the path, or None."""
    first, last = (trigger_t + bound for bound in _FLIP_S)
    blows: list[float] = []
    if flight.has("gy"):
        t, rate = flight.series("gy")
        rows = np.flatnonzero((np.diff(rate[:, 0]) > _BLOW_RAD_S) & (t[:-1] > first) & (t[:-1] < last))
        blows += [float(t[row]) for row in rows]
    t = motion.t
    rows = np.flatnonzero((t > first) & (t < last))
    blows += [float(t[row - 1]) for row in rows if _slows(motion, int(row))]
    ceiling = math.inf if flight.ceiling_z is None else flight.ceiling_z
    near = [blow for blow in blows if ceiling - np.interp(blow, t, motion.height) < _NEAR_CEILING_M]
    return min(near, default=None)


def _slows(motion: PoseTrack, row: int) -> bool:
    """Whether the climb to this row was faster than from it on, by a blow, over whichever of the rows beside
    it: one that shows an older state is below the path before and after it. What falls meets no ceiling.
    """
    apart = motion.t - motion.t[row]
    near = np.abs(apart) < _OLD_S
    before, after = near & (apart < -1e-4), near & (apart > 1e-4)
    if not (before.any() and after.any()):
        return False
    climbed = motion.height - motion.height[row]
    climb = np.min(climbed[before] / apart[before])
    return bool(climb > 0.0 and climb - np.max(climbed[after] / apart[after]) > _BLOW_M_S)


def _least_gap(
    flight: Flight, trigger_t: float, motion: PoseTrack, geometry: LandingGeometry
) -> float | None:
    flip = (motion.t > trigger_t) & (motion.t < trigger_t + _FLIP_S[1])
    if flight.ceiling_z is None or not flip.any():
        return None
    rotations = motion.rotations[flip]
    reach = np.maximum(geometry.feet_top(rotations), geometry.body_top(rotations))
    return float(np.min(flight.ceiling_z - motion.height[flip] - reach))
