"""Our physics against MuJoCo's: one free flight to integrator error, landings with legs and hull.

MuJoCo's legs weigh something (10 mg each), ours do not: `test_the_difference_is_the_mass_of_the_legs` shows
what that makes. All bounds are about twice what was measured (docs/physics.md, "Against MuJoCo").
"""

from functools import cache
from typing import Any

import numpy as np
import pytest

from onboard.outcome import Outcome
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import approaching
from sim_backend.physics.step import step_thrust
from tests.physics.attempts import Attempt, History, fly_ours, fly_referee, lagged
from tests.physics.mujoco_vehicle import Referee, RefereeSettings

FOUR_LEGS = {
    "2.5 m/s 45 deg": Attempt(2.5, 45.0, 0.23, 7e-3),
    "2.0 m/s 60 deg": Attempt(2.0, 60.0, 0.23, 7e-3),
    "3.0 m/s 35 deg": Attempt(3.0, 35.0, 0.23, 7e-3),
    "crooked": Attempt(2.5, 45.0, 0.23, 7e-3, crooked=True),
}


def _parameters() -> Any:
    return physics_parameters(load_vehicle("crazyflie21-upgraded-stored"), RoomGeometry())


@cache
def _both(attempt: Attempt) -> tuple[History, History]:
    """Ours at 1 kHz, and MuJoCo with the same cut."""
    ours = fly_ours(_parameters(), attempt, 1e-3)
    return ours, fly_referee(_parameters(), attempt, ours.cut, RefereeSettings())


def _apart(a: History, b: History) -> tuple[float, float]:
    """Largest distance of the positions (m) and of the swing angles (rad)."""
    distance = float(np.linalg.norm(a.position - b.position, axis=1).max())
    return distance, float(np.abs(a.swing - b.swing).max())


def test_free_flight_is_the_same() -> None:
    """0.45 s of a powered three-axis flip with unequal motors; ours at 1 kHz has the error of its table."""
    p = _parameters()
    p["ceiling_z"] = 1e6
    schedule = [
        (0.15, (0.11, 0.02, 0.01, 0.10)),
        (0.30, (0.02, 0.12, 0.03, 0.05)),
        (1.0, (0.06, 0.1, 0.1, 0.13)),
    ]

    def target(t: float) -> tuple[float, ...]:
        return next(thrusts for end, thrusts in schedule if t < end)

    def start() -> Any:
        state = approaching(p, np.array([0.0, 0.0, 1000.0]), np.array([2.0, 0.5, 2.0]))
        state["omega"] = [2.0, -6.0, 3.0]
        return state

    def ours(dt: float) -> Any:
        state = start()
        for k in range(round(0.45 / dt)):
            step_thrust(state, p, target((k + 0.5) * dt), dt)
        return state

    dt = 1e-4
    referee = Referee(p, RefereeSettings(timestep=dt, integrator="RK4", legs=False))
    referee.place(start())
    thrust = np.array(start()["thrust"])
    for k in range(round(0.45 / dt)):
        middle = lagged(p, thrust, np.array(target((k + 0.5) * dt)), 0.5 * dt)
        referee.step(middle)
        thrust = lagged(p, middle, np.array(target((k + 0.5) * dt)), 0.5 * dt)
    for step, bounds in ((1e-3, (1.5e-6, 3e-5, 2e-5, 1.5e-4)), (1e-3 / 16, (1e-7, 5e-7, 5e-7, 2e-6))):
        state = ours(step)
        # Half the angle between two attitudes is the distance of their quaternions.
        side = np.sign(np.dot(state["quaternion"], referee.quaternion))
        errors = [
            np.linalg.norm(state["position"] - referee.position),
            np.linalg.norm(state["velocity"] - referee.velocity),
            2.0 * np.linalg.norm(side * state["quaternion"] - referee.quaternion),
            np.linalg.norm(state["omega"] - referee.omega),
        ]
        assert np.all(np.array(errors) < bounds), errors


@pytest.mark.parametrize(
    "attempt",
    [
        pytest.param(attempt, marks=pytest.mark.further if number else (), id=name)
        for number, (name, attempt) in enumerate(FOUR_LEGS.items())
    ],
)
def test_four_leg_landing_is_the_same(attempt: Attempt) -> None:
    """Impact, swing, capture and rest, at our 1 kHz."""
    ours, mujoco = _both(attempt)
    assert ours.outcome is mujoco.outcome is Outcome.FOUR_LEG
    assert abs(ours.impact_time - mujoco.impact_time) < 0.1e-3
    distance, angle = _apart(ours, mujoco)
    assert distance < 0.8e-3
    assert angle < np.radians(1.5)
    assert ours.peak_rate == pytest.approx(mujoco.peak_rate, rel=0.06)
    assert np.linalg.norm(ours.position[-1] - mujoco.position[-1]) < 0.4e-3
    for later, joule in ((0.02, 1e-3), (0.1, 2e-3), (0.4, 0.5e-3)):
        k = np.searchsorted(ours.time, ours.impact_time + later)
        assert abs(ours.energy[k] - mujoco.energy[k]) < joule


@pytest.mark.further
@pytest.mark.parametrize(
    ("attempt", "outcome"),
    [
        (Attempt(2.44, 63.0, 0.223, 8.0e-3), Outcome.TWO_LEG),
        (Attempt(3.09, 58.0, 0.222, 6.1e-3), Outcome.FOUR_LEG_BODY_CONTACT),
        (Attempt(1.55, 52.0, 0.211, 5.5e-3), Outcome.FAILURE),
    ],
    ids=["two legs", "body contact", "failure"],
)
def test_other_outcomes_are_the_same(attempt: Attempt, outcome: Outcome) -> None:
    """Until the hull touches, which MuJoCo models by a soft contact, the flights are the same."""
    ours, mujoco = _both(attempt)
    assert ours.outcome is mujoco.outcome is outcome
    if np.isfinite(ours.body_contact_time):
        assert abs(ours.body_contact_time - mujoco.body_contact_time) < 1.5e-3
    together = ours.time < min(ours.body_contact_time, mujoco.body_contact_time)
    assert np.abs(ours.position - mujoco.position)[together].max() < 0.8e-3


@pytest.mark.further
def test_the_difference_is_the_mass_of_the_legs() -> None:
    """With fine steps on our side, what is left is proportional to the mass of MuJoCo's legs."""
    attempt = FOUR_LEGS["2.5 m/s 45 deg"]
    cut = _both(attempt)[0].cut
    ours = fly_ours(_parameters(), attempt, 1e-3 / 32, cut=cut)
    light = _apart(ours, _both(attempt)[1])
    heavy = _apart(ours, fly_referee(_parameters(), attempt, cut, RefereeSettings(leg_mass=4e-5)))
    assert light[0] < 0.4e-3
    assert light[1] < np.radians(0.6)
    assert 2.5 < heavy[0] / light[0] < 5.5
    assert 2.5 < heavy[1] / light[1] < 5.5
