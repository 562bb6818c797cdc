"""The state of a flight at its trigger, from what was recorded up to then.

Attitude and rate come from the poses and the gyro before the trigger (`start_state`); velocity and
distance to the ceiling from the snapshot that the drone stored at the trigger, where it did, because rows of
a radio log are up to 20 ms old. Thrusts are brought up by the motors' lag from the commands of the approach;
the commands of the flip may stand one row ahead of its flag, so only rows with all motors running count.
What these commands hold left against right, or one turning sense against the other, is no moment: the vehicle
flew straight with it, since its propellers are not all alike (:func:`straightened`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.flights import Flight, PoseSource, Trigger, UnusableFlightError
from calibration.gap.data.record import NotUsed
from calibration.gap.data.rotations import accumulated
from calibration.gap.landings.outcomes.units import check_units
from calibration.gap.landings.segments import (
    LandingSegment,
    commanded_thrusts,
    continued,
    landing_of,
    motion_of,
    running_until,
)
from calibration.gap.landings.start_state import LEAD, start_state
from onboard.arrays import BoolArray, FloatArray
from onboard.mixer import ROLL, YAW, flip_thrusts
from onboard.vehicle import Vehicle

EARLIER = 0.2
"""s between the window of poses at the trigger and the one that it is compared with."""

STRAIGHT = 0.5
"""s before the trigger: several motor lags long, and short against the time in which the speed changes."""

_BEFORE, _AFTER = 0.7, 1.2  # s of samples around the trigger that are kept
_LINE = 0.06  # s of gyro samples that a straight line goes through


@dataclass(frozen=True)
class Redundant:
    """What two sources say of the same start; their differences show how well it is known.

    Attributes:
        velocity: m/s (3,), snapshot less poses; None without a snapshot.
        attitude: rad (3,), body, at the trigger: its own poses less those EARLIER, carried on by the gyro.
        rate: rad/s (3,), last sample before the trigger less the straight line of those before it.
    """

    velocity: FloatArray | None
    attitude: FloatArray
    rate: FloatArray


@dataclass(frozen=True)
class TriggerStart:
    """A flight at its trigger.

    Attributes:
        state: states (1,), time 0.
        flip: thrusts (N, (4,)) that the motors are told until the cut.
        reckoned_ceiling: m, where the drone believed the ceiling.
        contact: s after the trigger, middle of the gyro samples around the first contact; None: unseen.
        contact_error: s, half of what lies between them.
        gyro_t, gyro: s after the trigger and rad/s, (n,) and (n, 3).
    """

    flight: Flight
    state: Any
    flip: FloatArray
    reckoned_ceiling: float
    contact: float | None
    contact_error: float
    gyro_t: FloatArray
    gyro: FloatArray
    redundant: Redundant

    @property
    def name(self) -> str:
        """Name of the flight."""
        return self.flight.name

    @property
    def tracked(self) -> bool:
        """Whether motion capture saw it; else poses and times are those of a radio log."""
        return self.flight.pose_source is not PoseSource.ONBOARD_ESTIMATE


def trigger_start(flight: Flight, vehicle: Vehicle, parameters: Any) -> TriggerStart | NotUsed:
    """The start of one flight, or why there is none."""
    if flight.trigger is None:
        return NotUsed(flight.name, _without_trigger(flight))
    if flight.trigger.inferred:
        return NotUsed(
            flight.name,
            "does not say when the policy fired (triggered): 60 deg of tilt is too late for a start",
        )
    at = flight.trigger.t
    around = _around(flight, at)
    commands = commanded_thrusts(flight, vehicle)
    moment = _flip_moment(flight, flight.trigger)
    if around is None or commands is None or moment is None or flight.ceiling_z is None:
        missing = (
            (f"pose and gyro in the last {_BEFORE} s before the trigger", around),
            ("motor commands (f1 to f4, or m1 to m4 with vbat)", commands),
            ("the flip's moment (a_rot)", moment),
            ("the distance to the ceiling (d_ceil)", flight.ceiling_z),
        )
        return NotUsed(flight.name, f"lacks {', '.join(what for what, value in missing if value is None)}")
    approach = running_until(commands, at)
    if approach is None:
        return NotUsed(flight.name, "no row before the trigger has all motors running")
    state = start_state(around, parameters, straightened(approach, at)).state.copy()
    redundant = Redundant(
        _snapshot_difference(flight.trigger.snapshot, state[0]), _wander(around), _jump(around)
    )
    _take_snapshot(flight.trigger.snapshot, flight.ceiling_z, state[0])
    try:
        check_units(flight, around, approach[1][-1], moment, state[0], parameters)
    except UnusableFlightError as error:
        return NotUsed(flight.name, error.reason)
    touched = landing_of(flight)
    # What jumps before the policy fired is no landing: a simulated flip has no time before its trigger.
    seen = None if isinstance(touched, NotUsed) or touched.before <= at else touched
    after = around.gyro_t >= at
    return TriggerStart(
        flight=flight,
        state=state,
        flip=np.array(flip_thrusts(moment, float(parameters["arm_x"]))),
        reckoned_ceiling=flight.ceiling_z,
        contact=None if seen is None else seen.contact - at,
        contact_error=0.0 if seen is None else 0.5 * (seen.after - seen.before),
        gyro_t=around.gyro_t[after] - at,
        gyro=around.gyro[after],
        redundant=redundant,
    )


def _without_trigger(flight: Flight) -> str:
    """Why a flight has no trigger; of one that ended early nobody knows whether it would have fired."""
    if not flight.finished:
        return "its record ends before the policy fired: its program was killed, or still flies"
    if flight.aborted_by is not None:
        return f"it was aborted before the policy fired: {flight.aborted_by}"
    return "the policy never fired"


def straightened(approach: tuple[FloatArray, FloatArray], at: float) -> tuple[FloatArray, FloatArray]:
    """Commands (s; N, (n, 4)) of an approach without the roll and the yaw that they held to the end.

    A vehicle that does not turn has no moment: what its controller holds about b_x and b_z makes up for
    propellers and a centre of mass that are not as filed. Taken for thrusts it would turn the flip, as soon
    as the motors are told something else. Not so about b_y, where an approach has moments of the air.

    Args:
        approach: with all motors running. at: s, of the trigger.
    """
    t, thrust = approach
    rows = (t > at - STRAIGHT) & (t <= at)
    if not rows.any():
        return approach
    held = thrust[rows].mean(axis=0)
    return t, np.maximum(thrust - sum(0.25 * (held @ part) * part for part in (ROLL, YAW)), 0.0)


def _around(flight: Flight, at: float) -> LandingSegment | None:
    """Gyro and poses around the trigger, as a landing whose contact is the trigger itself."""
    motion = motion_of(flight)
    if motion is None:
        return None
    t, rates, pose_t, pose = motion
    used = (pose_t > at - _BEFORE) & (pose_t <= at + 1e-9)
    rows = (t > at - _BEFORE) & (t < at + _AFTER)
    if np.count_nonzero(used) < 3 or np.count_nonzero(t[rows] <= at) < 4:
        return None
    tracked = flight.pose_source is not PoseSource.ONBOARD_ESTIMATE
    end = at + LEAD
    pose = continued(pose[used])
    return LandingSegment(flight, at, end, end, t[rows], rates[rows], pose_t[used], pose, tracked)


def _flip_moment(flight: Flight, trigger: Trigger) -> float | None:
    """a_rot (N m) as the drone stored it, else as it was commanded."""
    stored = trigger.snapshot.get("a_rot")
    if stored is not None:
        return stored
    if not flight.has("a_rot"):
        return None
    t, moment = flight.series("a_rot")
    rows = moment[t >= trigger.t, 0]
    return float(np.median(rows)) if rows.size else None


def _take_snapshot(snapshot: Mapping[str, float], ceiling: float, state: Any) -> None:
    """Velocity and height as the drone stored them at the trigger; `ceiling` (m) is where it believed it."""
    for axis, name in enumerate(("vx", "vy", "vz")):
        if name in snapshot:
            state["velocity"][axis] = snapshot[name]
    if "d_ceil" in snapshot:
        state["position"][2] = ceiling - snapshot["d_ceil"]


def _snapshot_difference(snapshot: Mapping[str, float], state: Any) -> FloatArray | None:
    stored = [snapshot.get(name, np.nan) for name in ("vx", "vy", "vz")]
    return None if np.isnan([stored[0], stored[2]]).any() else np.array(stored) - state["velocity"]


def _wander(around: LandingSegment) -> FloatArray:
    """Attitude (rad) by the poses at the trigger against that by poses EARLIER and the gyro since."""
    late = around.pose_t > around.trigger - 0.1
    early = (around.pose_t > around.trigger - EARLIER - 0.1) & (around.pose_t <= around.trigger - EARLIER)
    if not late.any() or not early.any():
        return np.full(3, np.nan)
    at_trigger = [_carried(around, rows).mean() for rows in (late, early)]
    return np.asarray((at_trigger[1].inv() * at_trigger[0]).as_rotvec())


def _carried(around: LandingSegment, rows: BoolArray) -> Rotation:
    """Attitudes of poses, turned by the gyro from their time to the trigger."""
    fine = np.arange(around.trigger - _BEFORE, around.trigger + 1e-3, 1e-3)
    rates = np.column_stack([np.interp(fine, around.gyro_t, around.gyro[:, i]) for i in range(3)])
    turned = Rotation.from_quat(accumulated(rates * 1e-3))
    since = turned[np.searchsorted(fine, around.pose_t[rows])].inv() * turned[-1]
    return Rotation.from_quat(around.pose[rows, :4]) * since


def _jump(around: LandingSegment) -> FloatArray:
    """Last gyro sample before the trigger less the straight line of those before it (rad/s)."""
    rows = np.flatnonzero(around.gyro_t <= around.trigger)
    last, line = rows[-1], rows[rows < rows[-1]]
    line = line[around.gyro_t[line] >= around.gyro_t[last] - _LINE]
    if line.size < 2:
        return np.full(3, np.nan)
    fit = np.polyfit(around.gyro_t[line] - around.gyro_t[last], around.gyro[line], 1)
    return np.asarray(around.gyro[last] - fit[1])
