"""The hinge of two axes and the hull of the independent landings are those of our physics."""

from typing import Any

import numpy as np
import pytest

from onboard.arrays import Vector
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.jit import kernel
from sim_backend.physics.legs import hinge_force
from sim_backend.physics.parameters import physics_parameters
from tests.gap.truth_landings.contact import leg_pull
from tests.gap.truth_landings.drone import Drone
from tests.gap.truth_landings.flight import numbers
from tests.gap.truth_landings.judge import VEHICLE
from tests.physics.effects.conftest import with_effects


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
