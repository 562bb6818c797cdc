"""What a landing came to, from the state of the simulation."""

from typing import Any

from onboard.outcome import Outcome
from sim_backend.physics.outcome import classify


def landing_outcome(state: Any, triggered: bool = True) -> Outcome:
    """The outcome of an attempt from the state at rest on the ceiling."""
    return classify(int(state["foot_attached"].sum()), bool(state["body_contact"]), triggered)
