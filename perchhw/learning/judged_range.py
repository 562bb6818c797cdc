"""The approaches of the real flights from which the error of the simulation is known."""

from collections.abc import Sequence

from perchhw.learning.grid import Condition

JUDGED_FLIGHTS = 28
"""The authors', of known outcome, behind :data:`perchhw.learning.real_rate.AUTHORS_ERROR`."""

JUDGED_SPEEDS, JUDGED_ANGLES_DEG = (1.75, 3.0), (30.0, 50.0)
"""m/s and deg, as commanded, of most of them. Outside hardly any real flight tells."""


def inside_judged_range(approaches: Sequence[Condition]) -> float:
    """Share of approaches that are like those of the judged flights."""
    (slowest, fastest), (flattest, steepest) = JUDGED_SPEEDS, JUDGED_ANGLES_DEG
    inside = [slowest <= one.speed <= fastest and flattest <= one.angle_deg <= steepest for one in approaches]
    return sum(inside) / len(inside)


def judged_range_in_words(inside: float) -> str:
    """What that share means for an interval of the real rate."""
    (slowest, fastest), (flattest, steepest) = JUDGED_SPEEDS, JUDGED_ANGLES_DEG
    return (
        f"The interval holds the model's error on {JUDGED_FLIGHTS} flights alone, most of them at "
        f"{slowest:g} to {fastest:g} m/s and {flattest:g} to {steepest:g} deg: {inside:.0%} of these "
        "conditions are such."
    )
