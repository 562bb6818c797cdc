"""One effect that came into the model, and why."""

from collections.abc import Callable
from dataclasses import dataclass, field

from calibration.gap.estimate.acceptance import Judgement
from calibration.gap.estimate.refine import Fitted

Progress = Callable[[str], None]
"""Called with what is being looked at."""


@dataclass(frozen=True)
class SelectionStep:
    """One effect that came into the model.

    Attributes:
        effect: its name.
        judgement: why.
        after: the fit with it.
        rivals: effects that explained nearly as much, with the gain that each lacked.
    """

    effect: str
    judgement: Judgement
    after: Fitted
    rivals: dict[str, float] = field(default_factory=dict)
