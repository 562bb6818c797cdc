"""A number that was given in another unit than the one that was asked for: which unit it looks like."""

from collections.abc import Callable

from onboard.quantity import convert

_ALSO_SAID = {
    "m": ("cm", "mm"),
    "m/s": ("cm/s", "mm/s"),
    "s": ("ms",),
    "V": ("mV",),
    "deg": ("rad",),
}
"""What people measure in beside the unit that is asked for; the more usual one first."""
_WORDS = {
    "m": "metres",
    "cm": "centimetres",
    "mm": "millimetres",
    "m/s": "metres a second",
    "cm/s": "centimetres a second",
    "mm/s": "millimetres a second",
    "s": "seconds",
    "ms": "milliseconds",
    "V": "volts",
    "mV": "millivolts",
    "deg": "degrees",
    "rad": "radians",
}


def unit_hint(value: float, unit: str, fits: Callable[[float], bool]) -> str:
    """The end of a refusal: the unit in which `value` would fit, and what to write; empty without one.

    Args:
        value: the number that was refused, in `unit`.
        unit: the unit that is asked for.
        fits: whether a number in `unit` would do.
    """
    for other in _ALSO_SAID.get(unit, ()):
        meant = convert(value, other, unit)
        if fits(meant):
            return f". That looks like {_WORDS[other]}; write {_WORDS[unit]} ({meant:.4g})"
    return ""
