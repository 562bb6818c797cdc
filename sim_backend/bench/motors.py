"""The four motors on the bench: rotor speeds and thrusts by the vehicle's motor model.

A vehicle with the effect ``motor_speed_law`` follows it; all others have first-order thrust with one time
constant up and one down. The four motors differ a little: gain, and time constants. The means of the four are
the vehicle file's, so that a person who measures all four can find its numbers, and one who measures a single
motor must allow for the spread.
"""

import math
from typing import NamedTuple

import numpy as np

from onboard.arrays import FloatArray
from onboard.battery import thrust_from_voltage
from onboard.thrust_map import ThrustMap
from onboard.vehicle import Vehicle
from sim_backend.bench.errors import BenchInputError
from sim_backend.physics.effects.motor_speed_law import speed_after
from sim_backend.physics.jit import outlined

SPREAD_OF_THRUST = 0.02
SPREAD_OF_TIMES = 0.01
"""Standard deviations between motors, relative (bench notes 1.3 say 3 to 5 % between unselected motors)."""


STOPPED = 1e-3
"""rad/s: a rotor this slow stands."""


class MotorLaw(NamedTuple):
    """How a motor follows: the numbers of the vehicle.

    Attributes:
        a_up, a_down: of the speed law, 1/s.
        b_up, b_down: of the speed law, 1/rad; both zero for first-order thrust.
        time_up, time_down: time constants of first-order thrust, s.
        coefficient: N s2/rad2, thrust over the square of the speed.
    """

    a_up: float
    a_down: float
    b_up: float
    b_down: float
    time_up: float
    time_down: float
    coefficient: float


@outlined
def advance_motors(
    law: FloatArray,
    form: int,
    coefficients: FloatArray,
    each: FloatArray,
    duties: FloatArray,
    supply: float,
    speed: FloatArray,
    dt: float,
) -> float:
    """Bring the rotor speeds forward by `dt`, in place.

    Args:
        law: a :class:`MotorLaw`.
        form, coefficients: of the vehicle's thrust map.
        each: gain in thrust and haste of each motor relative to the vehicle (2, 4).
        duties: shares of the supply that the motors get (4,).
        supply: V at the board.
        speed: rad/s (4,).
        dt: s.

    Returns:
        N of all four at the end.
    """
    total = 0.0
    thrust_map = ThrustMap(form, coefficients)
    for motor in range(4):
        target = each[0, motor] * thrust_from_voltage(thrust_map, duties[motor] * supply)
        haste = each[1, motor]
        settled = math.sqrt(target / law[6])
        rising = settled > speed[motor]
        if law[2] > 0.0:
            a, b = (law[0], law[2]) if rising else (law[1], law[3])
            new = speed_after(speed[motor], settled, a * haste, b * haste, dt)
        else:
            time = law[4] if rising else law[5]
            thrust = law[6] * speed[motor] ** 2
            new = math.sqrt((target + (thrust - target) * math.exp(-dt * haste / time)) / law[6])
        speed[motor] = new if new > STOPPED else 0.0
        total += law[6] * speed[motor] ** 2
    return total


def motor_law(vehicle: Vehicle) -> MotorLaw:
    """The law of a vehicle's motors.

    Raises:
        BenchInputError: the vehicle file does not say how thrust and rotor speed belong together.
    """
    motors = vehicle.motors
    if motors.thrust_coefficient is None:
        raise BenchInputError(
            f"{vehicle.name}: the bench shows rotor speeds and needs motors.thrust_coefficient (N s2/rad2) "
            "in the vehicle file; add it"
        )
    law = {effect.name: effect.values() for effect in vehicle.effects}.get("motor_speed_law", {})
    return MotorLaw(
        law.get("a_up", 0.0),
        law.get("a_down", 0.0),
        law.get("b_up", 0.0),
        law.get("b_down", 0.0),
        motors.time_constant_up.value,
        motors.time_constant_down.value,
        motors.thrust_coefficient.value,
    )


def _spread(rng: np.random.Generator, deviation: float) -> FloatArray:
    """Four factors around 1 whose mean is 1."""
    factors = 1.0 + deviation * rng.standard_normal(4)
    return np.asarray(factors / factors.mean())


class BenchMotors:
    """The motors of one drone; call :meth:`step` once a ms.

    Attributes:
        law: of the vehicle.
        each: gain in thrust and haste of each motor relative to it (2, 4).
        speed: rad/s (4,).
        thrust: N of all together.
    """

    def __init__(self, vehicle: Vehicle, rng: np.random.Generator, *, missing: int = 0) -> None:
        """`missing`: number of the motor (1..4) without a propeller, 0 for none."""
        self.law = motor_law(vehicle)
        self.each = np.stack((_spread(rng, SPREAD_OF_THRUST), _spread(rng, SPREAD_OF_TIMES)))
        if missing:
            self.each[0, missing - 1] = 0.0
        self.speed: FloatArray = np.zeros(4)
        self.thrust = 0.0
        self._law = np.array(self.law)
        self._map = vehicle.motors.thrust_map_compiled()

    def step(self, duties: FloatArray, supply: float, dt: float) -> None:
        """Go on by `dt` (s) with these duties (4,) of the supply (V)."""
        form, coefficients = self._map
        self.thrust = advance_motors(self._law, form, coefficients, self.each, duties, supply, self.speed, dt)
