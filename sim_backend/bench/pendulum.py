"""A body on two strings: the full nonlinear motion of a bifilar pendulum.

Torsion. The body turns by theta about the vertical through its centre of mass. String i hangs at the
distances a_i (top) and b_i (bottom) from that line and has the length L, so that it spans the height

    h_i(theta) = sqrt(L^2 - a_i^2 - b_i^2 + 2 a_i b_i cos(theta)),

and the centre of mass, which lies e from the middle between strings b apart, is below the frame by the mean
h = ((r + e) h_1 + (r - e) h_2) / (2 r), r = b/2. Lagrange's equation with z = -h:

    (I + m h'^2) theta'' + m h' h'' theta'^2 = m g h' - I (2 c1 theta' + c2 |theta'| theta')

The tilt of the body by h_1 != h_2 is of second order in theta and has no inertia here.

Swing. The pendulum also swings along and across the plane of its strings. Both are linear oscillators of
their own that a careless release sets going; a part of each is seen about the vertical, as uneven strings
make it.

Source: bench notes 1.1 for the effects and their sizes; the equations are derived here.
"""

import math
from typing import NamedTuple

import numpy as np

from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from sim_backend.physics.jit import kernel, outlined

SWING_DAMPING = 0.004
"""Damping ratio of both swings."""


class Hung(NamedTuple):
    """What hangs, and how.

    Attributes:
        inertia: kg m2 of all that turns (body, jig, air) about the vertical.
        mass: kg of all that hangs.
        top, bottom: m between the strings at the frame and at the body.
        length: m of each string.
        offset: m, e above; zero when the body hangs in the middle.
        damping: linear damping ratio of the torsion.
        drag: quadratic damping c2, 1/rad.
        gravity: m/s2.
    """

    inertia: float
    mass: float
    top: float
    bottom: float
    length: float
    offset: float = 0.0
    damping: float = 0.0
    drag: float = 0.0
    gravity: float = GRAVITY


Height = tuple[float, float, float]
"""(h, dh/dtheta, d2h/dtheta2) in m, m/rad, m/rad2."""


@kernel
def string_height(theta: float, top: float, bottom: float, length: float) -> Height:
    """Height that one string spans, with its derivatives; `top`, `bottom`: m from the axis."""
    product = top * bottom
    height = math.sqrt(length * length - top * top - bottom * bottom + 2.0 * product * math.cos(theta))
    slope = -product * math.sin(theta) / height
    return height, slope, -(product * math.cos(theta) + slope * slope) / height


@kernel
def hanging_height(theta: float, hung: FloatArray) -> Height:
    """Height of the centre of mass below the frame, with its derivatives; `hung`: a :class:`Hung`."""
    top, bottom, length, offset = 0.5 * hung[2], 0.5 * hung[3], hung[4], hung[5]
    near = string_height(theta, top - offset, bottom - offset, length)
    far = string_height(theta, top + offset, bottom + offset, length)
    share = 0.5 * (bottom + offset) / bottom
    rest = 1.0 - share
    return (
        share * near[0] + rest * far[0],
        share * near[1] + rest * far[1],
        share * near[2] + rest * far[2],
    )


@kernel
def acceleration(theta: float, rate: float, torque: float, hung: FloatArray) -> float:
    """theta'' in rad/s2 under a torque (N m) from outside; `hung`: a :class:`Hung`."""
    _, slope, bend = hanging_height(theta, hung)
    inertia, mass = hung[0], hung[1]
    loss = inertia * (2.0 * hung[6] + hung[7] * abs(rate)) * rate
    force = mass * slope * (hung[8] - bend * rate * rate) - loss + torque
    return force / (inertia + mass * slope * slope)


@outlined
def torsion_step(motion: FloatArray, hung: FloatArray, torque: float, dt: float) -> None:
    """Go on by `dt` (s), fourth-order Runge-Kutta, in place.

    Args:
        motion: angle, rate, acceleration, and upward acceleration of the centre of mass (rad, m, s).
        hung: a :class:`Hung`.
        torque: from outside, N m.
        dt: s.
    """
    theta, rate = motion[0], motion[1]
    half = 0.5 * dt
    a1 = acceleration(theta, rate, torque, hung)
    r2 = rate + half * a1
    a2 = acceleration(theta + half * rate, r2, torque, hung)
    r3 = rate + half * a2
    a3 = acceleration(theta + half * r2, r3, torque, hung)
    r4 = rate + dt * a3
    a4 = acceleration(theta + dt * r3, r4, torque, hung)
    theta += dt / 6.0 * (rate + 2.0 * r2 + 2.0 * r3 + r4)
    rate += dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    _, slope, bend = hanging_height(theta, hung)
    after = acceleration(theta, rate, torque, hung)
    motion[0], motion[1], motion[2] = theta, rate, after
    motion[3] = -(slope * after + bend * rate * rate)


def small_angle_rate(hung: Hung) -> float:
    """Angular frequency (rad/s) of the torsion at zero amplitude without damping."""
    _, _, bend = hanging_height(0.0, np.array(hung))
    return math.sqrt(-hung.mass * hung.gravity * bend / hung.inertia)


class SwingMode:
    """One mode of swinging, a damped linear oscillator solved exactly in steps of `dt` (s).

    Attributes:
        frequency: rad/s, undamped.
        angle, rate: rad and rad/s.
    """

    def __init__(self, frequency: float, dt: float) -> None:
        self.frequency = frequency
        self.angle = self.rate = 0.0
        decay = SWING_DAMPING * frequency
        damped = frequency * math.sqrt(1.0 - SWING_DAMPING**2)
        fade = math.exp(-decay * dt)
        c, s = fade * math.cos(damped * dt), fade * math.sin(damped * dt) / damped
        self._step = (c + decay * s, s, -frequency * frequency * s, c - decay * s)

    def step(self) -> None:
        """Go on by one step."""
        a, b, c, d = self._step
        angle, rate = self.angle, self.rate
        self.angle, self.rate = a * angle + b * rate, c * angle + d * rate


class BifilarPendulum:
    """A hung body that can be twisted; call :meth:`step` for each `dt` (s).

    Attributes:
        hung: what hangs.
        swings: along and across the plane of the strings.
    """

    def __init__(self, hung: Hung, dt: float = 0.001) -> None:
        self._dt = dt
        self._motion: FloatArray = np.zeros(4)
        self.set(hung)
        # Across the plane the body turns with its strings: a compound pendulum, slower by its own inertia.
        across = hung.length + hung.inertia / (hung.mass * hung.length)
        self.swings = (
            SwingMode(math.sqrt(hung.gravity / hung.length), dt),
            SwingMode(math.sqrt(hung.gravity / across), dt),
        )

    def set(self, hung: Hung) -> None:
        """Let it hang differently from now on."""
        self.hung = hung
        # The kernels take the linear damping as a rate, 1/s.
        self._hung = np.array(hung._replace(damping=hung.damping * small_angle_rate(hung)))

    @property
    def theta(self) -> float:
        """Angle of the torsion, rad."""
        return float(self._motion[0])

    @property
    def rate(self) -> float:
        """Rate of the torsion, rad/s."""
        return float(self._motion[1])

    @property
    def climb(self) -> float:
        """Upward acceleration of the centre of mass, m/s2."""
        return float(self._motion[3])

    def step(self, torque: float = 0.0) -> None:
        """Go on by one step under a torque (N m) from outside about the vertical."""
        torsion_step(self._motion, self._hung, torque, self._dt)
        for swing in self.swings:
            swing.step()

    def hold(self, theta: float, rate: float) -> None:
        """Be held by a hand: angle (rad) and rate (rad/s) are given, nothing swings."""
        self._motion[:] = theta, rate, 0.0, 0.0
        for swing in self.swings:
            swing.angle = swing.rate = 0.0


def across(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors that make a right-handed frame with the unit vector `axis` (3,)."""
    helper = np.zeros(3)
    helper[int(np.argmin(np.abs(axis)))] = 1.0
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)
