"""Rotation and Euler's equation: norm, power, momentum, order."""

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sim_backend.physics.reset import approaching
from sim_backend.physics.rigid_body import gyroscopic_torque, rotation_matrix, turn
from sim_backend.physics.step import step_thrust

rate = st.floats(-60.0, 60.0)
OFF = (0.0, 0.0, 0.0, 0.0)


@given(rate, rate, rate)
def test_gyroscopic_torque_has_no_power(wx: float, wy: float, wz: float) -> None:
    torque = gyroscopic_torque(wx, wy, wz, 27.93e-6, 30.46e-6, 47.12e-6)
    assert abs(np.dot(torque, (wx, wy, wz))) < 1e-12 * (1.0 + abs(wx * wy * wz))


@given(rate, rate, rate, st.floats(1e-4, 0.2))
def test_turn_is_the_exponential_map(wx: float, wy: float, wz: float, dt: float) -> None:
    """Against Rodrigues' formula, for small and for large angles."""
    rotation = np.array(rotation_matrix(*turn((0.0, 0.0, 0.0, 1.0), wx, wy, wz, dt))).reshape(3, 3)
    angle = float(np.linalg.norm([wx, wy, wz])) * dt
    k = np.array([[0.0, -wz, wy], [wz, 0.0, -wx], [-wy, wx, 0.0]]) * dt
    sinc = np.sinc(angle / np.pi)
    versine = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    np.testing.assert_allclose(rotation, np.eye(3) + sinc * k + versine * (k @ k), atol=2e-13)


def _tumble(parameters: Any, high: NDArray[np.float64], dt: float, duration: float) -> Any:
    state = approaching(parameters, high, np.array([1.0, -2.0, 3.0]))
    state["thrust"] = 0.0
    state["omega"] = [4.0, 21.0, -9.0]
    for _ in range(round(duration / dt)):
        step_thrust(state, parameters, OFF, dt)
    return state


def _spin(state: Any, parameters: Any) -> NDArray[np.float64]:
    """Angular momentum in the world frame."""
    rotation = np.array(rotation_matrix(*state["quaternion"])).reshape(3, 3)
    return rotation @ (parameters["inertia"] * state["omega"])


def test_free_tumble_keeps_momentum_energy_and_norm(open_sky: Any, high: NDArray[np.float64]) -> None:
    start, end = _tumble(open_sky, high, 1e-3, 0.0), _tumble(open_sky, high, 1e-3, 2.0)
    assert abs(np.linalg.norm(end["quaternion"]) - 1.0) < 1e-14
    np.testing.assert_allclose(end["velocity"], [1.0, -2.0, 3.0 - 2.0 * 9.81], atol=1e-11)
    np.testing.assert_allclose(end["position"], np.add(high, [2.0, -4.0, 6.0 - 0.5 * 9.81 * 4.0]), atol=1e-9)
    spin = _spin(start, open_sky)
    assert np.linalg.norm(_spin(end, open_sky) - spin) < 2e-4 * np.linalg.norm(spin)
    energy = [float(np.sum(open_sky["inertia"] * s["omega"] ** 2)) for s in (start, end)]
    assert abs(energy[1] / energy[0] - 1.0) < 2e-4


def test_quaternion_keeps_its_norm_over_many_steps(open_sky: Any, high: NDArray[np.float64]) -> None:
    """30,000 steps of a powered tumble, 30 s, at 40 rad/s and more."""
    state = approaching(open_sky, high, np.zeros(3))
    state["omega"] = [30.0, -25.0, 20.0]
    worst = 0.0
    for _ in range(30_000):
        step_thrust(state, open_sky, (0.101, 0.1, 0.1, 0.1), 1e-3)
        worst = max(worst, abs(float(np.dot(state["quaternion"], state["quaternion"])) - 1.0))
    assert worst < 1e-14
    assert np.all(np.isfinite(state["omega"]))


def test_free_flight_converges_with_second_order(open_sky: Any, high: NDArray[np.float64]) -> None:
    """Powered, turning flight: halving the step divides the error by four."""

    def fly(dt: float) -> NDArray[np.float64]:
        state = approaching(open_sky, high, np.array([2.0, 0.5, 2.0]))
        state["omega"] = [2.0, -6.0, 3.0]
        for _ in range(round(0.24 / dt)):
            step_thrust(state, open_sky, (0.11, 0.02, 0.01, 0.10), dt)
        return np.concatenate([state["position"], state["velocity"], state["quaternion"], state["omega"]])

    reference = fly(1e-3 / 32)
    errors = [np.linalg.norm(fly(dt) - reference) for dt in (4e-3, 2e-3, 1e-3)]
    orders = np.log2([errors[0] / errors[1], errors[1] / errors[2]])
    assert np.all((orders > 1.8) & (orders < 2.3)), orders
    assert errors[2] < 2e-4
