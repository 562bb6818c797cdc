"""The walk-through: a hidden change of the drone, found from its own records, and landings that come back."""

from perchhw.walkthrough.gap.walkthrough import Walkthrough, run_walkthrough

__all__ = ["Walkthrough", "run_walkthrough"]
