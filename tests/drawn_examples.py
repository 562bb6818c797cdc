"""How many examples a property draws whose test asks for another number than the usual one."""

from hypothesis import settings

USUAL = 30
"""Examples of a property in `make test`."""
SOAK = 3000
"""In `make soak`."""


def examples(count: int) -> int:
    """`count` where the usual number is drawn; as many times more as the profile draws, and no fewer than it.

    A number of a test's own would hold in every profile: the long proof would draw no more than `make test`.
    """
    of_profile = settings().max_examples
    return count if of_profile <= USUAL else max(count * of_profile // USUAL, of_profile)
