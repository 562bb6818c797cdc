"""Legs, ceiling and floor."""

import math
from typing import Any

import numpy as np
import pytest

from onboard.outcome import Outcome
from sim_backend.physics.outcome import classify
from sim_backend.physics.reset import approaching, resting_on_floor
from sim_backend.physics.step import step_thrust
from tests.physics.energy import mechanical_energy
from tests.physics.outcome import landing_outcome

OFF = (0.0, 0.0, 0.0, 0.0)


@pytest.mark.further
def test_a_step_that_feet_cut_loses_no_time(parameters: Any, rng: np.random.Generator) -> None:
    """Feet that come down together, apart, or grazing: every step takes a millisecond, whatever it meets."""
    cuts = 0
    for _ in range(200):
        velocity = np.array([rng.uniform(0.0, 3.0), rng.uniform(-0.5, 0.5), rng.uniform(1.5, 3.0)])
        state = approaching(parameters, np.array([0.0, 0.0, 1.95]), velocity)
        q = rng.normal(size=4)
        state["quaternion"], state["omega"] = q / np.linalg.norm(q), rng.uniform(-30.0, 30.0, 3)
        for count in range(1, 201):
            held = int(state["foot_attached"].sum())
            step_thrust(state, parameters, OFF, 1e-3)
            cuts += int(state["foot_attached"].sum() > held)
            assert state["time"] == pytest.approx(1e-3 * count, abs=1e-12)
    assert cuts > 100


def test_an_attached_swing_loses_energy(parameters: Any) -> None:
    state = _flip_landing(parameters, 1e-3, 350)
    assert landing_outcome(state) is Outcome.FOUR_LEG
    first = mechanical_energy(state, parameters)
    for _ in range(500):
        step_thrust(state, parameters, OFF, 1e-3)
    assert mechanical_energy(state, parameters) < first - 1e-3


def _flip_landing(parameters: Any, dt: float, milliseconds: int) -> Any:
    """A flip of 7 N mm at tau = 0.23 s, which lands on four legs: 2.5 m/s at 40 deg."""
    state = approaching(parameters, np.array([0.0, 0.0, 2.1 - 0.23 * 1.607]), np.array([1.915, 0.0, 1.607]))
    front = 7.0e-3 / (2.0 * float(parameters["arm_x"]))
    cut = False
    for _ in range(round(milliseconds * 1e-3 / dt)):
        q = state["quaternion"]
        cut = cut or 1.0 - 2.0 * (q[0] ** 2 + q[1] ** 2) <= 0.0
        step_thrust(state, parameters, OFF if cut else (front, 0.0, 0.0, front), dt)
    return state


def test_landing_at_1_khz_agrees_with_8_khz(parameters: Any) -> None:
    """The bounds of docs/physics.md: impact and rest of a four-leg landing."""
    coarse = _flip_landing(parameters, 1e-3, 800)
    fine = _flip_landing(parameters, 1e-3 / 8, 800)
    assert landing_outcome(coarse) is landing_outcome(fine) is Outcome.FOUR_LEG
    assert abs(coarse["impact_time"] - fine["impact_time"]) < 1.5e-3
    np.testing.assert_allclose(coarse["impact_omega"], fine["impact_omega"], atol=0.3)
    np.testing.assert_allclose(coarse["position"], fine["position"], atol=5e-3)


def test_feet_tear_off_when_pulled_harder_than_they_hold(parameters: Any) -> None:
    parameters["adhesion_strength"] = 0.02
    state = _flip_landing(parameters, 1e-3, 900)
    assert state["foot_attached"].sum() == 0
    assert landing_outcome(state) is Outcome.FAILURE
    assert state["position"][2] < 1.9


def test_feet_need_their_preload(parameters: Any) -> None:
    parameters["minimum_preload"] = 1e3
    assert _flip_landing(parameters, 1e-3, 900)["foot_attached"].sum() == 0
    parameters["minimum_preload"] = 0.05
    assert _flip_landing(parameters, 1e-3, 500)["foot_attached"].sum() > 0


def test_level_climb_into_the_ceiling_hits_with_the_propellers(parameters: Any) -> None:
    state = approaching(parameters, np.array([0.0, 0.0, 1.9]), np.array([1.0, 0.0, 2.0]))
    state["thrust"] = 0.0
    for _ in range(300):
        step_thrust(state, parameters, OFF, 1e-3)
    assert state["body_contact"] == 1
    assert state["ceiling_contact"] == 1
    gap = 2.1 - 1.9 - float(parameters["body_top_z"])
    assert state["impact_velocity"][2] == pytest.approx(math.sqrt(4.0 - 2.0 * 9.81 * gap), abs=0.02)
    assert landing_outcome(state) is Outcome.FAILURE
    assert landing_outcome(state, triggered=False) is Outcome.NO_TRIGGER


def test_tilted_disc_touches_at_its_highest_point(parameters: Any) -> None:
    """At 60 deg of nose-up tilt the front rims reach arm sin + radius sin + height cos above the origin."""
    tilt = -math.radians(60.0)
    reach = (float(parameters["arm_x"] + parameters["propeller_radius"])) * math.sin(-tilt) + float(
        parameters["propeller_height_z"]
    ) * math.cos(tilt)
    for gap, touches in ((1e-3, False), (-1e-5, True)):
        state = approaching(parameters, np.array([0.0, 0.0, 2.1 - reach - gap]), np.array([0.0, 0.0, 0.1]))
        state["quaternion"] = [0.0, math.sin(0.5 * tilt), 0.0, math.cos(0.5 * tilt)]
        state["thrust"] = 0.0
        step_thrust(state, parameters, OFF, 1e-3)
        assert bool(state["body_contact"]) is touches


def test_vehicle_stands_still_on_the_floor(parameters: Any) -> None:
    state = resting_on_floor(parameters, 1.0, -0.5, 0.7)
    np.testing.assert_allclose(state["position"][:2], [1.0, -0.5], atol=1e-6)
    np.testing.assert_allclose(state["specific_force"], [0.0, 0.0, 9.81], atol=1e-6)
    assert np.all(state["foot_mode"] == 2)
    z = float(state["position"][2])
    for _ in range(500):
        step_thrust(state, parameters, OFF, 1e-3)
    np.testing.assert_allclose(state["position"], [1.0, -0.5, z], atol=1e-6)
    # A quarter of the weight bends a hinge by a few degrees: it stands lower than on straight legs.
    straight = float(parameters["foot_radius"] - parameters["hip"][0, 2]) - float(
        parameters["leg_length"] * parameters["leg_direction"][0, 2]
    )
    assert 0.0 < straight - z < 5e-3


def test_vehicle_takes_off_and_comes_down(parameters: Any) -> None:
    state = resting_on_floor(parameters, 0.0, 0.0, 0.0)
    lift = float(parameters["mass"] * parameters["gravity"]) * 1.2 / 4.0
    for _ in range(500):
        step_thrust(state, parameters, (lift, lift, lift, lift), 1e-3)
    assert state["position"][2] > 0.2
    assert np.all(state["foot_mode"] == 0)
    for _ in range(2500):
        step_thrust(state, parameters, OFF, 1e-3)
    assert abs(state["velocity"][2]) < 0.05
    assert 0.0 < state["position"][2] < 0.15
    assert state["foot_attached"].sum() == 0


@pytest.mark.parametrize(
    ("feet", "contact", "outcome"),
    [
        (4, False, "four_leg"),
        (3, False, "four_leg"),
        (3, True, "four_leg_body_contact"),
        (2, False, "two_leg"),
        (1, True, "two_leg_body_contact"),
        (0, False, "failure"),
        (0, True, "failure"),
    ],
)
def test_outcome_classes(feet: int, contact: bool, outcome: str) -> None:
    assert classify(feet, contact).value == outcome
