"""A flight whose policy fired: how it touched, what holds, and why it was not four legs."""

from typing import Any, NamedTuple

import numpy as np

from calibration.flights import Flight, Trigger
from onboard.arrays import FloatArray
from onboard.policy.action import action_moments
from onboard.policy.model import Policy
from onboard.policy.trigger import trigger_values
from onboard.rotation import to_matrices
from onboard.vehicle import Vehicle
from perchhw.attempt import Outcome
from perchhw.diagnosis.finding import Cause, Diagnosis, Number
from perchhw.diagnosis.flip import CUES, Flip, measure_flip
from perchhw.label import landing_geometry
from perchhw.label.pose import REST_WINDOW_S

LATE_S = 0.015
"""The drone asks its policy every 10 ms; a flip that began by more before or after the region is off."""
WEAK, STRONG = 0.8, 1.25
"""Share of the wanted moment; flips of the simulated lab deliver 0.95 to 1.06 of what is commanded."""
WEAK_MOTORS = 0.85
ESTIMATE_LATE_S = 0.025
"""Motion capture and estimate are 10 ms behind in a sound room."""
CEILING_ERROR_M = 0.04
"""A blow is timed to a row (10 ms); in a room whose height is right it was seen up to 0.026 m off."""
BEYOND_CEILING_M = 0.018
"""Feet that reached farther did not find the ceiling where it should be; hinges give way by 0.013 m."""
VALUE_TOLERANCE, MOMENT_TOLERANCE_N_M = 1e-3, 1e-5
"""Of the snapshot against the policy: it is in full precision, and the arithmetic is the same."""
_PAIRS = {(0, 1): "fore", (2, 3): "hind", (0, 3): "left", (1, 2): "right"}
_OTHER = {"fore": "hind", "hind": "fore", "left": "right", "right": "left"}


class _Why(NamedTuple):
    """A reason in words, and what to do."""

    cause: Cause
    words: str
    next: str


class Judge(NamedTuple):
    """Policies to hold a flip against.

    Attributes:
        flown: the policy that the record names, if it is at hand.
        region: whose region and moment count: that which ships for the vehicle, or the flown one.
    """

    flown: Policy | None
    region: Policy | None


def diagnose_landing(
    flight: Flight, trigger: Trigger, outcome: Outcome, vehicle: Vehicle, judge: Judge
) -> Diagnosis:
    """The finding of a triggered flight that no rule ended.

    Raises:
        LabelError: the vehicle has no legs.
    """
    flip = measure_flip(flight, trigger, vehicle, judge.region)
    pair = (
        holding_pair(flight, vehicle) if outcome in (Outcome.TWO_LEG, Outcome.TWO_LEG_BODY_CONTACT) else None
    )
    what, plain = _what_happened(outcome, flip, pair)
    why = _computed_otherwise(trigger, judge.flown) or (
        None if outcome is Outcome.FOUR_LEG else _deviation(flip)
    )
    found = why or _Why(plain, _when(flip), _next_after(plain, pair))
    sentence = what if not found.words else f"{what}; {found.words}"
    return Diagnosis(found.cause, sentence, found.next, _values(flip, pair))


def _what_happened(outcome: Outcome, flip: Flip, pair: str | None) -> tuple[str, Cause]:
    """What the body did, and the cause that this alone names."""
    first = _first_touch(flip, clear=outcome in (Outcome.FOUR_LEG, Outcome.TWO_LEG))
    match outcome:
        case Outcome.FOUR_LEG:
            return f"it landed on four legs{first}", Cause.FOUR_LEGS
        case Outcome.FOUR_LEG_BODY_CONTACT:
            what = f"it hangs on four legs, but the body met the ceiling too{first}"
            return what, Cause.FOUR_LEGS_BODY_CONTACT
        case Outcome.TWO_LEG | Outcome.TWO_LEG_BODY_CONTACT:
            return f"it hangs on {'two' if pair is None else f'its {pair}'} legs only{first}", Cause.TWO_LEGS
    if flip.touch is not None:
        held = Cause.FEET_LET_GO if flip.touch.feet_margin_m >= 0.0 else Cause.BODY_FIRST
        return f"it did not hold{first}", held
    if flip.gap_m is None or flip.gap_m <= -BEYOND_CEILING_M:
        return "it flipped and fell", Cause.CEILING_NOT_REACHED
    missing = max(flip.gap_m, 0.0) * 1e3
    top = f"stayed {missing:.0f} mm below" if missing >= 1.0 else "just reached it, and no foot met it"
    what = f"it did not get hold of the ceiling: at the top it {top}"
    return what, Cause.CEILING_NOT_REACHED


def _first_touch(flip: Flip, *, clear: bool) -> str:
    """What met the ceiling first and at which turn; nothing where the record does not show it.

    Where the poses have the body `clear` of the ceiling throughout, they and the gyro's clock are apart (a
    computer that was too busy), and the attitude at the blow is not to be believed.
    """
    if flip.touch is None or (clear and flip.touch.feet_margin_m < 0.0):
        return ""
    what = "feet" if flip.touch.feet_margin_m >= 0.0 else "body"
    return f"; the {what} touched first at {flip.touch.turn_deg:.0f} deg"


def _deviation(flip: Flip) -> _Why | None:
    """What of the flip was not as it should be: what was seen first, then when, then how strong."""
    return _sensing(flip) or _ceiling(flip) or _timing(flip) or _strength(flip)


def _ceiling(flip: Flip) -> _Why | None:
    error = None if flip.touch is None else flip.touch.ceiling_error_m
    if error is None or abs(error) <= CEILING_ERROR_M:
        if flip.touch is not None or flip.gap_m is None or flip.gap_m >= -BEYOND_CEILING_M:
            return None
        words = f"the ceiling is higher than the record says, by {-flip.gap_m * 1e3:.0f} mm at least"
    else:
        side = "higher" if error > 0.0 else "lower"
        words = f"the ceiling is about {abs(error) * 1e3:.0f} mm {side} than the record says"
    return _Why(
        Cause.CEILING_ELSEWHERE, words, "measure the ceiling's height again and correct it in the lab file"
    )


def _sensing(flip: Flip) -> _Why | None:
    late = flip.estimate_late_s
    if late is None or late <= ESTIMATE_LATE_S:
        return None
    words = f"the drone's estimate was {late * 1e3:.0f} ms behind on its climb, so the flip began late"
    remedy = "look at the delay and the rate of the poses: perchhw mocap watch URI"
    return _Why(Cause.MOCAP_LATE, words, remedy)


def _timing(flip: Flip) -> _Why | None:
    late = flip.late_s
    if late is None or abs(late) <= LATE_S:
        return None
    word, cause = ("late", Cause.FLIP_LATE) if late > 0.0 else ("early", Cause.FLIP_EARLY)
    remedy = (
        "the policy that flew fires elsewhere than the one that ships for this vehicle: compare them "
        "(perchhw log replay RUN --policy default), or fly that one"
    )
    return _Why(cause, f"the flip began {abs(late) * 1e3:.0f} ms {word}: {_tau(flip)}", remedy)


def _tau(flip: Flip) -> str:
    return f"tau {flip.tau_s:.3f} s, the region begins at {flip.region_tau_s:.3f}"


def _when(flip: Flip) -> str:
    """When the flip began, in words; a landing may well have forgiven that it was early or late."""
    if flip.tau_s is None or flip.region_tau_s is None:
        return ""
    if (off := _timing(flip)) is not None:
        return off.words
    return f"the flip began in time ({_tau(flip)})"


def _strength(flip: Flip) -> _Why | None:
    if flip.commanded is not None and not WEAK <= flip.commanded <= STRONG:
        weak = flip.commanded < WEAK
        words = f"the flip was too {'weak' if weak else 'strong'}: its policy asked for {flip.commanded:.0%} "
        return _Why(
            Cause.FLIP_WEAK if weak else Cause.FLIP_STRONG,
            words + "of the moment that the policy for this vehicle asks for there",
            "compare the two policies, or fly the one that ships for this vehicle",
        )
    if flip.delivered is None or WEAK_MOTORS <= flip.delivered <= STRONG:
        return None
    weak = flip.delivered < WEAK_MOTORS
    words = f"the flip was too {'weak' if weak else 'strong'}: the body turned as by {flip.delivered:.0%} "
    remedy = "measure thrust and inertia (perchhw calibrate thrust, bifilar)"
    if weak:
        remedy = f"charge or change the pack, look at motors and propellers, then {remedy}"
    return _Why(
        Cause.FLIP_WEAK if weak else Cause.FLIP_STRONG, words + "of the moment that was commanded", remedy
    )


def _computed_otherwise(trigger: Trigger, flown: Policy | None) -> _Why | None:
    """The drone's own snapshot against the policy that it should hold."""
    seen = trigger.snapshot
    if flown is None or not {*CUES, "trigger_value", "a_rot"} <= seen.keys():
        return None
    state = np.array([[seen[name] for name in CUES]], dtype=np.float32)
    value = float(trigger_values(flown.compiled(), state)[0])
    moment = float(action_moments(flown.compiled(), state)[0])
    remedy = "reboot the drone, upload again and rehearse (perchhw rehearse) before the next flight"
    if abs(value - seen["trigger_value"]) > VALUE_TOLERANCE:
        words = (
            f"the drone computed a trigger value of {seen['trigger_value']:.3f}, its policy gives {value:.3f}"
        )
    elif abs(moment - seen["a_rot"]) > MOMENT_TOLERANCE_N_M:
        words = (
            f"the drone computed a moment of {seen['a_rot'] * 1e3:.2f} N mm, "
            f"its policy gives {moment * 1e3:.2f}"
        )
    else:
        return None
    return _Why(Cause.OTHER_POLICY_COMPUTED, words, remedy)


def holding_pair(flight: Flight, vehicle: Vehicle) -> str | None:
    """Which two neighbouring feet are highest at rest: ``fore``, ``hind``, ``left``, ``right``; or None."""
    if not flight.has("z", "qw"):
        return None
    t, pose = flight.series("qx", "qy", "qz", "qw")
    rest = t > t[-1] - REST_WINDOW_S
    if not rest.any():
        return None
    upward: FloatArray = to_matrices(pose[rest].copy())[:, 2, :].mean(axis=0)
    heights = landing_geometry(vehicle).feet @ upward
    low, high = sorted(int(k) for k in np.argsort(heights)[-2:])
    return _PAIRS.get((low, high))


def _next_after(cause: Cause, pair: str | None) -> str:
    match cause:
        case Cause.FOUR_LEGS:
            return "nothing to change; put the drone back on its mark (--put-back) for the next flight"
        case Cause.TWO_LEGS:
            others = "other" if pair is None else _OTHER[pair]
            return f"look at the feet of the {others} legs and at the ceiling there, then fly it again"
        case Cause.FEET_LET_GO:
            return "clean the feet and the ceiling, then fly it again"
        case Cause.CEILING_NOT_REACHED:
            return "fly faster or steeper: this climb does not carry the flip to the ceiling"
        case _:
            return "fly it again; where it repeats, choose a condition where the policy lands better"


def _values(flip: Flip, pair: str | None) -> dict[str, Number]:
    """The numbers behind it; what the record does not show is left out."""
    touch = flip.touch
    known: dict[str, Any] = {
        "tau_s": flip.tau_s,
        "region_tau_s": flip.region_tau_s,
        "late_ms": None if flip.late_s is None else flip.late_s * 1e3,
        "commanded_share": flip.commanded,
        "delivered_share": flip.delivered,
        "estimate_late_ms": None if flip.estimate_late_s is None else flip.estimate_late_s * 1e3,
        "climb_m_s": flip.climb_m_s,
        "touch_after_s": None if touch is None else touch.after_s,
        "turn_deg": None if touch is None else touch.turn_deg,
        "feet_margin_m": None if touch is None else touch.feet_margin_m,
        "ceiling_error_m": None if touch is None else touch.ceiling_error_m,
        "gap_m": flip.gap_m,
        "pair": pair,
    }
    return {name: value for name, value in known.items() if value is not None}
