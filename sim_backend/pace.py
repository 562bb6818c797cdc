"""The pace of a simulated lab: real time, a multiple of it, or as fast as those who take part can follow."""

from dataclasses import dataclass
from typing import Self

from onboard.errors import InputError
from sim_backend.errors import SimulationError

SLOWEST, FASTEST = 0.01, 100.0


class PaceError(SimulationError, InputError):
    """A pace that a lab cannot have."""


@dataclass(frozen=True, slots=True)
class Pace:
    """How the lab's time goes.

    Attributes:
        rate: lab s in a real s at most; None: as fast as it goes, and never while nobody takes part.
        waits: whether the lab waits for those who take part in its turns.
    """

    rate: float | None
    waits: bool

    @classmethod
    def parse(cls, text: str) -> Self:
        """From ``real``, ``lockstep`` or a factor.

        Raises:
            PaceError: neither.
        """
        if text == "real":
            return cls(1.0, False)
        if text == "lockstep":
            return cls(None, True)
        try:
            rate = float(text)
        except ValueError:
            raise PaceError(f"--pace {text}: write real, lockstep or a factor such as 0.5") from None
        if not SLOWEST <= rate <= FASTEST:
            raise PaceError(f"--pace {text}: a factor is between {SLOWEST:g} and {FASTEST:g}")
        return cls(rate, True)


REAL = Pace(1.0, False)
