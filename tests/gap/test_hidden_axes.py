"""The hinge of two axes and the hull of the independent landings are those of our physics."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from calibration.gap.landings.outcomes.vehicles import WITHOUT
from onboard.arrays import Vector
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.jit import kernel
from sim_backend.physics.legs import hinge_force
from sim_backend.physics.parameters import physics_parameters
from tests.likely import assert_likely
from tests.physics.effects.conftest import with_effects
from tests.truth.landings.contact import leg_pull
from tests.truth.landings.drone import Drone
from tests.truth.landings.flight import numbers
from tests.truth.landings.judge import HINGES, VEHICLE, Judged, as_point, judge

PADS = dataclasses.replace(HINGES, capture=0.6)
HIDDEN = (
    PADS,
    dataclasses.replace(PADS, side_stiffness=4.0, side_damping=4.0),
    dataclasses.replace(PADS, box_half=0.055, box_top=0.03),
)
"""Damped hinges and pads with a limit: alone, with a stiff second axis, in a hull as wide as propellers."""


@kernel
def ours(p: Any, leg: int, u: Vector, inverse: float, d: Vector) -> Vector:
    return hinge_force(p, leg, u, inverse, d)


@pytest.mark.parametrize("ratios", [(1.0, 1.0), (2.0, 2.0), (0.3, 0.0), (8.0, 5.0)])
def test_a_leg_of_two_axes_pulls_as_in_the_other_program(ratios: tuple[float, float]) -> None:
    """In any bend and motion: one wrote forces in the body's frame, the other moments in the world's."""
    stiffness, damping = ratios
    effects = {"leg_sideways": {"stiffness": stiffness, "damping": damping}}
    p = physics_parameters(with_effects(effects, load_vehicle(VEHICLE)), RoomGeometry())
    drone = Drone(side_stiffness=stiffness, side_damping=damping, rod_stiffness=0.0, rod_damping=0.0)
    other = numbers(drone, 2.1)
    rng = np.random.default_rng(0)
    for _ in range(50):
        leg = int(rng.integers(0, 4))
        rest = np.array(p["leg_direction"][leg])
        r = float(p["leg_length"]) * (rest + rng.uniform(-0.6, 0.6, 3))
        hip_v, spin = rng.uniform(-2.0, 2.0, 3), rng.uniform(-20.0, 20.0, 3)
        # In a world that lies as the body does at this moment.
        theirs = leg_pull(other, np.zeros(3), hip_v, spin, r, rest, np.array([0.0, 0.0, 1.0]))
        length = float(np.linalg.norm(r))
        seen = -hip_v - np.cross(spin, r)
        u, d = tuple((r / length).tolist()), tuple(seen.tolist())
        mine = ours(p, np.int64(leg), u, 1.0 / length, d)
        np.testing.assert_allclose(mine, theirs, rtol=1e-8, atol=1e-9)


@pytest.fixture(scope="module")
def landed() -> list[Judged]:
    """Eight landings of each."""
    return judge(HIDDEN, 8, 1, 40, [WITHOUT, *(as_point(drone) for drone in HIDDEN)])


@pytest.mark.further  # as of healthy drones and pads in test_hidden_pads
def test_landings_of_another_program_end_as_often_as_ours_predict(landed: list[Judged]) -> None:
    for one in landed:
        assert one.predicted is not None
        for count, shares in zip(one.counts, one.predicted.T, strict=True):
            assert_likely(count, shares.tolist(), simulated=40)


@pytest.mark.further
def test_a_hull_that_meets_the_ceiling_changes_how_landings_end_and_a_second_axis_hardly(
    landed: list[Judged],
) -> None:
    """What docs/gap_landings_authors.md finds of the real flights, whose hull comes behind its propellers."""
    plain, axes, hull = (one.predicted for one in landed)
    assert plain is not None
    assert axes is not None
    assert hull is not None
    assert np.abs(hull - plain).max() > 0.4
    assert 0.0 < np.abs(axes - plain).max() < 0.2
