"""A drone on two strings: how well it is hung, the hand that twists it, and what its sensors feel."""

import math
from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle
from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.pendulum import BifilarPendulum, Hung, across, small_angle_rate

OFFSET_M = 0.5e-3
"""Standard deviation of the centre of mass from the middle between the strings, drawn anew with each hang."""
TILT_RAD = math.radians(1.0)
"""Root mean square of the angle between the axis asked for and the vertical, drawn anew with each hang."""
KNOTS = 0.7e-3
"""Relative standard deviation of the working string distance by the knots, drawn anew with each hang."""
SLIP = 0.4e-3
"""The same, drawn anew with each twist: trials in one hang do not agree either (bench notes 1.1)."""
DISTANCE_M, LENGTH_M = 0.2e-3, 2e-3
"""Largest difference between the strings that were asked for and those that hang there."""
AIR = (0.002, 0.002, 0.0005)
"""Largest share of inertia about x, y, z that the air adds."""
DAMPING = (0.0015, 0.0035)
"""Range of the damping ratio of a pendulum that hangs free (real logs: 0.002 to 0.009 with the drag)."""
DRAG = (0.01, 0.04)
SWING = (0.02, 0.05)
"""Range of the swinging after a twist, relative to it; half of that is seen about the vertical."""
TWIST_S, DAMP_S = 1.5, 2.0
"""How long the hand takes to twist, and to calm, s."""
CALMING_S = 0.25


@dataclass(frozen=True, slots=True)
class Strings:
    """Two strings as they hang: distances at frame and body, and length, m."""

    top: float
    bottom: float
    length: float


@dataclass(frozen=True, slots=True)
class SimulatedJig:
    """What holds the drone: kg, and kg m2 about the vertical."""

    mass: float = 0.0
    inertia: float = 0.0


def strung(asked: Strings, rng: np.random.Generator) -> Strings:
    """Strings as a careful person makes them."""
    return Strings(
        asked.top + DISTANCE_M * float(rng.uniform(-1.0, 1.0)),
        asked.bottom + DISTANCE_M * float(rng.uniform(-1.0, 1.0)),
        asked.length + LENGTH_M * float(rng.uniform(-1.0, 1.0)),
    )


def air_inertia(vehicle: Vehicle, rng: np.random.Generator) -> FloatArray:
    """Inertia (3,) kg m2 about x, y, z of the drone with the air that it moves."""
    body = vehicle.body
    inertia = np.array([body.inertia_xx.value, body.inertia_yy.value, body.inertia_zz.value])
    return np.asarray(inertia * (1.0 + np.array(AIR) * rng.random(3)))


class BifilarDrone:
    """A drone on its strings; call :meth:`step` once a ms.

    Attributes:
        vertical: the body direction (3,) that really points up.
        pendulum: its motion.
        amplitude: rad, of the last twist.
    """

    def __init__(
        self,
        strings: Strings,
        axis: FloatArray,
        inertia: FloatArray,
        mass: float,
        jig: SimulatedJig,
        rng: np.random.Generator,
        faults: BenchFaults,
    ) -> None:
        """Hang it.

        Args:
            strings: as they are.
            axis: body direction that shall point up (3,), unit.
            inertia: about the body axes (3,), air included, kg m2.
            mass: of the drone, kg.
            jig: that holds it.
            rng: of placement and release.
            faults: touch, draught, swing.
        """
        self._rng, self._faults = rng, faults
        first, second = across(axis)
        tilt = TILT_RAD / math.sqrt(2.0) * rng.standard_normal(2)
        vertical = axis + math.tan(tilt[0]) * first + math.tan(tilt[1]) * second
        self.vertical = vertical / np.linalg.norm(vertical)
        self._frame = np.stack((self.vertical, *across(self.vertical)), axis=1).tolist()
        knots = 1.0 + KNOTS * float(rng.standard_normal())
        self._free = Hung(
            inertia=float(self.vertical @ (inertia * self.vertical)) + jig.inertia,
            mass=mass + jig.mass,
            top=strings.top * knots,
            bottom=strings.bottom * knots,
            length=strings.length,
            offset=OFFSET_M * float(rng.standard_normal()),
            damping=max(faults.touch, float(rng.uniform(*DAMPING))),
            drag=float(rng.uniform(*DRAG)),
            gravity=GRAVITY,
        )
        self.pendulum = BifilarPendulum(self._free)
        self.amplitude = 0.0
        self._share = 0.0
        self._time = 0.0
        self._hand_until = 0.0
        self._twist: tuple[float, float] | None = None

    def twist(self, angle: float) -> float:
        """Have it twisted to `angle` (rad) and released; s until the release."""
        self._twist = (self.pendulum.theta, angle)
        self._hand_until = self._time + TWIST_S
        return TWIST_S

    def damp(self) -> float:
        """Have it calmed; s until it is still."""
        self._twist = None
        self._hand_until = self._time + DAMP_S
        return DAMP_S

    def step(self, dt: float) -> None:
        """Go on by `dt` (s)."""
        self._time += dt
        left = self._hand_until - self._time
        if left > 0.0:
            self._held(left)
            return
        if self._hand_until > 0.0:
            self._hand_until = 0.0
            self._let_go()
        torque = 0.0
        if self._faults.draught > 0.0:
            push = self._faults.draught / math.sqrt(dt) * float(self._rng.standard_normal())
            torque = push * self._free.inertia
        self.pendulum.step(torque)

    def feel(self, specific_force: FloatArray, rates: FloatArray) -> None:
        """What ideal sensors in the body feel, into the two arrays (3,): m/s2 and rad/s.

        The strings pull along the vertical of the body. Scalars, because this is done for each ms.
        """
        pendulum = self.pendulum
        along, sideways = pendulum.swings[0].rate, pendulum.swings[1].rate
        spin = pendulum.rate + self._share * (along + sideways)
        pull = GRAVITY + pendulum.climb
        for i, (up, first, second) in enumerate(self._frame):
            specific_force[i] = pull * up
            rates[i] = spin * up + along * first + sideways * second

    def _held(self, left: float) -> None:
        pendulum = self.pendulum
        if self._twist is None:
            fade = math.exp(-0.001 / CALMING_S)
            pendulum.hold(pendulum.theta * fade, -pendulum.theta / CALMING_S)
            return
        start, end = self._twist
        phase = math.pi * (1.0 - left / TWIST_S)
        half = 0.5 * (end - start)
        pendulum.hold(start + half * (1.0 - math.cos(phase)), half * math.sin(phase) * math.pi / TWIST_S)

    def _let_go(self) -> None:
        pendulum, rng = self.pendulum, self._rng
        if self._twist is None:
            pendulum.hold(0.0, 0.0)
            return
        self.amplitude = self._twist[1]
        slip = 1.0 + SLIP * float(rng.standard_normal())
        free = self._free
        pendulum.set(free._replace(top=free.top * slip, bottom=free.bottom * slip))
        pendulum.hold(self.amplitude, 0.0)
        body_share = float(rng.uniform(*SWING))
        seen = 0.5 * body_share if self._faults.swing is None else self._faults.swing
        size = body_share * abs(self.amplitude) * small_angle_rate(free)
        mixture = rng.uniform(0.0, 0.5 * math.pi)
        for swing, part in zip(pendulum.swings, (math.cos(mixture), math.sin(mixture)), strict=True):
            phase = rng.uniform(0.0, 2.0 * math.pi)
            swing.rate = size * part * math.cos(phase)
            swing.angle = size * part * math.sin(phase) / swing.frequency
        self._share = seen / body_share
