"""What a landing attempt came to, from the state of the simulation."""

from onboard.outcome import Outcome


def classify(feet: int, body_contact: bool, triggered: bool = True) -> Outcome:
    """The outcome of an attempt that ended with `feet` feet on the ceiling."""
    if not triggered:
        return Outcome.NO_TRIGGER
    if feet == 0:
        return Outcome.FAILURE
    if feet >= 3:
        return Outcome.FOUR_LEG_BODY_CONTACT if body_contact else Outcome.FOUR_LEG
    return Outcome.TWO_LEG_BODY_CONTACT if body_contact else Outcome.TWO_LEG
