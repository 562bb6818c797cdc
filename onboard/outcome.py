"""How a landing attempt ended: the same classes for the simulation, labels and reports."""

from enum import StrEnum


class Outcome(StrEnum):
    """How an attempt ended. Three or four legs count as four-leg, one or two as two-leg (paper's reward)."""

    FOUR_LEG = "four_leg"
    FOUR_LEG_BODY_CONTACT = "four_leg_body_contact"
    TWO_LEG = "two_leg"
    TWO_LEG_BODY_CONTACT = "two_leg_body_contact"
    FAILURE = "failure"
    NO_TRIGGER = "no_trigger"
    ABORTED = "aborted"

    @property
    def attached(self) -> bool:
        """Whether at least one leg holds the vehicle to the ceiling."""
        return self in ATTACHED_OUTCOMES

    @property
    def success(self) -> bool:
        """Whether it counts in a success rate: four legs without body contact."""
        return self is Outcome.FOUR_LEG


ATTACHED_OUTCOMES = frozenset(
    {Outcome.FOUR_LEG, Outcome.FOUR_LEG_BODY_CONTACT, Outcome.TWO_LEG, Outcome.TWO_LEG_BODY_CONTACT}
)
