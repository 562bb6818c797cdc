"""Rigid legs: a body held by its two front feet is a compound pendulum, through any angle.

With hinges and rods made stiff, the only motion left is the turn about the line through the feet, theta''
= -(m g d / I) sin(theta), solved exactly by elliptic functions from rest and by a quadrature with a rate.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipj, ellipk

from sim_backend.physics.reset import approaching
from sim_backend.physics.state import FootMode
from sim_backend.physics.step import step_thrust
from tests.tiers import some

OFF = (0.0, 0.0, 0.0, 0.0)
DT = 1e-3 / 32
"""s, small enough for the stiff hinges, whose force is explicit."""

PIVOT_Z = 1000.0
"""m, far from ceiling and floor."""


@dataclass
class Pendulum:
    """The vehicle on its front feet.

    Attributes:
        p: parameters with stiff, undamped legs.
        distance: m, body origin to the line through the feet.
        lean: rad, direction of a front foot from b_z towards b_x.
        frequency: rad/s, of small swings.
    """

    p: Any
    distance: float
    lean: float
    frequency: float

    def at(self, theta: float, rate: float) -> Any:
        """The state at an angle from hanging (rad; positive: swung towards +x) and its rate (rad/s)."""
        p, d = self.p, self.distance
        along = np.array([math.sin(theta), 0.0, -math.cos(theta)])
        across = np.array([math.cos(theta), 0.0, math.sin(theta)])
        pivot = np.array([0.0, 0.0, PIVOT_Z])
        state = approaching(p, pivot + d * along, rate * d * across)
        pitch = -theta - self.lean
        state["thrust"], state["omega"] = 0.0, [0.0, -rate, 0.0]
        state["quaternion"] = [0.0, math.sin(0.5 * pitch), 0.0, math.cos(0.5 * pitch)]
        half_width = abs(float(p["hip"][0, 1] + p["leg_length"] * p["leg_direction"][0, 1]))
        for leg, side in ((0, -1.0), (3, 1.0)):
            state["foot_mode"][leg], state["foot_attached"][leg] = FootMode.ATTACHED, 1
            state["foot_anchor"][leg] = [0.0, side * half_width, PIVOT_Z]
        return state

    def angle(self, state: Any) -> float:
        """Angle from hanging (rad, -pi..pi)."""
        return math.atan2(float(state["position"][0]), PIVOT_Z - float(state["position"][2]))

    def swing(self, state: Any, milliseconds: int) -> np.ndarray:
        """Angles (rad, continuous) after every millisecond; changes the state."""
        angles = np.zeros(milliseconds)
        for k in range(milliseconds):
            for _ in range(round(1e-3 / DT)):
                step_thrust(state, self.p, OFF, DT)
            angles[k] = self.angle(state)
        return np.unwrap(angles)


@pytest.fixture
def pendulum(open_sky: Any) -> Pendulum:
    p = open_sky
    p["hinge_stiffness"], p["hinge_damping"] = 60.0, 0.0
    p["axial_stiffness"], p["axial_damping"] = 4e5, 0.0
    foot = p["hip"][0] + p["leg_length"] * p["leg_direction"][0]
    distance, m, g = math.hypot(foot[0], foot[2]), float(p["mass"]), float(p["gravity"])
    inertia = float(p["inertia"][1]) + m * distance**2
    return Pendulum(p, distance, math.atan2(foot[0], foot[2]), math.sqrt(m * g * distance / inertia))


@pytest.mark.parametrize("amplitude_deg", some([3.0, 60.0, 170.0, 120.0], 2))
def test_swing_from_rest_follows_the_elliptic_solution(pendulum: Pendulum, amplitude_deg: float) -> None:
    """More than a period of the swing, every millisecond of it."""
    start = math.radians(amplitude_deg)
    modulus = math.sin(0.5 * start)
    period = 4.0 * float(ellipk(modulus**2)) / pendulum.frequency
    milliseconds = math.ceil(1.1e3 * period)
    times = 1e-3 * np.arange(1, milliseconds + 1)
    _, cn, dn, _ = ellipj(pendulum.frequency * times, modulus**2)
    exact = 2.0 * np.arcsin(modulus * cn / dn)
    found = pendulum.swing(pendulum.at(start, 0.0), milliseconds)
    assert np.abs(found - exact).max() < 4e-4 * start


@pytest.mark.parametrize("rate", [20.0, 45.0])
def test_swing_after_a_flip_takes_the_time_of_the_quadrature(pendulum: Pendulum, rate: float) -> None:
    """At the rates of a landing, from 60 deg up and over the top."""
    start = math.radians(60.0)
    angles = pendulum.swing(pendulum.at(start, rate), 180)
    fast = 2.0 * pendulum.frequency**2

    def slowness(theta: float) -> float:
        return 1.0 / math.sqrt(rate**2 + fast * (math.cos(theta) - math.cos(start)))

    assert angles[-1] > math.pi
    for k in range(9, len(angles), 10):
        expected, _ = quad(slowness, start, float(angles[k]))
        assert 1e-3 * (k + 1) == pytest.approx(expected, rel=6e-4)
