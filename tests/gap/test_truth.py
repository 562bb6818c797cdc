"""The physics of the hidden flights, by conservation laws, by numbers worked out by hand from the vehicle
file, and against the simulation, with which it shares nothing."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Effect, load_vehicle
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import charged
from sim_backend.physics.state import new_state
from sim_backend.physics.step import step
from tests.truth.hidden_effects.body import derivative, runge_kutta
from tests.truth.hidden_effects.cases import hide
from tests.truth.hidden_effects.effects import apply, draw
from tests.truth.hidden_effects.flight import hidden_flight
from tests.truth.hidden_effects.layout import GRAVITY, MOTORS, STATES, nominal
from tests.truth.hidden_effects.rotors import settled_thrusts, terminal_voltage

VEHICLE = "crazyflie21-stock"
WEIGHT = 0.030 * GRAVITY
HOVER = WEIGHT / 4
ALOFT = slice(2500, 14700)
"""Control ticks in which the manoeuvre is flown."""
ALOFT_ROWS = slice(500, 2940)


@pytest.fixture(scope="module")
def vehicle() -> np.ndarray:
    return nominal(VEHICLE)


def with_effect(vehicle: np.ndarray, name: str, **values: float) -> np.ndarray:
    p = vehicle.copy()
    apply(p, name, values)
    return p


def a_state(**given: list[float] | float) -> np.ndarray:
    """In the air at 1 m, level, at rest, every rotor at the hover thrust, unless `given` otherwise."""
    y = np.zeros(STATES)
    y[2], y[9], y[MOTORS] = 1.0, 1.0, HOVER
    for key, place in {
        "position": slice(0, 3),
        "velocity": slice(3, 6),
        "attitude": slice(6, 10),
        "rate": slice(10, 13),
        "thrust": MOTORS,
    }.items():
        if key in given:
            y[place] = given[key]
    return y


def change(p: np.ndarray, y: np.ndarray, duty: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Derivative of the state without disturbances, and the specific force (body)."""
    dy, scratch = np.zeros(STATES), np.zeros((8, 3))
    derivative(p, 0.0, y, np.full(4, duty), np.zeros(6), dy, scratch)
    return dy, scratch[3].copy()


def advance(p: np.ndarray, y: np.ndarray, duty: np.ndarray, span: float, step: float) -> np.ndarray:
    y, work, scratch = y.copy(), np.zeros((5, STATES)), np.zeros((8, 3))
    for k in range(round(span / step)):
        runge_kutta(p, k * step, y, duty, np.zeros(6), step, work, scratch)
    return y


# --- physics ------------------------------------------------------------------------------------------------


def test_a_throw_without_thrust_keeps_energy_and_angular_momentum(vehicle: np.ndarray) -> None:
    p = vehicle.copy()
    p["ceiling"] = np.inf
    start = a_state(
        position=[0, 0, 30.0], velocity=[1.0, -2.0, 3.0], rate=[9.0, -4.0, 7.0], thrust=[0.0, 0.0, 0.0, 0.0]
    )
    end = advance(p, start, np.zeros(4), 1.0, 0.0005)

    def energy(y: np.ndarray) -> float:
        turning = 0.5 * np.dot(p["inertia"], y[10:13] ** 2)
        return float(0.5 * p["mass"] * np.dot(y[3:6], y[3:6]) + p["mass"] * GRAVITY * y[2] + turning)

    def momentum(y: np.ndarray) -> np.ndarray:
        return np.asarray(Rotation.from_quat(y[6:10]).as_matrix() @ (p["inertia"] * y[10:13]))

    assert energy(end) == pytest.approx(energy(start), rel=1e-10)
    assert momentum(end) == pytest.approx(momentum(start), rel=1e-7, abs=1e-13)
    assert end[2] == pytest.approx(30.0 + 3.0 - 0.5 * GRAVITY, abs=1e-10)
    assert not np.allclose(end[10:13], start[10:13], rtol=0.1)  # it did tumble


def test_the_integrator_is_of_fourth_order(vehicle: np.ndarray) -> None:
    p = vehicle.copy()
    apply(p, "rotor_drag", {"coefficient": 2e-6})
    apply(p, "body_drag", {"area_x": 0.01, "area_y": 0.02, "area_z": 0.03})
    apply(p, "ceiling_effect", {"inflow": 1.0, "opening": 0.3})
    apply(p, "rotor_gyroscopic", {"rotor_inertia": 1e-7})
    start = a_state(
        position=[0, 0, 1.7],
        velocity=[1.0, -0.5, 0.4],
        rate=[3.0, -2.0, 5.0],
        thrust=[0.03, 0.03, 0.03, 0.03],
    )
    duty = np.array([0.68, 0.71, 0.66, 0.69])  # all rotors rise all the time: nothing switches
    best = advance(p, start, duty, 0.32, 0.00025)
    coarse, fine = (np.abs(advance(p, start, duty, 0.32, h) - best)[:13].max() for h in (0.016, 0.008))
    assert coarse / fine == pytest.approx(16.0, rel=0.2)
    assert np.abs(advance(p, start, duty, 0.32, 0.0005) - best)[:13].max() < 1e-9


def test_hover_is_where_the_vehicle_file_says(vehicle: np.ndarray) -> None:
    """7.5 gf a motor, upper row of the table 'paper-stock': 2.097 V2 - 4.464 V + 5.636 = 7.5."""
    gram_force = 9.80665e-3
    grams = HOVER / gram_force
    volts = (4.464 + math.sqrt(4.464**2 + 4 * 2.097 * (grams - 5.636))) / (2 * 2.097)
    y = a_state()
    battery = terminal_voltage(vehicle, y)
    assert battery == pytest.approx(4.12 - 0.17 * 6.9 * WEIGHT, abs=1e-12)
    dy, felt = change(vehicle, y, duty=volts / battery)
    assert dy[:17] == pytest.approx(np.zeros(17), abs=1e-9)
    assert felt == pytest.approx([0.0, 0.0, GRAVITY], abs=1e-12)
    log = hidden_flight(vehicle, "a", "hover", 7, 0).log[
        600:900
    ]  # and so it is flown, up to the thrust scale of that flight (0.5 %)
    assert np.mean(log[:, 13:17] / 65535 * log[:, 17:]) == pytest.approx(volts, rel=0.01)


def test_torques_turn_the_way_of_the_contract(vehicle: np.ndarray) -> None:
    f = HOVER + np.array([0.001, -0.002, 0.004, -0.0005])
    dy, _ = change(vehicle, a_state(thrust=f.tolist()))
    torque = dy[10:13] * vehicle["inertia"]
    arm, drag = 0.0325, 0.0073508629
    assert torque == pytest.approx(
        [
            arm * (f[2] + f[3] - f[0] - f[1]),
            arm * (f[1] + f[2] - f[0] - f[3]),
            drag * (f[1] + f[3] - f[0] - f[2]),
        ]
    )


def test_a_thrust_map_of_any_vehicle_is_inverted_by_its_controller() -> None:
    for name in ("crazyflie21-stock", "crazyflie21-upgraded-stored", "crazyflie21plus"):
        p = nominal(name)
        thrust = np.linspace(0.01, float(p["thrust_ceiling"]), 50)
        volts = np.interp(thrust / p["inverse_step"], np.arange(p["inverse"].size), p["inverse"])
        rows = np.column_stack([np.full((50, 4), 65535.0), volts])
        assert settled_thrusts(p, rows)[:, 0] == pytest.approx(thrust, rel=2e-3)
        flight = hidden_flight(p, "hover", "hover", 1, 0)
        assert np.abs(flight.states[ALOFT, :3] - flight.setpoints[ALOFT, :3]).max() < 0.1


# --- effects ------------------------------------------------------------------------------------------------

SPEED = math.sqrt(HOVER / 2.2e-8)
VELOCITY, RATE = np.array([1.2, -0.7, 0.5]), np.array([0.8, -1.1, 0.6])
MASS, INERTIA = 0.030, np.array([12.19e-6, 14.55e-6, 23.55e-6])

WRENCHES: dict[str, tuple[dict[str, float], Callable[[], tuple[list[float], list[float]]]]] = {
    # Force (N) and torque (N m) that the effect adds to a level vehicle at hover thrust and VELOCITY.
    "rotor_drag": (
        {"coefficient": 2e-6},
        lambda: (
            [-4 * 2e-6 * SPEED * 1.2, 4 * 2e-6 * SPEED * 0.7, 0.0],
            [-0.014 * 4 * 2e-6 * SPEED * 0.7, -0.014 * 4 * 2e-6 * SPEED * 1.2, 0.0],
        ),
    ),
    "body_drag": (
        {"area_x": 0.01, "area_y": 0.02, "area_z": 0.03},
        lambda: (
            (-0.6 * np.linalg.norm(VELOCITY) * np.array([0.01, 0.02, 0.03]) * VELOCITY).tolist(),
            [0, 0, 0],
        ),
    ),
    "inflow_thrust_loss": ({"coefficient": 1e-6}, lambda: ([0, 0, -4e-6 * SPEED * 0.5], [0, 0, 0])),
    "velocity_moment": ({"roll": 1e-4, "pitch": 2e-4}, lambda: ([0, 0, 0], [1e-4 * -0.7, -2e-4 * 1.2, 0])),
    "thrust_tilt": (
        {"x": 0.03, "y": 0.0},
        lambda: (
            [WEIGHT * math.sin(0.03), 0, WEIGHT * (math.cos(0.03) - 1)],
            [0, 0.014 * WEIGHT * math.sin(0.03), 0],
        ),
    ),
    "com_offset": (
        {"x": 0.002, "y": -0.001, "z": 0.0},
        lambda: ([0, 0, 0], [0.001 * WEIGHT, 0.002 * WEIGHT, 0]),
    ),
    "tether": (
        {"x": 0.0, "y": 3.0, "z": 1.0, "length": 2.0, "stiffness": 0.1, "damping": 0.02},
        lambda: ([0, 0.1 * 1.0 + 0.02 * 0.7, 0], [0, 0, 0]),
    ),
}


@pytest.mark.parametrize("name", WRENCHES)
def test_what_an_effect_adds_to_force_and_torque(name: str, vehicle: np.ndarray) -> None:
    values, expected = WRENCHES[name]
    y = a_state(velocity=VELOCITY.tolist())
    changed = with_effect(vehicle, name, **values)
    dy, felt = change(changed, y)
    before, felt_before = change(vehicle, y)
    force, torque = expected()
    assert MASS * (felt - felt_before) == pytest.approx(force, rel=1e-9, abs=1e-12)
    assert INERTIA * (dy[10:13] - before[10:13]) == pytest.approx(torque, rel=1e-9, abs=1e-12)


def test_rate_damping_and_gyroscopic_torque(vehicle: np.ndarray) -> None:
    y = a_state(rate=RATE.tolist(), thrust=[1.2 * HOVER, HOVER, 1.2 * HOVER, HOVER])
    before, _ = change(vehicle, y)
    damped, _ = change(with_effect(vehicle, "rate_damping", x=1e-5, y=2e-5, z=3e-5), y)
    assert INERTIA * (damped - before)[10:13] == pytest.approx(-np.array([1e-5, 2e-5, 3e-5]) * RATE)
    turned, _ = change(with_effect(vehicle, "rotor_gyroscopic", rotor_inertia=1e-7), y)
    momentum = np.array([0.0, 0.0, 1e-7 * 2 * SPEED * (math.sqrt(1.2) - 1.0)])
    assert INERTIA * (turned - before)[10:13] == pytest.approx(-np.cross(RATE, momentum), rel=1e-6)


def test_rotors_that_speed_up_keep_the_angular_momentum(vehicle: np.ndarray) -> None:
    """Without drag torque, body and rotors together may not start to turn."""
    p = with_effect(vehicle, "rotor_acceleration_torque", rotor_inertia=2e-7)
    p["drag_torque"] = 0.0
    start = a_state(thrust=[0.05, 0.06, 0.05, 0.06])
    end = advance(p, start, np.array([0.75, 0.55, 0.75, 0.55]), 0.1, 0.0005)

    def rotors(y: np.ndarray) -> float:
        return float(np.dot([1, -1, 1, -1], np.sqrt(y[MOTORS] / 2.2e-8)))

    gained = 2e-7 * (rotors(end) - rotors(start))
    assert abs(gained) > 1e-5
    assert INERTIA[2] * end[12] == pytest.approx(-gained, rel=1e-6)


def test_mass_and_inertia_answer_as_newton_says(vehicle: np.ndarray) -> None:
    y = a_state(thrust=[0.08, 0.07, 0.075, 0.06])
    before, felt = change(vehicle, y)
    heavy, felt_heavy = change(with_effect(vehicle, "mass_error", relative=0.25), y)
    assert felt_heavy == pytest.approx(felt / 1.25)
    assert heavy[10:13] == pytest.approx(before[10:13])
    slow, _ = change(with_effect(vehicle, "inertia_error", xx=0.1, yy=0.2, zz=-0.3), y)
    assert slow[10:13] == pytest.approx(before[10:13] / np.array([1.1, 1.2, 0.7]))


def test_wind_is_felt_as_motion_the_other_way(vehicle: np.ndarray) -> None:
    p = with_effect(vehicle, "rotor_drag", coefficient=2e-6)
    windy = with_effect(p, "wind", x=-1.2, y=0.7, z=0.0)
    assert change(windy, a_state())[1] == pytest.approx(change(p, a_state(velocity=[1.2, -0.7, 0.0]))[1])


def test_surfaces_lift(vehicle: np.ndarray) -> None:
    """Ceiling: thrust by momentum theory with the swallowed inflow; floor: Cheeseman and Bennett."""
    gap = 0.04
    near = with_effect(vehicle, "ceiling_effect", inflow=1.5, opening=0.4)
    _, felt = change(near, a_state(position=[0, 0, 2.1 - 0.014 - gap]))
    ratio = felt[2] / GRAVITY
    gamma = 0.5 + 0.5 * math.sqrt(1 + 0.0225**2 / (8 * 0.4**2 * gap**2))
    assert ratio > 1.02
    assert ratio + 1.5 / gamma * math.sqrt(ratio) == pytest.approx(2.5)  # T/T0 = 1 + inflow (1 - v/v0)
    low = with_effect(vehicle, "ground_effect", strength=5.0)
    _, felt = change(low, a_state(position=[0, 0, 0.06 - 0.014]))
    assert GRAVITY / felt[2] == pytest.approx(1 - 5.0 * (0.0225 / 0.24) ** 2)
    tilt = [math.sin(0.4), 0.0, 0.0, math.cos(0.4)]
    dy, _ = change(near, a_state(position=[0, 0, 2.03], attitude=tilt))
    assert dy[10] > 0.5  # the left side is higher, nearer to the ceiling: further into the tilt


@pytest.mark.parametrize(
    ("name", "values", "up", "down"),
    [
        ("motor_lag", {"scale": 1.4}, 1.4 * 0.065, 1.4 * 0.15),
        ("motor_lag_asymmetry", {"ratio": 1.6}, 0.065 / math.sqrt(1.6), 0.15 * math.sqrt(1.6)),
    ],
)
def test_lag(name: str, values: dict[str, float], up: float, down: float, vehicle: np.ndarray) -> None:
    p = with_effect(vehicle, name, **values)
    p["ohms"] = 0.0  # else the target falls while the thrust rises
    p["volts_per_coulomb"] = 0.0
    duty = 2.6 / 4.12
    goal = 9.80665e-3 * (2.097 * 2.6**2 - 4.464 * 2.6 + 5.636)
    step = 0.0005
    for start, tau in ((goal - 0.03, up), (goal + 0.03, down)):
        span = round(tau / step) * step
        end = advance(p, a_state(thrust=[start] * 4), np.full(4, duty), span, step)
        assert (end[13] - goal) / (start - goal) == pytest.approx(math.exp(-span / tau), rel=1e-6)


def test_gains_curve_and_limit(vehicle: np.ndarray) -> None:
    """Rate of the thrust from rest shows what the motor heads for."""
    y = a_state(thrust=[0.0, 0.0, 0.0, 0.0])

    def heads_for(p: np.ndarray, duty: float) -> np.ndarray:
        return np.asarray(change(p, y, duty)[0][MOTORS] * 0.065)

    plain = heads_for(vehicle, 0.7)
    assert heads_for(with_effect(vehicle, "thrust_scale", scale=0.9), 0.7) == pytest.approx(0.9 * plain)
    uneven = with_effect(vehicle, "motor_imbalance", m1=1.0, m2=0.95, m3=1.0, m4=1.1)
    assert heads_for(uneven, 0.7) == pytest.approx(plain * [1.0, 0.95, 1.0, 1.1])
    bent = heads_for(with_effect(vehicle, "thrust_curve", curvature=0.1), 0.7)
    assert bent == pytest.approx(plain * (1 + 0.1 * (plain / HOVER - 1)))
    assert heads_for(with_effect(vehicle, "motor_saturation", thrust_limit=0.06), 0.7) == pytest.approx(0.06)


def test_motors_lose_thrust_as_they_warm_and_none_beyond_a_long_hover(vehicle: np.ndarray) -> None:
    p = with_effect(vehicle, "motor_warming", loss=0.04, time_constant=5.0)
    cold, warm = a_state(), a_state()
    cold[18] = 1.0
    given = [change(p, y, 0.7)[0] for y in (cold, warm)]
    plain = change(vehicle, warm, 0.7)[0]
    told = [one[MOTORS] * 0.065 + HOVER for one in (*given, plain)]  # they rise, with 65 ms
    assert told[0] == pytest.approx(1.04 * told[2])
    assert told[1] == pytest.approx(told[2])
    assert given[0][18] == pytest.approx(-1.0 / 5.0)
    assert given[1][18] == pytest.approx(0.0, abs=1e-12)
    resting = a_state(thrust=[0.0] * 4)
    assert change(p, resting)[0][18] == pytest.approx(1.0 / 5.0)


def test_unlisted_effects_act_where_the_answer_says(vehicle: np.ndarray) -> None:
    region = hide("unlisted_force_region", "medium", 5, vehicle)
    assert region.unlisted is not None
    low, high = region.unlisted["range_m"]
    for x, inside in ((low - 0.01, False), (0.5 * (low + high), True), (high + 0.01, False)):
        _, felt = change(region.vehicle, a_state(position=[x, 0.0, 1.0]))
        assert felt[1] == pytest.approx(region.unlisted["acceleration_m_s2"] if inside else 0.0)
    line = hide("unlisted_torque_line", "medium", 5, vehicle)
    assert line.unlisted is not None
    axis = "xy".index(line.unlisted["channel"][-1])
    t = np.linspace(0.0, 2.0, 4001)
    turning, dy, scratch = np.empty(t.size), np.zeros(STATES), np.zeros((8, 3))
    for k, now in enumerate(t):
        derivative(line.vehicle, now, a_state(), np.zeros(4), np.zeros(6), dy, scratch)
        turning[k] = dy[10 + axis]
    assert np.abs(turning).max() == pytest.approx(line.unlisted["acceleration_rad_s2"], rel=1e-3)
    crossings = np.count_nonzero(np.diff(np.sign(turning[1:])))
    assert crossings == pytest.approx(4.0 * line.unlisted["frequency_hz"], abs=1.01)


# --- against the simulation ---------------------------------------------------------------------------------

ACTS = (
    "thrust_scale thrust_curve battery_sag motor_lag motor_lag_asymmetry motor_imbalance rotor_drag "
    "body_drag inflow_thrust_loss translational_lift ceiling_effect ground_effect velocity_moment "
    "rate_damping rotor_gyroscopic rotor_acceleration_torque mass_error inertia_error com_offset "
    "thrust_tilt tether"
)
SPAN, DUTY = 0.15, np.array([0.70, 0.66, 0.62, 0.71])


def simulated(name: str, values: dict[str, float], y: np.ndarray) -> np.ndarray:
    """Position, velocity, attitude and rate after `SPAN` by the simulation at its 1 ms."""
    declared = EFFECTS[name].parameters
    effect = Effect(
        name=name, parameters={k: Quantity(v, declared[k].unit, 0.0, "") for k, v in values.items()}
    )
    p = physics_parameters(dataclasses.replace(load_vehicle(VEHICLE), effects=(effect,)), RoomGeometry())
    state = charged(new_state(), p)
    state["position"], state["velocity"], state["quaternion"] = y[:3], y[3:6], y[6:10]
    state["omega"], state["thrust"] = y[10:13], y[MOTORS]
    state["battery_voltage"] = 4.12 - float(p["battery_resistance"]) * 6.9 * y[MOTORS].sum()
    for _ in range(round(SPAN / 1e-3)):
        step(state, p, DUTY, 1e-3)
    return np.concatenate([state["position"], state["velocity"], state["quaternion"], state["omega"]])


@pytest.mark.parametrize("name", ACTS.split())
def test_two_programs_that_share_nothing_agree(name: str, vehicle: np.ndarray) -> None:
    values = draw(name, "strong", np.random.default_rng(2))
    height = {"ceiling_effect": 1.92, "ground_effect": 0.08}.get(name, 1.0)
    attitude = Rotation.from_rotvec([0.2, -0.1, 0.4]).as_quat()
    y = a_state(
        position=[0.3, -0.2, height],
        velocity=[1.2, -0.7, 0.4],
        rate=[1.0, -2.0, 1.5],
        attitude=attitude.tolist(),
        thrust=[0.05, 0.09, 0.08, 0.07],
    )
    ours = advance(with_effect(vehicle, name, **values), y, DUTY, SPAN, 0.0005)[:13]
    without = advance(vehicle, y, DUTY, SPAN, 0.0005)[:13]
    miss, effect = np.abs(ours - simulated(name, values, y)), np.abs(ours - without)
    # What the simulation's own step of 1 ms leaves, and 3 % of the effect
    assert miss[3:6].max() < 4e-4 + 0.03 * effect[3:6].max()
    assert miss[10:13].max() < 5e-3 + 0.03 * effect[10:13].max()
    assert max(effect[3:6].max() / 4e-4, effect[10:13].max() / 5e-3) > 10  # there was something to agree on
