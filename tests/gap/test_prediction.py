"""Prediction of flights: exact for the model's own flights, and wrong by what the equations say otherwise."""

import dataclasses
import json

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.replay import PredictionError, evaluate, fly_again
from calibration.gap.replay.flight_prediction import rotation_between
from calibration.gap.replay.inputs import prediction_inputs, velocity_from_the_past
from calibration.gap.replay.nuisances import Nuisances
from calibration.gap.replay.windows import usable_lengths
from onboard.gravity import GRAVITY
from onboard.json_file import as_json
from onboard.quantity import Quantity
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, hover, up_and_down, with_noise
from tests.physics.effects.conftest import with_effects

VEHICLE = load_vehicle("crazyflie21-upgraded-stored")


def without_accelerometer(record: FlightRecord) -> FlightRecord:
    return dataclasses.replace(record, specific_force=None)


@pytest.fixture(scope="module")
def laps() -> FlightRecord:
    return fly(VEHICLE, circle())


ODD = {
    "motor_speed_law": {"a_up": 0.0, "b_up": 0.00424, "a_down": 0.5, "b_down": 0.00178},
    "command_delay": {"delay": 0.0123},
    "thrust_scale": {"scale": 0.97},
    "motor_imbalance": {"m1": 0.97},
    "rotor_drag": {"coefficient": 2e-6},
    "rotor_acceleration_torque": {"rotor_inertia": 2e-8},
    "ceiling_effect": {"inflow": 1.0},
    "tether": {"x": 0.5, "y": 0.0, "z": 0.0, "length": 0.8, "stiffness": 0.05},
}
"""One effect of each kind: how motors follow, what they are told, forces, torques, surfaces."""

SENSED = {
    "pose_delay": {"delay": 0.02},
    "pose_rotation": {"x": 0.03, "y": -0.02, "z": 0.05},
    "pose_offset": {"x": 0.01, "z": 0.03},
    "gyro_bias": {"x": 0.02, "z": -0.03},
    "com_offset": {"x": 0.002, "y": -0.001, "z": 0.004},
}


@pytest.mark.parametrize("effects", [{}, ODD], ids=["base", "effects"])
def test_a_model_predicts_its_own_flight(effects: dict[str, dict[str, float]]) -> None:
    vehicle = with_effects(effects)
    errors = evaluate([fly(vehicle, circle(), 6.0, ceiling_z=1.2)], vehicle)
    pair = errors.overall
    for horizon, found in pair.open_loop.items():
        # What is left is the start velocity, found from positions.
        assert found.position_m is not None
        assert found.position_m < 1e-4 * horizon
        assert found.attitude_deg is not None
        assert found.attitude_deg < 1e-3
        assert found.rate_rad_s is not None
        assert found.rate_rad_s < 3e-4
    for horizon, found in pair.given_attitude.items():
        assert found.position_m is not None
        assert found.position_m < 4e-4 * horizon
        assert found.attitude_deg is None
    assert list(pair.open_loop) == [0.1, 0.25, 0.5, 1.0]


def test_the_physics_with_small_steps_agrees() -> None:
    """Truth at 0.25 ms, prediction at 1 ms: the error of the integrator stays far below that of a log."""
    found = evaluate([fly(VEHICLE, circle(), fine=40)], VEHICLE).overall
    assert found.open_loop[1.0].position_m < 2e-4
    assert found.given_attitude[1.0].position_m < 2e-4


@pytest.mark.parametrize("scale", [0.98, 1.03])
def test_a_thrust_error_gives_the_fall_that_it_must(scale: float) -> None:
    """1/2 a t^2 and a t with a = |1 - scale| of the specific force; attitude given, so nothing else moves."""
    record = fly(with_effects({"thrust_scale": {"scale": scale}}), hover(), 8.0)
    found = evaluate([dataclasses.replace(record, flying=record.t > 4.0)], VEHICLE).overall
    excess = abs(1.0 / scale - 1.0) * GRAVITY
    for horizon, errors in found.given_attitude.items():
        assert errors.velocity_m_s == pytest.approx(excess * horizon, rel=0.02)
        assert errors.position_m == pytest.approx(0.5 * excess * horizon**2, rel=0.02)


def test_a_torque_error_gives_the_turn_that_it_must(laps: FlightRecord) -> None:
    """A centre of mass that is off by d turns the model with d * weight / inertia."""
    offset = 1e-4
    found = evaluate([laps], with_effects({"com_offset": {"x": offset}}))
    inertia, weight = VEHICLE.body.inertia_yy.value, VEHICLE.body.mass.value * GRAVITY
    wanted = offset * weight / inertia
    rate = found.by_channel()[0.1]["rate_y_rad_s"]
    assert rate == pytest.approx(wanted * 0.1, rel=0.03)
    assert found.by_channel()[0.1]["rate_x_rad_s"] < 0.05 * rate
    # A constant torque is just what the causal estimate takes along.
    assert found.with_torque_estimate[0.1].rate_rad_s < 0.05 * rate


def test_what_the_file_says_of_pose_and_gyro_is_taken_out() -> None:
    vehicle = with_effects(SENSED)
    record = fly(vehicle, circle(), 6.0)
    shift = round(0.02 / record.dt)
    late = {
        name: np.roll(getattr(record, name), shift, axis=0) for name in ("position", "velocity", "attitude")
    }
    delayed = dataclasses.replace(record, flying=record.flying & (record.t > 0.6), **late)
    right = evaluate([delayed], vehicle).overall.open_loop[0.5]
    wrong = evaluate([delayed], with_effects({"com_offset": SENSED["com_offset"]})).overall.open_loop[0.5]
    assert right.position_m < 1e-3
    assert right.attitude_deg < 0.05
    assert wrong.position_m > 50 * right.position_m


def test_errors_grow_with_the_noise_of_the_log(laps: FlightRecord) -> None:
    sizes = [
        evaluate([with_noise(laps, scale, np.random.default_rng(1))], VEHICLE).overall.given_attitude[0.5]
        for scale in (0.25, 0.5, 1.0)
    ]
    positions = [size.position_m for size in sizes]
    np.testing.assert_allclose(np.divide(positions, positions[-1]), [0.25, 0.5, 1.0], rtol=0.05)
    assert positions[-1] < 0.015


def test_sensors_are_the_floor_when_the_model_is_wrong(laps: FlightRecord) -> None:
    noisy = with_noise(laps, 1.0, np.random.default_rng(2))
    right, wrong = (
        evaluate([noisy], VEHICLE),
        evaluate([noisy], with_effects({"mass_error": {"relative": 0.05}})),
    )
    for errors in (right, wrong):
        floor = errors.floor
        assert floor is not None
        # The sensors know nothing of the model.
        assert floor.given_attitude[1.0].position_m == pytest.approx(0.0129, rel=0.3)
        assert floor.open_loop[1.0].attitude_deg < 0.6
        assert floor.open_loop[1.0].rate_rad_s is None
    assert wrong.overall.given_attitude[1.0].position_m > 10 * floor.given_attitude[1.0].position_m
    assert right.overall.given_attitude[1.0].position_m < 1.3 * floor.given_attitude[1.0].position_m
    assert evaluate([without_accelerometer(noisy)], VEHICLE).floor is None


def test_nuisances_of_the_first_seconds_serve_the_rest() -> None:
    odd = with_effects({"thrust_scale": {"scale": 0.94}, "thrust_tilt": {"x": 0.03, "y": -0.02}})
    record = fly(odd, circle(), 14.0)
    plain = evaluate([record], VEHICLE)
    fitted = evaluate([record], VEHICLE, calibrate_first_s=8.0)
    found = fitted.flights[0].nuisances
    assert found.thrust_scale == pytest.approx(0.94, rel=2e-3)
    assert found.lean_rad == pytest.approx((0.03, -0.02), abs=1e-3)
    assert not found.at_bound
    assert plain.overall.given_attitude[1.0].position_m > 0.2
    assert fitted.overall.given_attitude[1.0].position_m < 1e-3
    # Scored are only starts after the first 8 s of flight.
    first = record.t[fitted.flights[0].model.open_loop.rows[0]]
    assert first >= record.t[np.argmax(record.flying)] + 8.0
    assert plain.flights[0].nuisances.thrust_scale == 1.0


def test_what_the_accelerometer_feels_beside_the_centre_of_mass_is_no_error() -> None:
    """Neither of the floor nor of the velocities that a prediction starts with: 0.7 mm, were it ignored."""
    heavy = with_effects({"com_offset": {"x": 0.002, "y": -0.0015}})
    errors = evaluate([fly(heavy, circle(radius=0.4, period=2.5))], heavy)
    assert errors.floor is not None
    assert errors.floor.given_attitude[0.5].position_m < 1e-4
    assert errors.overall.given_attitude[0.5].position_m < 5e-5


def test_the_floor_of_a_calibrated_flight_is_calibrated_too() -> None:
    record = fly(VEHICLE, circle(), 14.0)
    assert record.specific_force is not None
    biased = dataclasses.replace(record, specific_force=record.specific_force + np.array([0.3, -0.2, 0.1]))
    plain, fitted = (
        evaluate([biased], VEHICLE).floor,
        evaluate([biased], VEHICLE, calibrate_first_s=8.0).floor,
    )
    assert plain is not None
    assert fitted is not None
    size = np.linalg.norm([0.3, -0.2, 0.1])
    assert plain.given_attitude[1.0].velocity_m_s == pytest.approx(size, rel=0.05)
    assert fitted.given_attitude[1.0].velocity_m_s < 0.03 * size


def test_windows_keep_clear_of_what_is_not_known(laps: FlightRecord) -> None:
    lost = (laps.t > 4.0) & (laps.t < 4.3)
    damaged = dataclasses.replace(
        laps,
        motors_known=~lost,
        duty=np.where(lost[:, None], 7.0, laps.duty),
        pose_known=~((laps.t > 8.0) & (laps.t < 8.1)),
        position=np.where(((laps.t > 8.0) & (laps.t < 8.1))[:, None], np.nan, laps.position),
    )
    errors = evaluate([damaged], VEHICLE)
    # A falling thrust takes longer than 0.15 s to forget what was made up across the gap.
    assert errors.overall.open_loop[1.0].position_m < 3e-3
    rows = errors.flights[0].model.open_loop.rows
    t = laps.t[rows]
    assert not np.any((t > 3.9) & (t < 4.45))
    lengths = usable_lengths(prediction_inputs(damaged, VEHICLE))
    assert lengths[np.searchsorted(laps.t, 3.0)] * laps.dt == pytest.approx(1.0, abs=0.02)
    assert lengths[np.searchsorted(laps.t, 0.2)] == -1  # not flying yet


def test_every_start_is_in_one_phase_and_the_means_fit_together(laps: FlightRecord) -> None:
    climbs = fly(VEHICLE, up_and_down(amplitude=0.6), 8.0, shape="vertical", ceiling_z=1.8)
    errors = evaluate([laps, climbs], with_effects({"mass_error": {"relative": 0.02}}))
    phases = errors.by_phase()
    assert {"fast", "vertical", "near_ceiling"} <= set(phases)
    total = errors.overall.given_attitude[0.5]
    parts = [pair.given_attitude[0.5] for pair in phases.values() if 0.5 in pair.given_attitude]
    assert sum(p.windows for p in parts) == total.windows
    assert sum(p.windows * p.position_m for p in parts) / total.windows == pytest.approx(total.position_m)
    flights = [pair.given_attitude[0.5] for pair in errors.by_flight()]
    assert sum(p.windows for p in flights) == total.windows


def test_the_document_has_the_form_of_the_contract(laps: FlightRecord) -> None:
    document = json.loads(json.dumps(as_json(evaluate([laps], VEHICLE, (0.5, 1.0))), allow_nan=False))
    assert set(document["horizons"]["0.5"]) >= {"position_m", "velocity_m_s", "attitude_deg", "rate_rad_s"}
    assert set(document["given_attitude"]["1.0"]) == {"position_m", "velocity_m_s", "windows"}
    assert document["flights"] == 1


def test_a_model_that_runs_away_is_doubted(laps: FlightRecord) -> None:
    """A damping that is far beyond what the step can carry turns into a rate without bounds."""
    unstable = with_effects(
        {"inertia_error": {"xx": -0.6, "yy": -0.6}, "rate_damping": {"x": 1e-4, "y": 1e-4}}
    )
    light = dataclasses.replace(
        unstable, body=dataclasses.replace(unstable.body, **_inertia(1e-8)), name="light"
    )
    errors = evaluate([laps], light)
    found = errors.overall.open_loop[0.5]
    assert found.diverged > 0
    assert found.windows == evaluate([laps], VEHICLE).overall.open_loop[0.5].windows
    assert "runs away" in list(errors.doubts())[-1]
    json.dumps(as_json(errors), allow_nan=False)


def _inertia(value: float) -> dict[str, Quantity]:
    return {f"inertia_{axis}": Quantity(value, "kg m2", 0.0, "test case") for axis in ("xx", "yy", "zz")}


def test_a_flight_that_cannot_be_scored_is_named(laps: FlightRecord) -> None:
    grounded = dataclasses.replace(laps, name="grounded", flying=np.zeros(laps.t.size, dtype=bool))
    errors = evaluate([laps, grounded], VEHICLE)
    assert [item.record.name for item in errors.unpredicted] == ["grounded"]
    assert "no 0.1 s of free flight" in errors.unpredicted[0].reason
    with pytest.raises(PredictionError, match=r"nothing to predict: simulated: no 0\.1 s of free flight"):
        evaluate([grounded], VEHICLE)
    with pytest.raises(PredictionError, match="positive and increasing"):
        evaluate([laps], VEHICLE, (0.5, 0.1))
    with pytest.raises(PredictionError, match="first 1 s"):
        evaluate([laps], VEHICLE, calibrate_first_s=1.0)
    with pytest.raises(PredictionError, match="no flights"):
        evaluate([], VEHICLE)


def test_start_velocity_is_causal_and_unbiased() -> None:
    """Jerk is carried by the accelerometer, an accelerometer's bias by the parabola."""
    t = 0.01 * np.arange(60)
    position = np.column_stack([t**3 * 5.0, np.sin(3.0 * t), 0.0 * t])
    velocity = np.column_stack([t**2 * 15.0, 3.0 * np.cos(3.0 * t), 0.0 * t])
    acceleration = np.column_stack([t * 30.0 + 0.3, -9.0 * np.sin(3.0 * t), 0.0 * t - 0.2])
    found = velocity_from_the_past(position, acceleration, 0.01)
    np.testing.assert_allclose(found[10:], velocity[10:], atol=2e-4)
    assert np.isnan(found[:10]).all()
    changed = position.copy()
    changed[40:] += 1.0
    np.testing.assert_array_equal(velocity_from_the_past(changed, acceleration, 0.01)[:40], found[:40])
    # Without it a parabola is all there is: off by jerk * window^2 / 10.
    blind = velocity_from_the_past(position, None, 0.01)
    assert blind[30, 0] - velocity[30, 0] == pytest.approx(-30.0 * 0.1**2 / 10.0, rel=0.2)


def test_flying_again_needs_what_the_model_lacks(laps: FlightRecord) -> None:
    weak = fly(with_effects({"thrust_scale": {"scale": 0.95}}), up_and_down(), believed=VEHICLE)
    own, other = fly_again(laps, VEHICLE), fly_again(weak, VEHICLE)
    assert own is not None
    assert other is not None
    assert (own.needed_duty / own.duty).mean() == pytest.approx(1.0, abs=0.01)
    # Thrust grows a little faster than in proportion to duty.
    assert 0.95 < (other.needed_duty / other.duty).mean() < 0.985
    draggy = fly_again(laps, with_effects({"rotor_drag": {"coefficient": 8e-6}}))
    assert draggy is not None
    leans = [rotation_between(one.attitude, one.needed_attitude) for one in (own, draggy)]
    assert np.linalg.norm(leans[1]) > 2.0 * np.linalg.norm(leans[0])
    assert fly_again(dataclasses.replace(laps, flying=laps.t < 1.0), VEHICLE) is None


@pytest.mark.parametrize(
    "unequal",
    [
        {"motor_imbalance": {"m1": 1.06, "m2": 1.03, "m3": 1.04, "m4": 0.86}},
        {"com_offset": {"x": 0.004, "y": -0.003}},
    ],
)
def test_flying_again_is_trimmed_as_the_controllers_that_flew(
    laps: FlightRecord, unequal: dict[str, dict[str, float]]
) -> None:
    """Ours has no integral of the attitude error to hold what is unequal."""
    again = fly_again(laps, with_effects(unequal))
    assert again is not None
    leans = np.linalg.norm(rotation_between(again.attitude, again.needed_attitude), axis=1)
    assert np.degrees(np.median(leans)) < 3.0


def test_flying_again_knows_what_a_flight_has_of_its_own() -> None:
    """A thrust that is 5 % weak, and a torque of its own, are what the commands show."""
    weak = fly(with_effects({"thrust_scale": {"scale": 0.95}}), up_and_down(), believed=VEHICLE)
    calibrated = fly_again(weak, VEHICLE, Nuisances(thrust_scale=0.95))
    turned = fly_again(
        weak, VEHICLE, Nuisances(thrust_scale=0.95, angular_acceleration_rad_s2=(8.0, -5.0, 1.0))
    )
    assert calibrated is not None
    assert turned is not None
    for flight in (calibrated, turned):
        assert (flight.needed_duty / flight.duty).mean() == pytest.approx(1.0, abs=0.01)
    leans = np.linalg.norm(rotation_between(turned.attitude, turned.needed_attitude), axis=1)
    assert np.degrees(np.median(leans)) < 3.0


def test_flying_again_has_what_the_battery_gives(laps: FlightRecord) -> None:
    """A weak vehicle needs more than its file thinks that a motor has; real ones flew at 95 % of duty."""
    needed = 0.25 * VEHICLE.body.mass.value * GRAVITY / 0.5
    assert needed > VEHICLE.motors.thrust_max.value
    weak = fly_again(laps, with_effects({"thrust_scale": {"scale": 0.5}}))
    assert weak is not None
    leans = np.linalg.norm(rotation_between(weak.attitude, weak.needed_attitude), axis=1)
    assert np.degrees(np.median(leans)) < 3.0
