"""Speed to thrust, propeller by propeller: f = c1 w + c2 w^2 + c0.

The map must belong to the propeller that is fitted: at 2500 rad/s the maps below give 8.5 to 14 gf.
"""

import math
from dataclasses import dataclass

import numpy as np

from calibration.bench.motors.errors import TachometerError
from onboard.arrays import FloatArray

_RPM = 60.0 / (2.0 * math.pi)
"""rpm per rad/s."""


@dataclass(frozen=True, slots=True)
class PropellerMap:
    """Thrust of one propeller against its speed.

    Attributes:
        name: for flags and files.
        offset: N.
        linear: N s/rad.
        square: N s2/rad2.
        source: citation.
    """

    name: str
    offset: float
    linear: float
    square: float
    source: str

    def thrust(self, speed: float) -> float:
        """Thrust (N) at `speed` (rad/s); never negative."""
        return max(0.0, self.offset + speed * (self.linear + speed * self.square))

    def thrusts(self, speeds: FloatArray) -> FloatArray:
        """As :meth:`thrust`, for many speeds."""
        return np.maximum(0.0, self.offset + speeds * (self.linear + speeds * self.square))

    def speed(self, thrust: float) -> float:
        """Speed (rad/s) that gives `thrust` (N): the rising branch; 0 for no thrust.

        Raises:
            TachometerError: a negative thrust.
        """
        if thrust < 0.0:
            raise TachometerError(f"a thrust of {thrust} N: a propeller here only pushes one way")
        if thrust == 0.0:
            return 0.0
        root = math.sqrt(max(0.0, self.linear**2 + 4.0 * self.square * (thrust - self.offset)))
        return max(0.0, (root - self.linear) / (2.0 * self.square))


def _bitcraze(name: str, rpm1: float, rpm2: float, what: str) -> PropellerMap:
    source = f"crazyflie-firmware tools/system_id and utiasDSL drone-models params.toml, {what}"
    return PropellerMap(name, 0.0, rpm1 * _RPM, rpm2 * _RPM**2, source)


PROPELLERS: dict[str, PropellerMap] = {
    one.name: one
    for one in (
        _bitcraze("P250", -3.6200226530383495e-7, 1.6060924104300328e-10, "Crazyflie 2.1+ propellers"),
        _bitcraze(
            "L250", -5.382196214637237e-7, 2.4582929831265485e-10, "legacy propellers of the 2.0 and 2.1"
        ),
        _bitcraze("T350", -7.167227176573658e-7, 2.9401303690194613e-10, "thrust upgrade kit"),
        PropellerMap(
            "bitcraze-2015",
            0.0,
            0.0,
            2.2e-8,
            "Bitcraze 2015 table (crazyflie-firmware docs, pwm-to-thrust) as the paper's authors used it: "
            "one coefficient near full thrust; 1.78e-8 at low speed",
        ),
        PropellerMap(
            "foerster",
            -7.24e-3,
            1.557e-5,
            1.282e-8,
            "Foerster 2015, System Identification of the Crazyflie 2.0, ETH Zurich: PWM eliminated from his "
            "thrust and speed curves (paper errata 2)",
        ),
    )
}
"""Maps by name."""


def propeller(name: str) -> PropellerMap:
    """The map of that name.

    Raises:
        TachometerError: there is none.
    """
    if name not in PROPELLERS:
        raise TachometerError(f"propeller {name!r} is not known; choose one of {', '.join(PROPELLERS)}")
    return PROPELLERS[name]
