"""Replay a policy over the cues of a recorded flight, by the onboard arithmetic."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.flights import Flight, UnusableFlightError
from calibration.flights.habas import TAU_TRUNCATION_S
from onboard.action import action_moments
from onboard.arrays import FloatArray
from onboard.policy_model import Policy
from onboard.trigger import trigger_values


@dataclass(frozen=True)
class PolicyReplay:
    """A policy run over recorded cues.

    Attributes:
        t: times of the cues (s), shape (n,).
        trigger_value: value of the trigger policy, shape (n,).
        a_rot: moment of the action policy (N m), shape (n,).
        fires_at: first time at which the value is >= 0 (s), or None.
        recorded_trigger: time at which the drone fired (s), or None.
        largest_difference: largest |replayed - recorded| trigger value before the trigger, or None without a
            recorded value.
    """

    t: FloatArray
    trigger_value: FloatArray
    a_rot: FloatArray
    fires_at: float | None
    recorded_trigger: float | None
    largest_difference: float | None

    def to_json(self) -> dict[str, Any]:
        """The replay as a JSON object (times in s, moment in N m)."""
        fired = None if self.fires_at is None else int(np.searchsorted(self.t, self.fires_at))
        return {
            "samples": int(self.t.size),
            "fires_at": self.fires_at,
            "recorded_trigger": self.recorded_trigger,
            "trigger_value_max": float(self.trigger_value.max()),
            "a_rot_at_firing": None if fired is None else float(self.a_rot[fired]),
            "largest_difference": self.largest_difference,
        }

    def in_words(self) -> str:
        """The replay for a person."""
        fires = "never fires" if self.fires_at is None else f"fires at {self.fires_at:.3f} s"
        drone = "never fired" if self.recorded_trigger is None else f"fired at {self.recorded_trigger:.3f} s"
        return f"{fires} (highest value {self.trigger_value.max():.3f}); the drone {drone}"


def replay_policy(flight: Flight, policy: Policy) -> PolicyReplay:
    """Run `policy` over the cues that `flight` recorded before and at its trigger.

    The truncation of tau to whole ms in the authors' logs is undone (+0.5 ms).

    Raises:
        UnusableFlightError: the flight has no cues.
    """
    names = ("tau", "theta_x", "d_ceil")
    if not flight.has(*names):
        raise UnusableFlightError(flight.source, "no cues (tau, theta_x, d_ceil) to replay a policy on")
    t, cues = flight.series(*names)
    if flight.trigger is not None:
        before = t <= flight.trigger.t
        t, cues = t[before], cues[before]
    if flight.format == "habas":
        cues[:, 0] += TAU_TRUNCATION_S
    states = np.ascontiguousarray(cues, dtype=np.float32)
    compiled = policy.compiled()
    values = trigger_values(compiled, states).astype(np.float64)
    fires = np.flatnonzero(values >= 0.0)
    return PolicyReplay(
        t=t,
        trigger_value=values,
        a_rot=action_moments(compiled, states).astype(np.float64),
        fires_at=float(t[fires[0]]) if fires.size else None,
        recorded_trigger=None if flight.trigger is None else flight.trigger.t,
        largest_difference=_difference(flight, t, values),
    )


def _difference(flight: Flight, t: FloatArray, values: FloatArray) -> float | None:
    if not flight.has("trigger_value"):
        return None
    recorded_t, recorded = flight.series("trigger_value", "tau")
    common, ours, theirs = np.intersect1d(t, recorded_t, return_indices=True)
    if common.size == 0:
        return None
    difference = float(np.max(np.abs(values[ours] - recorded[theirs, 0])))
    return difference if math.isfinite(difference) else None
