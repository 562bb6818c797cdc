"""How numbers of landings are told to people: shares, intervals, and what is gained over the base rate."""

from calibration.measurement import Interval

_SMALL = 0.01
"""Smaller shares keep one significant digit."""


def percent(share: float) -> str:
    """A share 0..1 in whole percent; a small one with one significant digit: ``80 %``, ``0.02 %``."""
    return f"{100.0 * share:.0f} %" if share >= _SMALL or share == 0.0 else f"{100.0 * share:.1g} %"


def between(interval: Interval | None, sign: str = "") -> str:
    """`` (0.47 to 0.88)``, nothing without one. `sign` "+": of a difference, where an end that is rounded to
    zero shows by its sign on which side it lies."""
    return "" if interval is None else f" ({interval[0]:{sign}.2f} to {interval[1]:{sign}.2f})"


def difference(gain: float | None, ci95: Interval | None) -> str:
    """``-0.15 (-0.29 to -0.02)``; without one all flights ended alike."""
    return "none: all ended alike" if gain is None else f"{gain:+.2f}{between(ci95, '+')}"
