"""The bifilar pendulum against closed forms and energy, none of which its integration uses."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipk

from onboard.gravity import GRAVITY
from sim_backend.bench.pendulum import BifilarPendulum, Hung, across, hanging_height, small_angle_rate

JIG = Hung(inertia=30e-6, mass=0.038, top=0.06, bottom=0.06, length=0.6)
ODD = Hung(inertia=30e-6, mass=0.038, top=0.10, bottom=0.06, length=0.2, offset=0.004)


def period(hung: Hung, amplitude: float, dt: float = 0.001) -> float:
    """Time between two upward crossings of zero, interpolated."""
    pendulum = BifilarPendulum(hung, dt)
    pendulum.hold(amplitude, 0.0)
    crossings = []
    for tick in range(round(20.0 / dt)):
        before = pendulum.theta
        pendulum.step()
        if before < 0.0 <= pendulum.theta:
            crossings.append(dt * (tick - before / (pendulum.theta - before)))
    return float(np.mean(np.diff(crossings)))


def height(hung: Hung, theta: float) -> float:
    """Height of the centre of mass from the places of the four ends of the strings, in space."""
    r, e = hung.bottom / 2, hung.offset
    heights = []
    for end, anchor in ((r - e, hung.top / 2 - e), (-r - e, -hung.top / 2 - e)):
        reach = math.hypot(anchor - end * math.cos(theta), end * math.sin(theta))
        heights.append(math.sqrt(hung.length**2 - reach**2))
    return heights[0] + (heights[1] - heights[0]) * (r - e) / (2 * r)


def energy(pendulum: BifilarPendulum) -> float:
    """J of the torsion, zero at rest."""
    hung = pendulum.hung
    below, slope, _ = hanging_height(pendulum.theta, np.array(hung))
    lowest = hanging_height(0.0, np.array(hung))[0]
    kinetic = 0.5 * (hung.inertia + hung.mass * slope * slope) * pendulum.rate**2
    return float(kinetic + hung.mass * hung.gravity * (lowest - below))


@pytest.mark.parametrize("hung", [JIG, ODD])
@pytest.mark.parametrize("degrees", [10.0, 80.0])
def test_energy_is_kept_without_damping(hung: Hung, degrees: float) -> None:
    pendulum = BifilarPendulum(hung)
    pendulum.hold(math.radians(degrees), 0.0)
    start = energy(pendulum)
    assert start == pytest.approx(
        hung.mass * GRAVITY * (height(hung, 0.0) - height(hung, math.radians(degrees)))
    )
    for _ in range(20_000):
        pendulum.step()
        assert energy(pendulum) == pytest.approx(start, rel=1e-8)


@pytest.mark.parametrize("degrees", [2.0, 10.0, 25.0])
def test_period_is_that_of_a_pendulum_when_the_strings_are_long(degrees: float) -> None:
    hung = JIG._replace(length=3.0)
    amplitude = math.radians(degrees)
    t0 = math.sqrt(16 * math.pi**2 * hung.length * hung.inertia / (hung.mass * GRAVITY * hung.top**2))
    expected = t0 * 2 / math.pi * ellipk(math.sin(amplitude / 2) ** 2)
    assert period(hung, amplitude) == pytest.approx(expected, rel=2e-5)


@pytest.mark.parametrize("degrees", [5.0, 60.0])
def test_period_of_short_uneven_strings_follows_from_energy_alone(degrees: float) -> None:
    amplitude = math.radians(degrees)

    def time_per_phase(phase: float) -> float:
        theta = amplitude * math.sin(phase)
        slope = (height(ODD, theta + 1e-6) - height(ODD, theta - 1e-6)) / 2e-6
        fall = ODD.mass * GRAVITY * (height(ODD, theta) - height(ODD, amplitude))
        speed = math.sqrt(2 * fall / (ODD.inertia + ODD.mass * slope**2))
        return amplitude * math.cos(phase) / speed

    quarter = quad(time_per_phase, 0.0, math.pi / 2 - 1e-5, limit=200)[0]
    # The integrand is even about the end of the interval: the rest is its last value times the width.
    quarter += 1e-5 * time_per_phase(math.pi / 2 - 1e-3)
    assert period(ODD, amplitude) == pytest.approx(4 * quarter, rel=2e-5)


def test_offset_makes_it_slower_by_the_known_share() -> None:
    offset = JIG._replace(offset=0.004)
    ratio = small_angle_rate(offset) / small_angle_rate(JIG)
    assert ratio**2 == pytest.approx(1 - (2 * 0.004 / 0.06) ** 2, rel=1e-9)


def test_linear_and_quadratic_damping_take_their_share_of_the_amplitude() -> None:
    rate = small_angle_rate(JIG)
    linear = BifilarPendulum(JIG._replace(damping=0.005))
    square = BifilarPendulum(JIG._replace(drag=0.04))
    for pendulum in (linear, square):
        pendulum.hold(0.05, 0.0)
        crossings = 0
        while crossings < 16:  # whole half cycles: the energy falls in steps
            before = pendulum.theta
            pendulum.step()
            crossings += before * pendulum.theta < 0.0
    amplitude = [math.sqrt(2 * energy(p) / JIG.inertia) / rate for p in (linear, square)]
    seconds = 15.5 * math.pi / rate
    assert amplitude[0] == pytest.approx(0.05 * math.exp(-0.005 * rate * seconds), rel=2e-3)
    # A slow average over a cycle: dA/dt = -4/(3 pi) c A^2 w.
    assert amplitude[1] == pytest.approx(
        0.05 / (1 + 4 / (3 * math.pi) * 0.04 * 0.05 * rate * seconds), rel=2e-3
    )


def test_centre_of_mass_rises_twice_a_cycle() -> None:
    pendulum = BifilarPendulum(JIG)
    pendulum.hold(0.3, 0.0)
    heights, climbs = [], []
    for _ in range(3000):
        pendulum.step()
        heights.append(-height(JIG, pendulum.theta))
        climbs.append(pendulum.climb)
    measured = np.gradient(np.gradient(heights, 1e-3), 1e-3)
    assert np.allclose(measured[5:-5], climbs[5:-5], atol=2e-5 + 2e-3 * np.max(np.abs(climbs)))


def test_swing_keeps_its_own_time_and_dies_out() -> None:
    pendulum = BifilarPendulum(JIG)
    swing = pendulum.swings[0]
    swing.angle = 0.1
    angles = []
    for _ in range(20_000):
        pendulum.step()
        angles.append(swing.angle)
    ups = np.flatnonzero((np.array(angles[:-1]) < 0) & (np.array(angles[1:]) >= 0))
    assert np.mean(np.diff(ups)) * 1e-3 == pytest.approx(2 * math.pi * math.sqrt(0.6 / GRAVITY), rel=1e-3)
    assert max(angles[-2000:]) == pytest.approx(0.1 * math.exp(-0.004 * swing.frequency * 19.0), rel=0.02)
    assert pendulum.theta == 0.0


def test_frame_across_an_axis_is_right_handed() -> None:
    axis = np.array([0.6, -0.48, 0.64])
    frame = np.stack((axis, *across(axis)))
    assert np.allclose(frame @ frame.T, np.eye(3))
    assert np.linalg.det(frame) == pytest.approx(1.0)
