"""Physical quantities with unit, uncertainty and source, and the conversion of units to SI."""

import math
import re
from dataclasses import dataclass
from functools import cache

from onboard.errors import InputError, OnboardError
from onboard.gravity import GRAM_FORCE


class UnitError(OnboardError, InputError):
    """A unit that is not known, or that does not measure what is asked for."""


@dataclass(frozen=True)
class Quantity:
    """A number that says what it is.

    Attributes:
        value: the number, in `unit`.
        unit: unit as text, such as ``kg m2`` (SI wherever the library made it).
        sigma: standard uncertainty (k = 1), in `unit`; 0 for a number that is exact by definition.
        source: where the number comes from: table, citation, measurement record or "engineering estimate".
    """

    value: float
    unit: str
    sigma: float
    source: str


# Exponents of (kg, m, s, A, rad). The radian counts as a base unit, so that N m and N m/rad are not confused.
_Dimension = tuple[int, int, int, int, int]
_SI_DIMENSION: dict[str, _Dimension] = {
    "1": (0, 0, 0, 0, 0),
    "bit": (0, 0, 0, 0, 0),
    "kg": (1, 0, 0, 0, 0),
    "m": (0, 1, 0, 0, 0),
    "s": (0, 0, 1, 0, 0),
    "A": (0, 0, 0, 1, 0),
    "rad": (0, 0, 0, 0, 1),
    "N": (1, 1, -2, 0, 0),
    "Pa": (1, -1, -2, 0, 0),
    "W": (1, 2, -3, 0, 0),
    "V": (1, 2, -3, -1, 0),
    "ohm": (1, 2, -3, -2, 0),
    "C": (0, 0, 1, 1, 0),
    "Hz": (0, 0, -1, 0, 0),
}
_CONVERSION: dict[str, tuple[str, float]] = {
    "g": ("kg", 1e-3),
    "mg": ("kg", 1e-6),
    "cm": ("m", 1e-2),
    "mm": ("m", 1e-3),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "mA": ("A", 1e-3),
    "deg": ("rad", math.pi / 180.0),
    "mN": ("N", 1e-3),
    "gf": ("N", GRAM_FORCE),
    "mV": ("V", 1e-3),
    "mohm": ("ohm", 1e-3),
    "mAh": ("C", 3.6),
    "%": ("1", 1e-2),
}
_TOKEN = re.compile(r"^([A-Za-z%]+|1)([0-9]?)$")


@cache
def si_unit(unit: str) -> tuple[str, float]:
    """The SI form of a unit and the factor that converts to it: ``"gf/V2" -> ("N/V2", 9.80665e-3)``.

    A unit is a product of symbols separated by blanks, with at most one ``/`` before the denominator;
    a digit behind a symbol is its power.

    Raises:
        UnitError: the unit is not understood.
    """
    parts = unit.split("/")
    if len(parts) > 2 or not all(part.strip() for part in parts):
        raise UnitError(f"unit {unit!r} is not understood: write it like 'N m/rad', with one '/' at most")
    factor = 1.0
    sides: list[str] = []
    for sign, part in zip((1, -1), parts, strict=False):
        symbols: list[str] = []
        for token in part.split():
            match = _TOKEN.match(token)
            symbol = match.group(1) if match else token
            si_symbol, scale = _CONVERSION.get(symbol, (symbol, 1.0))
            if match is None or si_symbol not in _SI_DIMENSION:
                known = ", ".join(sorted({*_SI_DIMENSION, *_CONVERSION}))
                raise UnitError(f"unit {unit!r} is not understood at {token!r}: known symbols are {known}")
            power = match.group(2)
            factor *= scale ** (sign * int(power or 1))
            symbols.append(si_symbol + power)
        sides.append(" ".join(symbols))
    return "/".join(sides), factor


@cache
def _dimension(unit: str) -> _Dimension:
    total = [0, 0, 0, 0, 0]
    for sign, part in zip((1, -1), unit.split("/"), strict=False):
        for token in part.split():
            match = _TOKEN.match(token)
            symbol, power = (match.group(1), int(match.group(2) or 1)) if match else (token, 1)
            for index, exponent in enumerate(_SI_DIMENSION[symbol]):
                total[index] += sign * power * exponent
    return total[0], total[1], total[2], total[3], total[4]


def convert(value: float, unit: str, target: str) -> float:
    """`value` in `unit`, expressed in `target`: ``convert(38.1, "g", "kg") -> 0.0381``.

    Raises:
        UnitError: one of the units is not understood, or they measure different things.
    """
    source_si, source_factor = si_unit(unit)
    target_si, target_factor = si_unit(target)
    if _dimension(source_si) != _dimension(target_si):
        raise UnitError(f"unit {unit!r} does not measure what is asked for: give a unit like {target!r}")
    return value * (source_factor / target_factor)
