"""Thrust maps: the forms that tie a motor's voltage to its thrust, and their compiled layout.

The arithmetic is in :mod:`onboard.battery`. Three forms exist (paper errata, section 1):

==================  =====================================================================================
form                meaning (f thrust of one motor in N, V voltage at the motor)
==================  =====================================================================================
quadratic_inverse   f = a V^2 + b V + c, one row up to `break_thrust` and one above; the table "Battery
                    Compensation Parameters" of the paper read as its authors' code uses it
firmware_cubic      f = c0 + c1 V + c2 V^2 + c3 V^3 (Bitcraze firmware, VMOTOR2THRUST0..3)
two_region_log      V = a1 ln(1 + f/b1) up to `break_thrust`, V(break) + a2 ln((f + b2)/(break + b2)) above
==================  =====================================================================================
"""

from enum import IntEnum
from typing import NamedTuple

from onboard.arrays import FloatArray


class ThrustMapForm(IntEnum):
    """Form of a thrust map; the name in lower case is the word used in vehicle files."""

    QUADRATIC_INVERSE = 0
    FIRMWARE_CUBIC = 1
    TWO_REGION_LOG = 2


COEFFICIENT_UNITS: dict[ThrustMapForm, dict[str, str]] = {
    ThrustMapForm.QUADRATIC_INVERSE: {
        "low_a": "N/V2",
        "low_b": "N/V",
        "low_c": "N",
        "high_a": "N/V2",
        "high_b": "N/V",
        "high_c": "N",
        "break_thrust": "N",
    },
    ThrustMapForm.FIRMWARE_CUBIC: {"c0": "N", "c1": "N/V", "c2": "N/V2", "c3": "N/V3"},
    ThrustMapForm.TWO_REGION_LOG: {"a1": "V", "b1": "N", "a2": "V", "b2": "N", "break_thrust": "N"},
}
"""Names of the coefficients in a vehicle file, in the order of `ThrustMap.coefficients`, with SI units."""


class ThrustMap(NamedTuple):
    """A thrust map for compiled code.

    Attributes:
        form: a `ThrustMapForm`.
        coefficients: float64[8] in SI units, order of `COEFFICIENT_UNITS`, unused ones zero.
    """

    form: int
    coefficients: FloatArray
