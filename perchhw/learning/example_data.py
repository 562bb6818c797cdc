"""What a report shows beside the numbers of a folder: one learning trial and one approach."""

from dataclasses import dataclass

from calibration.flights import Flight
from onboard.arrays import BoolArray, FloatArray
from perchhw.learning.grid import Condition


@dataclass(frozen=True)
class Convergence:
    """One learning trial of n episodes with k rollouts each.

    Attributes:
        condition, repeat: of the trial.
        mu, sigma: (n + 1, 2) tau_cr (s) and a_rot (N m) of the distribution that each episode sampled, the
            final one last.
        samples: (n, k, 2) tau_cr (s) and a_rot (N m) that were tried.
        rewards: (n, k).
        best: (n, k) whether a sample was among those that moved the distribution.
        landing_rate: of the evaluation with the final distribution.
        converged: whether the distribution became narrow enough to stop.
        as_recorded: whether it came out as in the sweep's table; not so where the code has changed since.
    """

    condition: Condition
    repeat: int
    mu: FloatArray
    sigma: FloatArray
    samples: FloatArray
    rewards: FloatArray
    best: BoolArray
    landing_rate: float
    converged: bool
    as_recorded: bool


@dataclass(frozen=True)
class Examples:
    """Examples of a learning folder; None is left out.

    Attributes:
        trial: one learning trial.
        flight: one approach of the policy, simulated or flown.
        doubts: why something is left out, in words.
    """

    trial: Convergence | None = None
    flight: Flight | None = None
    doubts: tuple[str, ...] = ()
