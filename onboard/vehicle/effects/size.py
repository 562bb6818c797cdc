"""How large a vehicle is, and with it everything that an effect can do to it."""

from collections.abc import Mapping
from typing import NamedTuple


class Size(NamedTuple):
    """Magnitudes from which the sizes of effects follow.

    Attributes:
        mass: kg.
        arm: m, from the centre to a hub.
        radius: m, of a propeller.
        rotor_speed: rad/s, in hover; the reference's where the vehicle file does not know it.
        resistance: ohm, full voltage over the current of hover.
    """

    mass: float
    arm: float
    radius: float
    rotor_speed: float
    resistance: float

    def ratio(self, powers: Mapping[str, float]) -> float:
        """Product of the powers of these magnitudes, 1 for the :data:`REFERENCE`."""
        product = 1.0
        for name, power in powers.items():
            product *= (getattr(self, name) / getattr(REFERENCE, name)) ** power
        return product


REFERENCE = Size(mass=0.030, arm=0.045962, radius=0.0225, rotor_speed=1828.75, resistance=2.0289)
"""The Crazyflie for which bounds and typical values are given (crazyflie21-stock)."""
