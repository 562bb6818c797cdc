"""The landing outcome of a flight, from what its data show, with the evidence and its limits.

Legs cannot be seen by motion capture: the outcome follows from how the vehicle rests (pose), swings or falls
(gyro). What each kind of flight can show, and how often the label agrees with the authors', is in
``docs/labels.md``.
"""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from calibration.flights import Flight, PoseSource
from onboard.room import ceiling_height
from onboard.vehicle import Vehicle
from perchhw.attempt import Outcome
from perchhw.label.evidence import Hold, Touch
from perchhw.label.geometry import LabelError, LandingGeometry, landing_geometry
from perchhw.label.gyro import MINIMUM_WINDOW_S, SETTLE_S, judge_gyro
from perchhw.label.pose import judge_pose

MISSED_TRIGGER_RULES = frozenset({"missed_trigger", "no_trigger"})
"""Names of abort rules that mean that the policy never fired: ``no_trigger``, not ``aborted``."""

_TELL_A_FLIP = ("triggered", "landing_state", "qx")
"""Channels of which one must be there before a flight without a trigger is one that did not flip."""
_LIMIT_FEET = "three and four feet look alike, so do one and two"
_LIMIT_NO_POSE = "no resting pose: judged by the gyro alone"
_LIMIT_ESTIMATE = "the onboard estimate is unreliable after the trigger and was not used"
_LIMIT_TOO_SHORT = "the record ends before the vehicle rests"
_LIMIT_BODY_UNSEEN = "body contact cannot be told: rows too far apart at contact"

_LANDED = {
    (Hold.FOUR_LEG, False): Outcome.FOUR_LEG,
    (Hold.FOUR_LEG, True): Outcome.FOUR_LEG_BODY_CONTACT,
    (Hold.TWO_LEG, False): Outcome.TWO_LEG,
    (Hold.TWO_LEG, True): Outcome.TWO_LEG_BODY_CONTACT,
    (Hold.NONE, False): Outcome.FAILURE,
    (Hold.NONE, True): Outcome.FAILURE,
}


@dataclass(frozen=True)
class LandingLabel:
    """How a flight ended.

    Attributes:
        outcome: the landing outcome.
        method: what decided: ``truth``, ``pose``, ``gyro`` or ``events``.
        body_contact_seen: whether the data could show body contact at all.
        evidence: measured values behind the outcome.
        limits: what this label cannot know, in words.
    """

    outcome: Outcome
    method: str
    body_contact_seen: bool
    evidence: dict[str, Any]
    limits: tuple[str, ...] = ()

    @property
    def shows_body_contact(self) -> bool:
        """Whether the data would show that the body touched, and that it did not: a gyro alone sees a touch
        at best, never that there was none."""
        return self.method in ("truth", "pose")

    def json_shape(self) -> dict[str, Any]:
        """The label as a JSON object."""
        evidence = {"method": self.method, "body_contact_seen": self.body_contact_seen, **self.evidence}
        return {"outcome": self.outcome, "evidence": evidence, "limits": self.limits}


def label_flight(flight: Flight, vehicle: Vehicle, ceiling_z: float | None = None) -> LandingLabel:
    """Label one flight.

    Args:
        flight: the flight.
        vehicle: with legs; its geometry says where a landed vehicle rests.
        ceiling_z: height of the ceiling (m); default: the flight's own.

    Raises:
        LabelError: the flight lacks what a label needs; the message says what.
        CeilingError: there is no such ceiling.
    """
    if ceiling_z is not None:
        flight = replace(flight, ceiling_z=ceiling_height(ceiling_z))
    if flight.has("legs_attached"):
        return label_from_truth(flight)
    if flight.trigger is None:
        return _label_without_trigger(flight)
    if flight.ceiling_z is None:
        raise LabelError(f"{flight.source}: the ceiling's height is unknown; give it (--ceiling-z M)")
    remaining = float(flight.t[-1]) - flight.trigger.t
    if remaining < SETTLE_S + MINIMUM_WINDOW_S and (flight.aborted_by is not None or not flight.finished):
        evidence = {
            "triggered": True,
            "aborted_by": flight.aborted_by,
            "seconds_after_trigger": remaining,
            "record_finished": flight.finished,
        }
        return LandingLabel(Outcome.ABORTED, "events", False, evidence, (_LIMIT_TOO_SHORT,))
    return _label_triggered(flight, flight.trigger.t, landing_geometry(vehicle), flight.ceiling_z)


def label_from_truth(flight: Flight) -> LandingLabel:
    """Label a flight by the simulation's truth columns ``legs_attached`` and ``body_contact``.

    Raises:
        LabelError: the flight has no column ``legs_attached``.
    """
    if not flight.has("legs_attached"):
        raise LabelError(f"{flight.source}: no column legs_attached")
    t, legs = flight.series("legs_attached")
    feet = round(float(np.median(legs[t > t[-1] - 0.2])))
    contact = False
    if flight.has("body_contact", "z"):
        _, touched = flight.series("body_contact", "z")
        high = touched[:, 1] > 0.5 * np.max(touched[:, 1])  # contact with the floor is not meant
        contact = bool(np.any(touched[high, 0] > 0.0))
    evidence = {"n_feet": feet, "body_contact": contact}
    if feet == 0:
        flipped = flight.trigger is not None or _turned_over(flight)
        return LandingLabel(Outcome.FAILURE if flipped else Outcome.NO_TRIGGER, "truth", True, evidence)
    hold = Hold.FOUR_LEG if feet >= 3 else Hold.TWO_LEG
    return LandingLabel(_LANDED[hold, contact], "truth", True, evidence)


def _turned_over(flight: Flight) -> bool:
    """Whether b_z ever points below the horizon."""
    _, q = flight.series("qx", "qy")
    return bool(np.any(q[:, 0] ** 2 + q[:, 1] ** 2 > 0.5))


def _label_without_trigger(flight: Flight) -> LandingLabel:
    """Label a flight whose data have no trigger.

    Raises:
        LabelError: nothing says whether it flipped.
    """
    evidence: dict[str, Any] = {
        "triggered": False,
        "aborted_by": flight.aborted_by,
        "record_finished": flight.finished,
    }
    if flight.has("trigger_value"):
        evidence["trigger_value_max"] = float(np.max(flight.series("trigger_value")[1]))
    missed = flight.aborted_by in MISSED_TRIGGER_RULES
    if (flight.aborted_by is not None and not missed) or not flight.finished:
        return LandingLabel(Outcome.ABORTED, "events", False, evidence)
    if not any(map(flight.has, _TELL_A_FLIP)):
        raise LabelError(f"{flight.source}: no attitude and no column triggered say whether it flipped")
    return LandingLabel(Outcome.NO_TRIGGER, "events", False, evidence)


def _label_triggered(
    flight: Flight, trigger_t: float, geometry: LandingGeometry, ceiling_z: float
) -> LandingLabel:
    evidence: dict[str, Any] = {"triggered": True, "aborted_by": flight.aborted_by, "ceiling_z": ceiling_z}
    external = flight.pose_source is not PoseSource.ONBOARD_ESTIMATE
    pose = judge_pose(flight, trigger_t, geometry, ceiling_z, SETTLE_S) if external else None
    if pose is not None:
        evidence |= {"pose": _json(pose)}
        return LandingLabel(_LANDED[pose.hold, pose.body_contact], "pose", True, evidence, (_LIMIT_FEET,))
    gyro = judge_gyro(flight, trigger_t, geometry, ceiling_z)
    evidence |= {"gyro": _json(gyro)}
    contact = gyro.first_touch is Touch.BODY
    limits = [_LIMIT_NO_POSE if external else _LIMIT_ESTIMATE, _LIMIT_FEET]
    if not contact:
        limits.append(_LIMIT_BODY_UNSEEN)
    return LandingLabel(_LANDED[gyro.hold, contact], "gyro", contact, evidence, tuple(limits))


def _json(evidence: Any) -> dict[str, Any]:
    """A dataclass of evidence as JSON values (enums as their words, infinities as None)."""
    plain = {k: v.value if isinstance(v, Hold | Touch) else v for k, v in asdict(evidence).items()}
    return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in plain.items()}
