"""From the command to the thrust: gains, curve, limit, delay, lags, speed law, battery."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from sim_backend.physics.effects.motor_speed_law import speed_after
from sim_backend.physics.effects.thrust_curve import bent
from sim_backend.physics.reset import approaching, with_cold_motors
from sim_backend.physics.state import COMMAND_MEMORY
from sim_backend.physics.step import step, step_thrust
from tests.physics.effects.conftest import MakeParameters, typical

STILL = np.zeros(3)
HIGH = np.array([0.0, 0.0, 1000.0])


def fly(p: Any, commands: NDArray[np.float64], thrust: float | None = None) -> NDArray[np.float64]:
    """Thrusts (n, 4) after each step of 1 ms with `commands` (n, 4), from rest in the air."""
    state = approaching(p, HIGH, STILL)
    if thrust is not None:
        state["thrust"] = thrust
    history = np.empty_like(commands)
    for k, command in enumerate(commands):
        step_thrust(state, p, tuple(command.tolist()), 1e-3)
        history[k] = state["thrust"]
    return history


def test_a_scale_and_its_inverse_in_the_command_hover(make: MakeParameters) -> None:
    p = make({"thrust_scale": {"scale": 0.8}})
    state = approaching(p, HIGH, STILL)
    hover = float(p["mass"] * p["gravity"] / 4.0) / 0.8
    for _ in range(500):
        step_thrust(state, p, (hover, hover, hover, hover), 1e-3)
    np.testing.assert_allclose(state["position"], HIGH, atol=1e-9)


@pytest.mark.parametrize(
    ("gains", "axis", "sign"),
    [
        ((0.9, 1.0, 1.0, 0.9), 1, 1),  # weak front: nose down
        ((1.0, 1.0, 0.9, 0.9), 0, -1),  # weak left: rolls left, which is negative about b_x
        ((0.9, 1.0, 0.9, 1.0), 2, 1),  # weak counter-clockwise pair: turns counter-clockwise
    ],
)
def test_weak_motors_turn_the_body_and_their_trim_holds_it(
    make: MakeParameters, gains: tuple[float, float, float, float], axis: int, sign: int
) -> None:
    p = make({"motor_imbalance": dict(zip(("m1", "m2", "m3", "m4"), gains, strict=True))})
    hover = float(p["mass"] * p["gravity"] / 4.0)
    state = approaching(p, HIGH, STILL)
    state["thrust"] = [gain * hover for gain in gains]
    step_thrust(state, p, (hover, hover, hover, hover), 1e-3)
    arm = (p["arm_y"], p["arm_x"], p["thrust_to_torque"])[axis]
    expected = np.zeros(3)
    expected[axis] = sign * 0.2 * hover * arm / p["inertia"][axis] * 1e-3
    np.testing.assert_allclose(state["omega"], expected, rtol=1e-9, atol=1e-15)

    state = approaching(p, HIGH, STILL)
    trim = tuple(hover / gain for gain in gains)
    for _ in range(200):
        step_thrust(state, p, trim, 1e-3)
    np.testing.assert_allclose(state["omega"], 0.0, atol=1e-12)


def test_a_bent_map_agrees_at_hover_and_at_rest(make: MakeParameters) -> None:
    p = make({"thrust_curve": {"curvature": 0.1}})
    hover = float(p["hover_thrust"])
    assert bent(p, hover) == pytest.approx(hover, rel=1e-14)
    assert bent(p, 2.0 * hover) == pytest.approx(2.2 * hover, rel=1e-14)
    assert bent(p, 0.0) == 0.0
    for curvature in (-0.3, 0.3):
        p = make({"thrust_curve": {"curvature": curvature}})
        thrusts = [bent(p, f) for f in np.linspace(0.0, 0.15, 50)]
        assert np.all(np.diff(thrusts) > 0.0)


def test_a_rotor_gives_no_more_than_its_limit_and_below_it_is_untouched(make: MakeParameters) -> None:
    commands = np.full((2000, 4), 0.12)
    commands[:, 1] = 0.05
    p = make({"motor_saturation": {"thrust_limit": 0.1}})
    limited, free = fly(p, commands, 0.06), fly(make({}), commands, 0.06)
    np.testing.assert_allclose(limited[-1], [0.1, 0.05, 0.1, 0.1], rtol=1e-5)
    np.testing.assert_array_equal(limited[:, 1], free[:, 1])


def test_cold_motors_give_more_and_warm_up_in_flight(make: MakeParameters) -> None:
    loss, tau = 0.05, 3.0
    p = make({"motor_warming": {"loss": loss, "time_constant": tau}})
    hover = float(p["hover_thrust"])
    p["time_constant_up"] = p["time_constant_down"] = 1e-3  # the lag is not what is looked at
    state = with_cold_motors(approaching(p, HIGH, STILL))
    thrusts = []
    for _ in range(6000):
        step_thrust(state, p, (hover, 0.8 * hover, 1.2 * hover, hover), 1e-3)
        thrusts.append(state["thrust"] / hover)
    times = 1e-3 * np.arange(1, 6001)
    for motor, told in enumerate((1.0, 0.8, 1.2)):

        def warms(_t: float, c: NDArray[np.float64], told: float = told) -> NDArray[np.float64]:
            return (1.0 - (told * (1.0 + loss * c)) ** 2 - c) / tau

        solution = solve_ivp(warms, (0.0, 6.0), [1.0], t_eval=times, rtol=1e-9)
        expected = told * (1.0 + loss * solution.y[0])
        np.testing.assert_allclose(np.array(thrusts)[100:, motor], expected[100:], rtol=5e-5)


def test_motors_in_flight_are_warm_and_have_the_filed_thrust(make: MakeParameters) -> None:
    p = make({"motor_warming": {"loss": 0.05, "time_constant": 3.0}})
    commands = np.full((2000, 4), float(p["hover_thrust"]))
    np.testing.assert_allclose(fly(p, commands), commands, rtol=1e-12)


@pytest.mark.parametrize("steps", [1, 7, 60])
def test_a_delay_shifts_the_response_by_just_that_many_steps(make: MakeParameters, steps: int) -> None:
    rng = np.random.default_rng(steps)
    commands = rng.uniform(0.0, 0.14, (150, 4))
    start = float(make({})["hover_thrust"])
    late = fly(make({"command_delay": {"delay": steps * 1e-3}}), commands)
    prompt = fly(make({}), commands)
    np.testing.assert_array_equal(late[steps:], prompt[:-steps])
    np.testing.assert_array_equal(late[:steps], start)
    assert steps < COMMAND_MEMORY


def test_a_delay_between_steps_mixes_two_commands(make: MakeParameters) -> None:
    """A step in the command that arrives in the middle of a millisecond has half its effect there."""
    commands = np.full((40, 4), 0.1)
    commands[:10] = 0.05
    by = {
        delay: fly(make({"command_delay": {"delay": delay}}), commands, 0.05)
        for delay in (3e-3, 3.5e-3, 4e-3)
    }
    np.testing.assert_allclose(by[3.5e-3][13], 0.5 * (by[3e-3][13] + by[4e-3][13]), rtol=1e-12)
    assert by[3e-3][13, 0] > by[3.5e-3][13, 0] > by[4e-3][13, 0] == 0.05


def test_delay_and_gain_do_not_disturb_a_start_in_the_air(make: MakeParameters) -> None:
    """Before the first command arrives, the rotors keep their thrust, whatever their gain."""
    effects = {"command_delay": {"delay": 0.01}, "thrust_scale": {"scale": 0.7}}
    thrusts = fly(make(effects), np.full((20, 4), 0.1), 0.08)
    np.testing.assert_array_equal(thrusts[:10], 0.08)
    assert thrusts[10, 0] < 0.08


def test_lag_scales_both_time_constants_and_asymmetry_parts_them(make: MakeParameters) -> None:
    commands = np.tile([0.1, 0.0, 0.1, 0.0], (40, 1))
    p = make({"motor_lag": {"scale": 1.5}, "motor_lag_asymmetry": {"ratio": 4.0}})
    up, down = 0.05 * 1.5 / 2.0, 0.15 * 1.5 * 2.0
    state = approaching(p, HIGH, STILL)
    state["thrust"] = [0.0, 0.1, 0.0, 0.1]
    for command in commands:
        step_thrust(state, p, tuple(command.tolist()), 1e-3)
    rising, falling = 0.1 * (1.0 - math.exp(-0.04 / up)), 0.1 * math.exp(-0.04 / down)
    np.testing.assert_allclose(state["thrust"], [rising, falling, rising, falling], rtol=1e-12)


LAW = typical("motor_speed_law")


@pytest.mark.parametrize(
    ("start", "settled"), [(0.0, 2500.0), (300.0, 2400.0), (2400.0, 300.0), (2500.0, 0.0)]
)
def test_speed_law_against_a_general_integrator(make: MakeParameters, start: float, settled: float) -> None:
    """Steps of 0.1 s, by 1 ms, against dw/dt = a (ws - w) + b (ws^2 - w^2) solved by Runge-Kutta."""
    p = make({"motor_speed_law": LAW})
    k = float(p["thrust_per_speed2"])
    target = k * settled**2
    thrusts = fly(p, np.full((100, 4), target), k * start**2)
    a, b = (LAW["a_up"], LAW["b_up"]) if settled > start else (LAW["a_down"], LAW["b_down"])
    solution = solve_ivp(
        lambda _, w: a * (settled - w) + b * (settled**2 - w**2),
        (0.0, 0.1), [start], t_eval=np.linspace(1e-3, 0.1, 100), rtol=1e-11, atol=1e-9,
    )  # fmt: skip
    np.testing.assert_allclose(np.sqrt(thrusts[:, 2] / k), solution.y[0], rtol=1e-8, atol=1e-6)


def test_speed_law_settles_and_has_its_time_constants(make: MakeParameters) -> None:
    """Near the settled speed the time constant is 1/(a + 2 b ws): 47 ms up and 108 ms down at 2500 rad/s."""
    p = make({"motor_speed_law": LAW})
    k = float(p["thrust_per_speed2"])
    target = k * 2500.0**2
    np.testing.assert_allclose(fly(p, np.full((100, 4), target), target)[-1], target, rtol=1e-14)
    for start, a, b in ((2499.0, LAW["a_up"], LAW["b_up"]), (2501.0, LAW["a_down"], LAW["b_down"])):
        speeds = np.sqrt(fly(p, np.full((50, 4), target), k * start**2)[:, 0] / k)
        constant = -0.05 / math.log((speeds[-1] - 2500.0) / (start - 2500.0))
        assert constant == pytest.approx(1.0 / (a + 2.0 * b * 2500.0), rel=1e-3)


def test_a_stopping_rotor_stops(make: MakeParameters) -> None:
    """A falling speed never becomes a denormal number, and friction ends it."""
    assert speed_after(1e-3, 0.0, 0.5, 1.78e-3, 1e-3) < 1e-3
    p = make({"motor_speed_law": {**LAW, "a_down": 50.0}})
    assert fly(p, np.zeros((1500, 4)), 1e-9)[-1, 0] == 0.0


def test_battery_sags_by_the_extra_resistance(make: MakeParameters) -> None:
    duty = np.full(4, 0.8)
    voltages = []
    for effects in ({}, {"battery_sag": {"resistance": 0.1}}):
        p = make(effects)
        state = approaching(p, HIGH, STILL)
        step(state, p, duty, 1e-3)
        voltages.append(float(state["battery_voltage"]))
    assert voltages[0] - voltages[1] == pytest.approx(0.1 * float(state["battery_current"]), rel=1e-9)
