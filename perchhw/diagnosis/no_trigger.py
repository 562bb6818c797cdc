"""A flight whose policy never fired: how its cues passed the region, and why."""

import numpy as np

from calibration.flights import Flight
from onboard.arrays import FloatArray
from onboard.policy.model import Policy
from perchhw.diagnosis.finding import Cause, Diagnosis, Number
from perchhw.diagnosis.flip import CUES, approach_cues, values_of
from perchhw.diagnosis.landing import Judge

SLOW = 0.85
"""Share of the commanded speed that counts as reached."""
_TAUS = 200
_STEPS = np.linspace(0.05, 4.0, 80)
_REMEDY_REGION = (
    "fly a speed and angle inside the policy's region (perchhw learn validate), or train for this one"
)
_REMEDY_ELSEWHERE = (
    "fly default, or look how this policy was learned and for which speeds (perchhw learn validate)"
)


def diagnose_no_trigger(flight: Flight, judge: Judge) -> Diagnosis:
    """The finding of a flight that ended without a trigger, and by no other rule."""
    t, cues = approach_cues(flight) if flight.has(*CUES) else (np.empty(0), np.empty((0, 3)))
    coming = cues[:, 0] > 0.0
    t, cues = t[coming], cues[coming]
    if not t.size:
        return Diagnosis(
            Cause.NO_CUES,
            "the policy never fired: the record has no cues of an approach",
            "look at the poses (perchhw mocap watch URI) and at the landing app (perchhw doctor)",
        )
    reached, wanted = _speed(flight, t), flight.commanded_speed
    if reached is not None and wanted is not None and reached < SLOW * wanted:
        return Diagnosis(
            Cause.TOO_SLOW,
            f"the policy never fired: the approach reached {reached:.2f} of {wanted:g} m/s",
            "charge the pack and look at the path: what holds the drone back? then fly it again",
            {"speed_m_s": reached, "wanted_m_s": wanted},
        )
    missed = _region_missed(cues, judge.flown)
    return missed if judge.region is None else _held_against(judge.region, cues, missed)


def _held_against(region: Policy, cues: FloatArray, missed: Diagnosis) -> Diagnosis:
    """What was missed; where the policy that ships for the vehicle would have fired, by the flown one."""
    inside = np.flatnonzero(values_of(region, cues) >= 0.0)
    if not inside.size:
        return missed
    tau = float(cues[inside[0], 0])
    return Diagnosis(
        Cause.REGION_ELSEWHERE,
        f"{missed.sentence}; that of the policy that ships for this vehicle was entered at tau {tau:.3f} s",
        _REMEDY_ELSEWHERE,
        {**missed.values, "shipped_tau_s": tau},
    )


def _region_missed(cues: FloatArray, policy: Policy | None) -> Diagnosis:
    what = "the policy never fired: the cues never entered its region"
    if policy is None:
        return Diagnosis(Cause.REGION_MISSED, what, _REMEDY_REGION)
    values = values_of(policy, cues)
    best = int(np.argmax(values))
    tau, flow, distance = (float(cue) for cue in cues[best])
    numbers: dict[str, Number] = {
        "trigger_value": float(values[best]),
        "tau_s": tau,
        "theta_x_1_s": flow,
        "d_ceil_m": distance,
    }
    nearest = _nearest_edge(policy, cues[best])
    if nearest is None:
        where = f"nearest at tau {tau:.3f} s, theta_x {flow:.2f} 1/s, {distance:.2f} m below the ceiling"
        return Diagnosis(Cause.REGION_MISSED, f"{what}; {where}", _REMEDY_REGION, numbers)
    k, edge = nearest
    name, unit, value = (("theta_x", "1/s", flow), ("the distance", "m", distance))[k]
    side = "below" if value < edge else "above"
    words = (
        f"{what}; at tau {tau:.3f} s {name} was {value:.2f} {unit}, {side} the region, "
        f"which begins at {edge:.2f}"
    )
    return Diagnosis(
        Cause.REGION_MISSED,
        words,
        _REMEDY_REGION,
        {**numbers, "missed_cue": CUES[k + 1], "missed_by": edge - value},
    )


def _nearest_edge(policy: Policy, cues: FloatArray) -> tuple[int, float] | None:
    """Which of theta_x (0) and d_ceil (1) must change least, in widths of the region, and up to what.

    Tau passes through all its values on an approach, so it is left free.
    """
    edges = [(*edge, k) for k in (0, 1) if (edge := _edge(policy, cues, k)) is not None]
    if not edges:
        return None
    _, value, k = min(edges)
    return k, value


def _edge(policy: Policy, cues: FloatArray, k: int) -> tuple[float, float] | None:
    """How far (widths of the region) cue `k` + 1 must go until some tau is inside, and its value there."""
    states = np.column_stack(
        [np.linspace(policy.tau_min, policy.tau_max, _TAUS), *np.tile(cues[1:], (_TAUS, 1)).T]
    )
    for step in _STEPS:
        for sign in (-1.0, 1.0):
            states[:, k + 1] = cues[k + 1] + sign * step * float(policy.scaler_std[k + 1])
            if states[0, k + 1] > 0.0 and (values_of(policy, states) >= 0.0).any():
                return float(step), float(states[0, k + 1])
    return None


def _speed(flight: Flight, t: FloatArray) -> float | None:
    """Highest speed (m/s) of the approach, as the drone estimates it."""
    if not flight.has("vx", "vz"):
        return None
    when, velocity = flight.series("vx", "vz")
    during = (when >= t[0]) & (when <= t[-1])
    return float(np.max(np.hypot(velocity[during, 0], velocity[during, 1]))) if during.any() else None
