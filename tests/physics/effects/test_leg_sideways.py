"""A hinge of two axes: its energy, its loss, its limits, and the authors' hinge with an inclined axis."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from onboard.arrays import FloatArray, Vector
from onboard.room import RoomGeometry
from sim_backend.physics.jit import kernel
from sim_backend.physics.legs import hinge_force
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.step import step_thrust
from tests.physics.effects.conftest import Effects, with_effects
from tests.physics.effects.test_contact import attempt, hanging_on_two
from tests.physics.energy import mechanical_energy

OFF = (0.0, 0.0, 0.0, 0.0)
ROOM = RoomGeometry()
STILL = np.zeros(3)

bends = st.floats(-1.0, 1.0)
ratios = st.floats(0.0, 25.0)
legs = st.integers(0, 3)


@kernel
def called(p: Any, leg: int, u: Vector, inverse: float, d: Vector) -> Vector:
    return hinge_force(p, leg, u, inverse, d)


def force(p: Any, leg: int, u: FloatArray, d: FloatArray) -> FloatArray:
    length = float(p["leg_length"])
    return np.array(called(p, np.int64(leg), tuple(u.tolist()), 1.0 / length, tuple(d.tolist())))


def hinge(stiffness: float, damping: float = 1.0, more: Effects | None = None) -> Any:
    effects = {"leg_sideways": {"stiffness": stiffness, "damping": damping}, **(more or {})}
    return physics_parameters(with_effects(effects), ROOM)


def frame(p: Any, leg: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rod at rest, the direction across it in its plane, the normal of its plane."""
    rod = np.array(p["leg_direction"][leg])
    normal = np.array([*p["leg_sideways"][leg], 0.0])
    return rod, np.cross(normal, rod), normal


def bent(p: Any, leg: int, within: float, across: float) -> FloatArray:
    """A rod that is turned by an angle in its plane, and leans out of it by another (rad)."""
    rod, tangent, normal = frame(p, leg)
    in_plane = math.cos(within) * rod + math.sin(within) * tangent
    return np.asarray(math.cos(across) * in_plane + math.sin(across) * normal)


def test_the_normal_is_across_the_plane_of_rod_and_body_axis() -> None:
    p = hinge(2.0)
    for leg in range(4):
        rod, tangent, normal = frame(p, leg)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        assert rod @ normal == pytest.approx(0.0, abs=1e-15)
        assert np.linalg.norm(tangent) == pytest.approx(1.0)
        # Outwards stays outwards: the plane holds the hip's own direction too.
        assert np.array(p["hip"][leg, :2]) @ normal[:2] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("leg", range(4))
def test_a_small_bend_meets_each_axis_own_stiffness_and_damping(leg: int) -> None:
    p = hinge(3.0, 5.0)
    stiffness, damping, length = (
        float(p[name]) for name in ("hinge_stiffness", "hinge_damping", "leg_length")
    )
    _, tangent, normal = frame(p, leg)
    small = 1e-5
    for within, across, k, c, way in ((small, 0.0, 1.0, 1.0, tangent), (0.0, small, 3.0, 5.0, normal)):
        u = bent(p, leg, within, across)
        np.testing.assert_allclose(
            force(p, leg, u, STILL), k * stiffness * small / length * way, atol=1e-8 * stiffness / length
        )
        at_rest = bent(p, leg, 0.0, 0.0)
        np.testing.assert_allclose(
            force(p, leg, at_rest, way), c * damping / length**2 * way, atol=1e-9 * damping / length**2
        )


@given(leg=legs, within=bends, across=bends, ratio=ratios, x=bends, y=bends, z=bends)
def test_the_force_is_the_gradient_of_an_energy_that_is_never_negative(
    leg: int, within: float, across: float, ratio: float, x: float, y: float, z: float
) -> None:
    """V = K delta^2 / 2 + (ratio - 1) K beta^2 / 2 + stop, along any way."""
    p = hinge(ratio)
    length, k = float(p["leg_length"]), float(p["hinge_stiffness"])
    _, _, normal = frame(p, leg)

    def energy(foot: FloatArray) -> float:
        u = foot / np.linalg.norm(foot)
        delta = math.acos(np.clip(u @ p["leg_direction"][leg], -1.0, 1.0))
        beta = math.asin(np.clip(u @ normal, -1.0, 1.0))
        past = max(0.0, delta - float(p["hinge_limit"]))
        return (
            0.5 * k * (delta**2 + (ratio - 1.0) * beta**2) + 0.5 * float(p["hinge_limit_stiffness"]) * past**2
        )

    foot = length * bent(p, leg, within, across)
    assert energy(foot) >= -1e-15
    way = np.array([x, y, z])
    step = 1e-6
    rise = (energy(foot + step * way) - energy(foot - step * way)) / (2.0 * step)
    delta = math.acos(np.clip(bent(p, leg, within, across) @ p["leg_direction"][leg], -1.0, 1.0))
    if delta < 1e-3 or abs(delta - float(p["hinge_limit"])) < 1e-3:
        return  # acos has no derivative there that differences could follow
    # The force has no part along the rod: neither has the gradient.
    assert force(p, leg, foot / length, STILL) @ way == pytest.approx(rise, rel=1e-4, abs=1e-6 * k / length)


@given(leg=legs, within=bends, across=bends, ratio=st.floats(0.0, 10.0), x=bends, y=bends, z=bends)
def test_dampers_only_take(
    leg: int, within: float, across: float, ratio: float, x: float, y: float, z: float
) -> None:
    p = hinge(2.0, ratio)
    u, d = bent(p, leg, within, across), np.array([x, y, z])
    taken = (force(p, leg, u, d) - force(p, leg, u, STILL)) @ d
    assert taken >= -1e-12


@given(within=bends, across=bends, x=bends, y=bends, z=bends)
def test_left_and_right_are_alike(within: float, across: float, x: float, y: float, z: float) -> None:
    """Legs 1 and 4, 2 and 3 are mirror images, and so are their forces."""
    p = hinge(3.0, 4.0)
    flipped = np.array([1.0, -1.0, 1.0])
    for one, other in ((0, 3), (1, 2)):
        u, d = bent(p, one, within, across), np.array([x, y, z])
        np.testing.assert_allclose(
            force(p, other, flipped * u, flipped * d), flipped * force(p, one, u, d), rtol=1e-9, atol=1e-12
        )


def test_an_axis_inclined_by_45_deg_is_twice_as_stiff_and_twice_as_damped() -> None:
    """The authors' hinge: one axis across the leg's plane, and one in it, inclined to the leg by 45 deg.

    A foot that is moved sideways turns the leg about the second axis by more than it leans.
    """
    p = hinge(2.0)
    rod, tangent, normal = frame(p, 0)
    axis = (rod + tangent) / math.sqrt(2.0)
    turn = 1e-4
    u = Rotation.from_rotvec(turn * axis).apply(rod)
    lean = math.asin(abs(float(u @ normal)))
    assert turn / lean == pytest.approx(math.sqrt(2.0), rel=1e-6)
    work = 0.5 * float(p["hinge_stiffness"]) * turn**2
    ours = 0.5 * float(force(p, 0, u, STILL) @ (u - rod)) * float(p["leg_length"])
    assert ours == pytest.approx(work, rel=1e-3)


def test_ratios_of_one_leave_every_bit_as_it_was() -> None:
    for seed in range(20):
        assert attempt({"leg_sideways": {"stiffness": 1.0, "damping": 1.0}}, seed) == attempt({}, seed)


def swing(effects: Effects, dt: float, seconds: float) -> tuple[float, float]:
    """Energy (J) that a crooked swing on two feet loses, and its largest rise above its lowest so far (J)."""
    p = physics_parameters(with_effects(effects), ROOM)
    p["axial_damping"] = 0.0
    state = hanging_on_two(p)
    state["omega"] = [0.8, 1.0, 0.5]
    start = lowest = mechanical_energy(state, p)
    rise = 0.0
    for _ in range(round(seconds / dt)):
        step_thrust(state, p, OFF, dt)
        energy = mechanical_energy(state, p)
        lowest, rise = min(lowest, energy), max(rise, energy - lowest)
    return start - lowest, rise


def test_energy_stays_without_dampers_and_falls_faster_the_more_the_second_axis_is_damped() -> None:
    lost = {}
    for damping in (0.0, 1.0, 6.0):
        sideways = {"leg_sideways": {"stiffness": 3.0, "damping": damping}}
        lost[damping], rise = swing({**sideways, "leg_damping": {"scale": 8.0}}, 1.25e-4, 0.3)
        assert rise < 1e-6
    undamped: Effects = {"leg_damping": {"scale": 0.0}}
    without, rise = swing({"leg_sideways": {"stiffness": 3.0, "damping": 6.0}, **undamped}, 1.25e-4, 0.3)
    # What the implicit rods take is as much as of a hinge that is alike for any bending.
    assert without == pytest.approx(swing(undamped, 1.25e-4, 0.3)[0], rel=0.3)
    assert rise < 1e-9
    assert 2.0 * without < lost[0.0] < lost[1.0] < lost[6.0]


def test_what_is_stiff_sideways_leans_little_and_nearly_as_what_is_stiffer_still() -> None:
    """Towards the hinge of one axis: the lean falls as 1 / ratio under the same load."""
    leans = []
    for ratio in (1.0, 5.0, 25.0):
        p = hinge(ratio)
        _, _, normal = frame(p, 0)
        load = 0.05  # N, sideways
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            u = bent(p, 0, 0.0, middle)
            way = np.cross(np.cross(u, normal), u)
            low, high = (middle, high) if force(p, 0, u, STILL) @ way < load else (low, middle)
        leans.append(low)
    assert leans[0] / leans[1] == pytest.approx(5.0, rel=0.05)
    assert leans[1] / leans[2] == pytest.approx(5.0, rel=0.05)
