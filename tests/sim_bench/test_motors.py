"""Motors of the bench against an ODE solver and the vehicle's own map."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from onboard.battery import thrust_from_voltage
from onboard.vehicle import Vehicle
from sim_backend.bench.errors import BenchInputError
from sim_backend.bench.motors import BenchMotors, motor_law
from tests.sim_bench.benches import Stand, vehicle, vehicle_with_speed_law

MAP = vehicle().motors.thrust_map_compiled()
K = 2.2e-8


def settled(volts: float) -> float:
    return float(np.sqrt(thrust_from_voltage(MAP, volts) / K))


def run(motors: BenchMotors, volts: float, seconds: float) -> None:
    for _ in range(round(seconds * 1000)):
        motors.step(np.ones(4), volts, 0.001)


def exact(made: Vehicle) -> BenchMotors:
    """Motors without spread."""
    motors = BenchMotors(made, np.random.default_rng(0))
    motors.each[:] = 1.0
    return motors


def test_speed_law_follows_its_differential_equation() -> None:
    motors = exact(vehicle_with_speed_law())
    for start, end, a, b in ((0.0, 3.0, 0.0, 4.24e-3), (3.0, 1.0, 0.5, 1.78e-3)):
        before = motors.speed[0]
        assert before == pytest.approx(settled(start), abs=1.0)
        goal = settled(end)
        ode = solve_ivp(
            lambda _t, w, a=a, b=b, goal=goal: a * (goal - w) + b * (goal**2 - w**2),
            (0.0, 0.1), [before], rtol=1e-10, atol=1e-8,
        )  # fmt: skip
        run(motors, end, 0.1)
        assert motors.speed == pytest.approx(np.full(4, ode.y[0, -1]), rel=1e-6)
        run(motors, end, 30.0)
        assert motors.speed == pytest.approx(np.full(4, goal), rel=1e-4)


def test_without_a_law_the_thrust_is_first_order() -> None:
    motors = exact(vehicle())
    goal = thrust_from_voltage(MAP, 3.0)
    run(motors, 3.0, 0.05)
    assert motors.thrust == pytest.approx(4 * goal * (1 - np.exp(-1.0)), rel=1e-6)
    run(motors, 3.0, 2.0)
    run(motors, 0.0, 0.15)
    assert motors.thrust == pytest.approx(4 * goal * np.exp(-1.0), rel=1e-6)
    run(motors, 0.0, 10.0)
    assert not motors.speed.any()


def test_motors_differ_around_the_vehicle() -> None:
    spreads = np.array([BenchMotors(vehicle(), np.random.default_rng(seed)).each for seed in range(200)])
    assert spreads.mean(axis=2) == pytest.approx(np.ones((200, 2)), abs=1e-12)
    assert 0.01 < spreads[:, 0].std() < 0.03
    assert 0.005 < spreads[:, 1].std() < 0.02


def test_duty_is_eight_bits_of_the_boards_voltage() -> None:
    stand = Stand()
    stand.bench.motors.each[:] = 1.0
    stand.say(do="mount_on_scale")
    stand.supply("VOLT 4.0", "CURR 8", "OUTP ON")
    stand.bench.run(1.0)
    stand.command(*(4 * [41 * 256 + 255]))
    stand.bench.run(2.0)
    volts = 41 / 256 * stand.bench.board_voltage
    assert stand.bench.motors.thrust == pytest.approx(4 * thrust_from_voltage(MAP, volts), rel=1e-3)


def test_missing_propeller_takes_a_quarter() -> None:
    whole, lacking = (BenchMotors(vehicle(), np.random.default_rng(3), missing=m) for m in (0, 2))
    for motors in (whole, lacking):
        run(motors, 3.0, 2.0)
    assert lacking.speed[1] == 0.0
    assert lacking.thrust == pytest.approx(whole.thrust * (1 - whole.each[0, 1] / 4), rel=1e-6)


def test_vehicle_without_a_thrust_coefficient_is_refused() -> None:
    motors = dataclasses.replace(vehicle().motors, thrust_coefficient=None)
    with pytest.raises(BenchInputError, match="thrust_coefficient"):
        motor_law(dataclasses.replace(vehicle(), motors=motors))
