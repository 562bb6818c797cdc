"""Replay a policy over the cues of a recorded flight, by the onboard arithmetic."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.flights import Flight, UnusableFlightError
from calibration.flights.habas import TAU_TRUNCATION_S
from onboard.app_interface import LandingState
from onboard.arrays import FloatArray
from onboard.policy.action import action_moments
from onboard.policy.model import Policy
from onboard.policy.trigger import trigger_values

_CUES = ("tau", "theta_x", "d_ceil")
_EVALUATION_PERIOD_S = 0.010
"""The drone evaluates its policy at 100 Hz."""


@dataclass(frozen=True)
class PolicyReplay:
    """A policy run over recorded cues.

    Attributes:
        t: times of the cues (s), shape (n,); empty when the drone never approached.
        trigger_value: value of the trigger policy, shape (n,).
        a_rot: moment of the action policy (N m), shape (n,).
        fires_at: first time at which the value is >= 0 (s), or None.
        a_rot_at_firing: moment then (N m), or None.
        recorded_trigger: time at which the drone fired (s), or None.
        largest_difference: largest |replayed - recorded| trigger value before the trigger, or None without a
            recorded value.
    """

    t: FloatArray
    trigger_value: FloatArray
    a_rot: FloatArray
    fires_at: float | None
    a_rot_at_firing: float | None
    recorded_trigger: float | None
    largest_difference: float | None

    @property
    def trigger_value_max(self) -> float | None:
        """Highest value of the trigger policy; None when there was nothing to evaluate."""
        return float(self.trigger_value.max()) if self.trigger_value.size else None

    def json_shape(self) -> dict[str, Any]:
        """The replay as a JSON object (times in s, moment in N m)."""
        return {
            "samples": int(self.t.size),
            "fires_at": self.fires_at,
            "recorded_trigger": self.recorded_trigger,
            "trigger_value_max": self.trigger_value_max,
            "a_rot_at_firing": self.a_rot_at_firing,
            "largest_difference": self.largest_difference,
        }

    def in_words(self) -> str:
        """The replay for a person."""
        drone = "never fired" if self.recorded_trigger is None else f"fired at {self.recorded_trigger:.3f} s"
        highest = self.trigger_value_max
        if highest is None:
            return f"nothing to evaluate: the drone never approached; it {drone}"
        fires = "never fires" if self.fires_at is None else f"fires at {self.fires_at:.3f} s"
        return f"{fires} (highest value {highest:.3f}); the drone {drone}"


def replay_policy(flight: Flight, policy: Policy) -> PolicyReplay:
    """Run `policy` over the cues that `flight` recorded on its approach, the firing ones included.

    Where the record has the drone's state, only what it saw in its approach counts: elsewhere the drone does
    not evaluate its policy. The truncation of tau to whole ms in the authors' logs is undone (+0.5 ms).

    Raises:
        UnusableFlightError: the flight has no cues.
    """
    if not flight.has(*_CUES):
        raise UnusableFlightError(flight.source, "no cues (tau, theta_x, d_ceil) to replay a policy on")
    t, cues = _evaluated_cues(flight)
    if flight.format == "habas":
        cues[:, 0] += TAU_TRUNCATION_S
    states = np.ascontiguousarray(cues, dtype=np.float32)
    compiled = policy.compiled()
    values = trigger_values(compiled, states).astype(np.float64)
    moments = action_moments(compiled, states).astype(np.float64)
    fires = np.flatnonzero(values >= 0.0)
    return PolicyReplay(
        t=t,
        trigger_value=values,
        a_rot=moments,
        fires_at=float(t[fires[0]]) if fires.size else None,
        a_rot_at_firing=float(moments[fires[0]]) if fires.size else None,
        recorded_trigger=None if flight.trigger is None else flight.trigger.t,
        largest_difference=_difference(flight, t, values),
    )


def _evaluated_cues(flight: Flight) -> tuple[FloatArray, FloatArray]:
    """Times, shape (n,), and cues, shape (n, 3), from the beginning of the approach to the trigger.

    State and cues come in log blocks of their own: the cues that fired may arrive some 10 ms after the state
    that tells of it. So the end is told by the drone's own time where the record has it.
    """
    timed = flight.trigger is not None and flight.trigger.drone_time is not None
    timed = timed and flight.has("cues_drone_time")
    t, table = flight.series(*_CUES, *(("cues_drone_time",) if timed else ()))
    cues = np.array(table[:, :3])
    begin, end = _approach_times(flight)
    keep = t >= begin
    trigger = flight.trigger
    if trigger is None:
        keep &= t < end
    elif trigger.drone_time is None or not timed:
        keep &= t <= trigger.t
    elif all(name in trigger.snapshot for name in _CUES):
        # The snapshot holds the very cues that fired; a log block may have missed them.
        keep &= table[:, 3] < trigger.drone_time
        fired = [[trigger.snapshot[name] for name in _CUES]]
        return np.append(t[keep], trigger.t), np.concatenate((cues[keep], np.array(fired)))
    else:
        # The drone's state was seen up to one evaluation after the trigger, the cues up to one after it.
        keep &= table[:, 3] < trigger.drone_time + _EVALUATION_PERIOD_S
    return t[keep], cues[keep]


def _approach_times(flight: Flight) -> tuple[float, float]:
    """First time in approach and first time after it (s); without a recorded state, all of the flight."""
    if not flight.has("landing_state"):
        return -math.inf, math.inf
    t, table = flight.series("landing_state")
    in_approach = table[:, 0] == LandingState.APPROACH
    if not in_approach.any():
        return math.inf, math.inf
    begin = float(t[in_approach][0])
    later = t[~in_approach & (t > begin)]
    return begin, float(later[0]) if later.size else math.inf


def _difference(flight: Flight, t: FloatArray, values: FloatArray) -> float | None:
    if not flight.has("trigger_value"):
        return None
    recorded_t, recorded = flight.series("trigger_value", "tau")
    common, ours, theirs = np.intersect1d(t, recorded_t, return_indices=True)
    if common.size == 0:
        return None
    difference = float(np.max(np.abs(values[ours] - recorded[theirs, 0])))
    return difference if math.isfinite(difference) else None
