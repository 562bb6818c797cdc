"""Whether landings that were counted are likely under the model's own prediction.

Landings are a matter of chance, and the model says of how much: so many of n independent landings with
probabilities p_i, which is a Poisson binomial number (Wang, Statist. Sinica 3, 295, 1993), exact here.
"""

from collections.abc import Sequence

import numpy as np

LEVEL = 1e-3
"""A right prediction is called unlikely at most so often."""


def tail(happened: int, probabilities: Sequence[float]) -> float:
    """Probability of a count as far off as `happened` or farther: twice the smaller tail, at most 1.

    Args:
        happened: 0..n. probabilities: (n,), of independent events.
    """
    share = np.ones(1)
    for p in probabilities:
        share = np.convolve(share, [1.0 - p, p])
    below, above = share[: happened + 1].sum(), share[happened:].sum()
    return float(min(1.0, 2.0 * min(below, above)))


def assert_likely(happened: int, probabilities: Sequence[float], simulated: int) -> None:
    """Fail where a right prediction would give such a count in less than :data:`LEVEL` of the cases.

    Args:
        happened: how many landed so. probabilities: (n,), predicted of each.
        simulated: landings behind each probability: what never happened in them is not impossible (Laplace's
            rule of succession).
    """
    p = (np.asarray(probabilities) * simulated + 1.0) / (simulated + 2.0)
    chance = tail(happened, p.tolist())
    assert chance >= LEVEL, f"{happened} of {p.size}, expected {p.sum():.1f}: {chance:.1e} by chance"
