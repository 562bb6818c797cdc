"""What a landing attempt came to, in the classes of the project."""

from enum import StrEnum
from typing import Any


class LandingOutcome(StrEnum):
    """Classes of landing attempts; three or four feet count as four-leg, one or two as two-leg."""

    FOUR_LEG = "four_leg"
    FOUR_LEG_BODY_CONTACT = "four_leg_body_contact"
    TWO_LEG = "two_leg"
    TWO_LEG_BODY_CONTACT = "two_leg_body_contact"
    FAILURE = "failure"
    NO_TRIGGER = "no_trigger"


def classify(feet: int, body_contact: bool, triggered: bool = True) -> LandingOutcome:
    """The outcome of an attempt that ended with `feet` feet on the ceiling."""
    if not triggered:
        return LandingOutcome.NO_TRIGGER
    if feet == 0:
        return LandingOutcome.FAILURE
    if feet >= 3:
        return LandingOutcome.FOUR_LEG_BODY_CONTACT if body_contact else LandingOutcome.FOUR_LEG
    return LandingOutcome.TWO_LEG_BODY_CONTACT if body_contact else LandingOutcome.TWO_LEG


def landing_outcome(state: Any, triggered: bool = True) -> LandingOutcome:
    """The outcome of an attempt from the state at rest on the ceiling."""
    return classify(int(state["foot_attached"].sum()), bool(state["body_contact"]), triggered)
