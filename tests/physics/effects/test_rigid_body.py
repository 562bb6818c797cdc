"""Masses, levers, rotors as gyroscopes, a string, legs and feet."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_backend.physics.collision import POINTS, beyond, hull_point, touches
from sim_backend.physics.effects.rotor_gyroscopic import gyroscopic_torque
from sim_backend.physics.effects.sensors import tracked_position
from sim_backend.physics.frames import to_world
from sim_backend.physics.reset import approaching
from sim_backend.physics.step import attitude, step_thrust
from tests.physics.effects.conftest import MakeParameters, typical
from tests.physics.energy import mechanical_energy

STILL = np.zeros(3)
HIGH = np.array([0.0, 0.0, 1000.0])
OFF = (0.0, 0.0, 0.0, 0.0)
SPIN = np.array([1.0, -1.0, 1.0, -1.0])


def momentum_of_rotors(state: Any, p: Any, inertia: float) -> float:
    """Angular momentum (kg m2/s) of the rotors about b_z."""
    return inertia * float(SPIN @ np.sqrt(state["thrust"] / p["thrust_per_speed2"]))


def test_gyroscopic_torque_does_no_work(make: MakeParameters) -> None:
    p = make({"rotor_gyroscopic": {"rotor_inertia": 2e-8}})
    rng = np.random.default_rng(0)
    for _ in range(50):
        spin, wx, wy = rng.normal(0.0, 1000.0), *rng.normal(0.0, 10.0, 2)
        tx, ty = gyroscopic_torque(p, float(spin), float(wx), float(wy))
        assert tx * wx + ty * wy == pytest.approx(0.0, abs=1e-15 * (abs(tx * wx) + 1.0))


@pytest.mark.parametrize("steps", [300, 3000])
def test_angular_momentum_of_body_and_rotors_stays(make: MakeParameters, steps: int) -> None:
    """0.3 s, to first order of the step: rates that a torque depends on are those before the kick.

    Diagonal pairs at different speeds give spin without a moment of thrust; no drag torque is on.
    """
    inertia = 5e-8
    p = make({"rotor_gyroscopic": {"rotor_inertia": inertia}})
    p["thrust_to_torque"] = 0.0
    state = approaching(p, HIGH, STILL)
    state["thrust"] = [0.12, 0.06, 0.12, 0.06]
    state["omega"] = [4.0, -2.0, 3.0]

    def momentum() -> NDArray[np.float64]:
        body = p["inertia"] * state["omega"]
        body[2] += momentum_of_rotors(state, p, inertia)
        return np.array(to_world(attitude(state), *body))

    before = momentum()
    for _ in range(steps):
        step_thrust(state, p, (0.12, 0.06, 0.12, 0.06), 0.3 / steps)
    error = float(np.linalg.norm(momentum() - before) / np.linalg.norm(before))
    assert error < 0.25 / steps
    assert momentum_of_rotors(state, p, inertia) > 0.1 * np.linalg.norm(before)


@pytest.mark.parametrize("law", [False, True])
@pytest.mark.parametrize("start", [0.0, 0.1])
def test_spinning_up_turns_the_body_the_other_way(make: MakeParameters, law: bool, start: float) -> None:
    """Angular momentum about b_z to rounding, also from rest, where the speed rises like a root."""
    inertia = 2e-8
    effects = {"rotor_acceleration_torque": {"rotor_inertia": inertia}}
    if law:
        effects["motor_speed_law"] = typical("motor_speed_law")
    p = make(effects)
    p["thrust_to_torque"] = 0.0
    state = approaching(p, HIGH, STILL)
    state["thrust"] = [0.0, start, 0.0, start]
    before = momentum_of_rotors(state, p, inertia)
    for _ in range(100):
        step_thrust(state, p, (0.1, 0.0, 0.1, 0.0), 1e-3)
    change = momentum_of_rotors(state, p, inertia) - before
    assert change > 5e-5
    assert p["inertia"][2] * state["omega"][2] == pytest.approx(-change, rel=1e-9)


def test_errors_of_mass_and_inertia_act_as_mass_and_inertia(make: MakeParameters) -> None:
    p = make({"mass_error": {"relative": 0.25}, "inertia_error": {"xx": 0.0, "yy": -0.2, "zz": 0.0}})
    nominal = make({})
    state = approaching(nominal, HIGH, STILL)  # thrust for the filed weight
    step_thrust(state, p, tuple(state["thrust"].tolist()), 1e-3)
    assert state["velocity"][2] == pytest.approx(-9.81e-3 * 0.2, rel=1e-9)
    state = approaching(p, HIGH, STILL)
    state["thrust"] = [0.0, 0.1, 0.1, 0.0]
    step_thrust(state, p, (0.0, 0.1, 0.1, 0.0), 1e-3)
    moment = 0.2 * float(nominal["arm_x"])
    assert state["omega"][1] == pytest.approx(moment / (0.8 * 30.46e-6) * 1e-3, rel=1e-9)


def test_an_offset_centre_of_mass_turns_a_hover(make: MakeParameters) -> None:
    """Weight ahead of the rotors' middle pulls the nose down (positive about b_y), by m g x."""
    p = make({"com_offset": {"x": 0.002, "y": 0.001}})
    state = approaching(p, HIGH, STILL)
    step_thrust(state, p, tuple(state["thrust"].tolist()), 1e-3)
    weight = float(p["mass"] * p["gravity"])
    torque = state["omega"] * p["inertia"] / 1e-3
    np.testing.assert_allclose(torque, [-weight * 0.001, weight * 0.002, 0.0], rtol=1e-3, atol=1e-9)


def test_with_an_offset_everything_keeps_its_place_from_the_middle(make: MakeParameters) -> None:
    offset = np.array([0.004, -0.003, 0.002])
    p, plain = make({"com_offset": dict(zip("xyz", offset, strict=True))}), make({})
    state = approaching(plain, HIGH, STILL)
    moved = approaching(p, HIGH + offset, STILL)
    np.testing.assert_allclose(tracked_position(moved, p), HIGH, atol=1e-12)
    np.testing.assert_allclose(HIGH + offset + p["hip"], HIGH + plain["hip"], atol=1e-12)
    rot = attitude(state)
    for index in range(POINTS):
        there = np.array(hull_point(p, rot, index, 1.0)) + offset
        np.testing.assert_allclose(there, hull_point(plain, rot, index, 1.0), atol=1e-12)


def test_an_accelerometer_beside_the_centre_of_mass_feels_the_middle_move(make: MakeParameters) -> None:
    """Its specific force is the second derivative of where the middle is, less gravity."""
    p, dt = make({"com_offset": {"x": 0.004, "y": -0.003, "z": 0.002}}), 1e-3
    state = approaching(p, HIGH, STILL)
    state["omega"] = [4.0, -3.0, 2.0]
    middle, felt, turns = [], [], []
    for _ in range(12):
        middle.append(tracked_position(state, p))
        turns.append(np.array(attitude(state)).reshape(3, 3))
        step_thrust(state, p, (0.05, 0.08, 0.1, 0.06), dt)
        felt.append(state["specific_force"].copy())
    moved = np.diff(middle, 2, axis=0) / dt**2 + [0.0, 0.0, 9.81]
    seen = np.einsum("nji,nj->ni", np.array(turns)[1:-1], moved)
    mean = 0.5 * (np.array(felt)[:-2] + np.array(felt)[1:-1])
    np.testing.assert_allclose(mean, seen, atol=0.02)
    at_centre = np.array([0.0, 0.0, float(state["thrust"].sum() / p["mass"])])
    assert np.abs(seen[-1] - at_centre).max() > 0.3


def test_the_quick_look_for_contact_knows_of_the_offset(make: MakeParameters) -> None:
    p = make({"com_offset": {"x": 0.02, "y": -0.015, "z": 0.01}}, ceiling_z=2.1)
    rng = np.random.default_rng(4)
    hits = 0
    for _ in range(400):
        state = approaching(p, np.array([0.0, 0.0, 2.1 - rng.uniform(0.0, float(p["reach"]))]), STILL)
        quaternion = rng.standard_normal(4)
        state["quaternion"] = quaternion / np.linalg.norm(quaternion)
        rot = attitude(state)
        found = any(beyond(state, p, rot, hull_point(p, rot, i, -1.0), -1.0) for i in range(POINTS))
        assert touches(state, p, rot, -1.0) == found
        hits += found
    assert 50 < hits < 350


def test_leaning_rotors_pull_sideways_with_the_same_thrust(make: MakeParameters) -> None:
    p = make({"thrust_tilt": {"x": 0.05, "y": -0.02}})
    state = approaching(p, HIGH, STILL)
    step_thrust(state, p, tuple(state["thrust"].tolist()), 1e-3)
    force = state["specific_force"]
    assert np.linalg.norm(force) == pytest.approx(9.81, rel=1e-12)
    np.testing.assert_allclose(force[:2] / force[2], [math.tan(0.05), math.tan(-0.02)], rtol=1e-12)
    # The pull acts 14 mm above the centre of mass.
    torque = state["omega"][1] * p["inertia"][1] / 1e-3
    assert torque == pytest.approx(0.014 * float(p["mass"]) * force[0], rel=1e-3)


STRING = {"x": 0.0, "y": 0.0, "z": 1000.0, "length": 1.0, "stiffness": 2.0}


def test_a_slack_string_does_nothing_and_a_taut_one_holds_the_weight(make: MakeParameters) -> None:
    p = make({"tether": {**STRING, "damping": 0.3}})
    slack = approaching(p, HIGH - [0.0, 0.0, 0.5], STILL)
    slack["thrust"] = 0.0
    step_thrust(slack, p, OFF, 1e-3)
    np.testing.assert_array_equal(slack["specific_force"], 0.0)
    state = approaching(p, HIGH - [0.0, 0.0, 1.1], STILL)
    state["thrust"] = 0.0
    for _ in range(5000):
        step_thrust(state, p, OFF, 1e-3)
    weight = float(p["mass"] * p["gravity"])
    assert 1000.0 - state["position"][2] == pytest.approx(1.0 + weight / 2.0, rel=1e-4)
    np.testing.assert_allclose(state["specific_force"], [0.0, 0.0, 9.81], atol=1e-3)


def test_a_string_gives_back_what_it_takes(make: MakeParameters) -> None:
    """Free swing on a string without damping: kinetic, potential and string energy stay together."""
    p = make({"tether": STRING})
    state = approaching(p, HIGH - [0.8, 0.0, 0.9], np.array([0.0, 0.4, 0.0]))
    state["thrust"] = 0.0

    def energy() -> float:
        stretch = float(np.linalg.norm(HIGH - state["position"])) - 1.0
        return mechanical_energy(state, p) + 0.5 * 2.0 * max(stretch, 0.0) ** 2

    before = energy()
    for _ in range(2000):
        step_thrust(state, p, OFF, 1e-3)
        assert energy() == pytest.approx(before, abs=2e-6)


def test_legs_and_feet_take_the_effects(make: MakeParameters) -> None:
    plain = make({})
    p = make(
        {
            "leg_stiffness": {"scale": 0.5},
            "leg_damping": {"scale": 3.0},
            "foot_slip": {"adhesion_strength": 0.5, "minimum_preload": 0.3},
        }
    )
    assert p["hinge_stiffness"] == 0.5 * plain["hinge_stiffness"]
    assert p["hinge_limit_stiffness"] == 0.5 * plain["hinge_limit_stiffness"]
    assert p["hinge_damping"] == 3.0 * plain["hinge_damping"]
    assert (p["adhesion_strength"], p["minimum_preload"]) == (0.5, 0.3)
    assert plain["adhesion_strength"] == math.inf
