"""Forces of the air: closed forms, limits, published values, and that drag takes energy."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_backend.physics.effects.body_drag import AIR_DENSITY
from sim_backend.physics.effects.ceiling_effect import FAR, ceiling_gain, inflow_gain
from sim_backend.physics.effects.ground_effect import MOST, ground_gain
from sim_backend.physics.forces import free_flight_wrench
from sim_backend.physics.frames import to_body
from sim_backend.physics.reset import approaching
from sim_backend.physics.state import new_state
from sim_backend.physics.step import attitude, step_thrust
from tests.physics.effects.conftest import RADIUS, MakeParameters, typical
from tests.physics.energy import mechanical_energy

STILL = np.zeros(3)
HIGH = np.array([0.0, 0.0, 1000.0])
OFF = (0.0, 0.0, 0.0, 0.0)
DRAGS = ("rotor_drag", "inflow_thrust_loss", "body_drag", "rate_damping")


def wrench(state: Any, p: Any) -> NDArray[np.float64]:
    """Force and torque of free flight, body frame."""
    rot = attitude(state)
    return np.array(free_flight_wrench(state, p, rot, *to_body(rot, *state["velocity"])))


def random_state(rng: np.random.Generator) -> Any:
    state = new_state()
    quaternion = rng.standard_normal(4)
    state["quaternion"] = quaternion / np.linalg.norm(quaternion)
    state["position"] = HIGH
    state["velocity"], state["omega"] = rng.normal(0.0, 3.0, 3), rng.normal(0.0, 10.0, 3)
    state["thrust"] = rng.uniform(0.0, 0.15, 4)
    return state


def test_rotor_drag_of_a_level_flight(make: MakeParameters) -> None:
    """f = -k (sum of speeds) v at the rotors' plane: it also pitches the nose up."""
    k = 1.025e-6
    p = make({"rotor_drag": {"coefficient": k}})
    state = approaching(p, HIGH, np.array([2.0, 0.0, 0.0]))
    thrust = float(state["thrust"][0])
    speeds = 4.0 * math.sqrt(thrust / float(p["thrust_per_speed2"]))
    drag = -k * speeds * 2.0
    found = wrench(state, p)
    np.testing.assert_allclose(found, [drag, 0.0, 4.0 * thrust, 0.0, 0.014 * drag, 0.0], atol=1e-15)
    assert drag == pytest.approx(-0.0169, abs=1e-4)


def test_rotor_drag_and_inflow_damp_turns_by_the_arms(make: MakeParameters) -> None:
    k, rate = 1e-6, 3.0
    for effect, axis, lever2 in (("rotor_drag", 2, 2.0 * 0.0325**2), ("inflow_thrust_loss", 0, 0.0325**2)):
        p = make({effect: {"coefficient": k}})
        state = approaching(p, HIGH, STILL)
        state["omega"][axis] = rate
        speeds = 4.0 * math.sqrt(float(state["thrust"][0]) / float(p["thrust_per_speed2"]))
        assert wrench(state, p)[3 + axis] == pytest.approx(-k * speeds * lever2 * rate, rel=1e-9)


def test_a_climb_costs_thrust_and_a_descent_gives_some(make: MakeParameters) -> None:
    p = make({"inflow_thrust_loss": {"coefficient": 7.553e-7}})
    level = float(p["mass"] * p["gravity"])
    loss = 7.553e-7 * 4.0 * math.sqrt(level / 4.0 / float(p["thrust_per_speed2"])) * 3.0
    for climb in (3.0, -3.0):
        state = approaching(p, HIGH, np.array([0.0, 0.0, climb]))
        assert wrench(state, p)[2] == pytest.approx(level - math.copysign(loss, climb), rel=1e-12)


def test_a_rotor_in_forward_flight_meets_less_of_its_own_inflow(make: MakeParameters) -> None:
    """Glauert's v_i^2 (v_i^2 + u^2) = v_h^4, and what less inflow gives: both hold exactly."""
    inflow, speed = 1.3, 4.0
    p = make({"translational_lift": {"inflow": inflow}})
    state = approaching(p, HIGH, np.array([speed, 0.0, 0.0]))
    thrust = float(state["thrust"][0])
    hover2 = thrust / (2.0 * AIR_DENSITY * math.pi * RADIUS**2)
    y = math.sqrt(wrench(state, p)[2] / (4.0 * thrust))
    induced2 = ((1.0 + inflow - y * y) / (inflow * y)) ** 2 * hover2
    assert induced2 * (induced2 + speed**2) == pytest.approx(hover2**2, rel=1e-9)
    assert 1.05 < y * y < 1.2


def test_translational_lift_is_bounded_and_needs_a_turning_rotor(make: MakeParameters) -> None:
    p = make({"translational_lift": {"inflow": 1.3}})
    state = approaching(p, HIGH, np.array([1e4, 0.0, 0.0]))
    assert wrench(state, p)[2] == pytest.approx(2.3 * 4.0 * float(state["thrust"][0]), rel=1e-2)
    state["thrust"] = 0.0
    assert wrench(state, p)[2] == 0.0


def test_a_falling_body_ends_at_its_terminal_velocity(make: MakeParameters) -> None:
    area = 0.004
    p = make({"body_drag": {"area_x": 0.0, "area_y": 0.0, "area_z": area}})
    state = approaching(p, np.array([0.0, 0.0, 1e5]), STILL)
    state["thrust"] = 0.0
    for _ in range(8000):
        step_thrust(state, p, OFF, 1e-3)
    terminal = math.sqrt(2.0 * float(p["mass"] * p["gravity"]) / (AIR_DENSITY * area))
    assert -state["velocity"][2] == pytest.approx(terminal, rel=1e-4)


def test_drag_takes_power_in_any_motion(make: MakeParameters) -> None:
    """Power of what the effects add to force and torque, for 300 random motions with running rotors."""
    p = make({name: typical(name) for name in DRAGS})
    plain = make({})
    rng = np.random.default_rng(1)
    for _ in range(300):
        state = random_state(rng)
        added = wrench(state, p) - wrench(state, plain)
        velocity = to_body(attitude(state), *state["velocity"])
        assert added[:3] @ velocity + added[3:] @ state["omega"] < 0.0


def test_a_tumbling_body_without_power_only_loses_energy(make: MakeParameters) -> None:
    p = make({name: typical(name) for name in (*DRAGS, "rotor_gyroscopic")})
    rng = np.random.default_rng(2)
    for _ in range(5):
        state = random_state(rng)
        state["thrust"] = 0.0
        energy = mechanical_energy(state, p)
        for _ in range(300):
            step_thrust(state, p, OFF, 1e-3)
            now = mechanical_energy(state, p)
            assert now < energy + 1e-12 * abs(energy)
            energy = now


def test_only_the_velocity_through_the_air_counts(make: MakeParameters) -> None:
    """A vehicle that drifts with the wind feels no air; one at rest feels the wind from the other side."""
    forces = {name: typical(name) for name in (*DRAGS, "velocity_moment")}
    wind = {"x": 1.0, "y": -2.0, "z": 0.5}
    still, windy = make(forces), make({**forces, "wind": wind})
    velocity = np.array(list(wind.values()))
    rng = np.random.default_rng(3)
    for _ in range(20):
        state = random_state(rng)
        base = wrench(state, still)
        state["velocity"] += velocity
        np.testing.assert_allclose(wrench(state, windy), base, atol=1e-14)


def test_linear_drag_feels_the_wind_too(make: MakeParameters) -> None:
    p = make({"wind": {"x": 2.0}})
    p["drag"] = [0.01, 0.01, 0.01]
    state = approaching(p, HIGH, STILL)
    np.testing.assert_allclose(wrench(state, p)[:3], [0.02, 0.0, 4.0 * state["thrust"][0]], rtol=1e-12)


def test_the_edge_that_goes_first_rises(make: MakeParameters) -> None:
    p = make({"velocity_moment": {"roll": 2e-4, "pitch": 1e-4}})
    state = approaching(p, HIGH, np.array([3.0, 2.0, 0.0]))
    # Forward lifts the nose (negative about b_y); to the left lifts the left (positive about b_x).
    np.testing.assert_allclose(wrench(state, p)[3:], [4e-4, -3e-4, 0.0], atol=1e-16)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rate_damping_decays_exponentially(make: MakeParameters, axis: int) -> None:
    damping = 2e-5
    p = make({"rate_damping": {"xyz"[axis]: damping}})
    state = approaching(p, HIGH, STILL)
    state["omega"][axis] = 5.0
    for _ in range(200):
        step_thrust(state, p, tuple(state["thrust"].tolist()), 1e-3)
    decay = math.exp(-damping / float(p["inertia"][axis]) * 0.2)
    assert state["omega"][axis] == pytest.approx(5.0 * decay, rel=1e-4)
    others = np.delete(state["omega"], axis)
    np.testing.assert_array_equal(others, 0.0)


def published_gamma(gap: float, opening: float = 1.0) -> float:
    """Ceiling coefficient of Hsiao and Chirarattananon 2019."""
    return 0.5 + 0.5 * math.sqrt(1.0 + RADIUS**2 / (8.0 * (opening * gap) ** 2))


def test_ceiling_gain_follows_the_published_coefficient(make: MakeParameters) -> None:
    """At a quarter radius gamma is (1 + sqrt 3)/2 = 1.366; the gain solves y^2 + (s/gamma) y = 1 + s."""
    assert published_gamma(0.25 * RADIUS) == pytest.approx(0.5 + 0.5 * math.sqrt(3.0), rel=1e-12)
    for inflow in (0.3, 1.0, 3.0):
        for opening in (1.0, 0.5):
            p = make({"ceiling_effect": {"inflow": inflow, "opening": opening}})
            for gap in RADIUS * np.geomspace(0.05, 100.0, 40):
                y = math.sqrt(ceiling_gain(p, float(gap), 1.0))
                gamma = published_gamma(float(gap), opening)
                assert y * y + inflow / gamma * y == pytest.approx(1.0 + inflow, rel=1e-11)


def test_ceiling_gain_from_far_to_contact(make: MakeParameters) -> None:
    p = make({"ceiling_effect": {"inflow": 1.0}})
    assert ceiling_gain(p, 0.0, 1.0) == pytest.approx(2.0)
    assert ceiling_gain(p, -0.01, 1.0) == pytest.approx(2.0)
    assert ceiling_gain(p, 10.0, 1.0) == pytest.approx(1.0, abs=1e-6)
    gains = [ceiling_gain(p, float(gap), 1.0) for gap in RADIUS * np.geomspace(0.01, 50.0, 200)]
    assert np.all(np.diff(gains) < 0.0)
    # half way between the tilts, half the gain; none for a rotor that faces down
    assert ceiling_gain(p, RADIUS, 0.5) - 1.0 == pytest.approx(0.5 * (ceiling_gain(p, RADIUS, 1.0) - 1.0))
    assert ceiling_gain(p, RADIUS, -0.5) == 1.0


def test_the_series_of_the_ceiling_gain_meets_the_closed_form(make: MakeParameters) -> None:
    for inflow in (0.1, 1.0, 4.0):
        p = make({"ceiling_effect": {"inflow": inflow}})
        for share in FAR * np.array([0.01, 0.5, 0.999999]):
            gap = math.sqrt(float(p["ceiling_reach2"]) / float(share))
            closed = inflow_gain(inflow, float(p["ceiling_reach2"]), gap)
            assert ceiling_gain(p, gap, 1.0) == pytest.approx(closed, abs=1e-11)


def test_a_tilted_vehicle_is_turned_further_into_the_ceiling(make: MakeParameters) -> None:
    """The side that is nearer is pulled up more: nose up stays nose up (negative about b_y)."""
    p = make({"ceiling_effect": {"inflow": 1.0}}, ceiling_z=2.1)
    state = approaching(p, np.array([0.0, 0.0, 2.05]), STILL)
    assert wrench(state, p)[4] == pytest.approx(0.0, abs=1e-16)
    gain = ceiling_gain(p, 2.1 - 2.05 - 0.014, 1.0)
    assert gain > 1.005
    assert wrench(state, p)[2] == pytest.approx(gain * float(state["thrust"].sum()), rel=1e-9)
    tilt = math.radians(-10.0)
    state["quaternion"] = [0.0, math.sin(0.5 * tilt), 0.0, math.cos(0.5 * tilt)]
    assert wrench(state, p)[4] < -1e-6


def test_ground_gain_of_cheeseman_and_bennett(make: MakeParameters) -> None:
    """One radius above the ground: 1/(1 - 1/16) = 1.067."""
    p = make({"ground_effect": {"strength": 1.0}})
    assert ground_gain(p, RADIUS, 1.0) == pytest.approx(16.0 / 15.0, rel=1e-12)
    assert ground_gain(p, 10.0, 1.0) == pytest.approx(1.0, abs=1e-6)
    assert ground_gain(p, RADIUS, -1.0) == 1.0
    for height in (0.0, -0.01, 0.001):
        assert ground_gain(p, height, 1.0) == pytest.approx(MOST)
    gains = [ground_gain(p, float(h), 1.0) for h in RADIUS * np.geomspace(0.1, 50.0, 100)]
    assert np.all(np.diff(gains) <= 0.0)


def test_a_vehicle_near_the_floor_needs_less_thrust(make: MakeParameters) -> None:
    p = make({"ground_effect": {"strength": 1.0}})
    state = approaching(p, np.array([0.0, 0.0, RADIUS - 0.014]), STILL)
    assert wrench(state, p)[2] == pytest.approx(4.0 * float(state["thrust"][0]) * 16.0 / 15.0, rel=1e-9)
