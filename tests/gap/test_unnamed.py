import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter

from calibration.gap.data.channels import BY_NAME, attitudes
from calibration.gap.unnamed.gap_map import gap_map
from calibration.gap.unnamed.lines import find_lines
from calibration.gap.unnamed.regressors import regressors
from calibration.gap.unnamed.structure import Structure, structured
from calibration.gap.unnamed.term_search import unnamed_terms
from calibration.gap.unnamed.terms import CurveTerm, IntervalTerm, PolynomialTerm, as_signals, interval_term
from onboard.vehicle import load_vehicle
from tests.gap.disturbed_motion import DT, SHAPES, Flights, disturbed_flights
from tests.tiers import some

VEHICLE = load_vehicle("crazyflie21-stock")


def judged(flights: Flights, residual: np.ndarray, draws: int = 200) -> list[Structure]:
    found = gap_map(flights.signals, flights.records, residual, np.random.default_rng(0), draws)
    lines = find_lines(flights.signals, flights.records, residual)
    return structured(found, lines)


def fitted(flights: Flights, residual: np.ndarray, term: object) -> np.ndarray:
    valid = flights.signals.valid
    columns = np.stack([flights.add(c - flights.residual)[valid] for c in term.columns], axis=1)
    return np.linalg.lstsq(columns, residual[valid], rcond=None)[0]


def line_in(flights: Flights, channel: int, size: float, hertz: float) -> np.ndarray:
    rng = np.random.default_rng(5)
    column = np.zeros_like(flights.residual)
    phases = rng.uniform(0.0, 2.0 * np.pi, len(flights.records))
    column[:, channel] = size * np.sin(
        2.0 * np.pi * hertz * (flights.times() + 0.5 * DT) + phases[flights.signals.flight]
    )
    return column


def test_the_noise_of_the_tests_moves_with_the_vehicle() -> None:
    """Or the null below would be too easy: a plain correlation with speed is far beyond chance."""
    flights = disturbed_flights(1, ("hover",) * 8)
    force, velocity = flights.residual[:, 0], flights.along("velocity")[:, 0]
    blocks = [values[: values.size // 25 * 25].reshape(-1, 25).mean(axis=1) for values in (force, velocity)]
    assert np.corrcoef(*blocks)[0, 1] > 0.3


def test_two_terms_of_one_class_channel_and_regressor_are_told_apart() -> None:
    flights = disturbed_flights(1, ("hover",) * 2)
    turns, quantity = attitudes(flights.records), regressors(flights.records)[0]
    one, other = (interval_term(BY_NAME["force_x"], quantity, (low, None), turns) for low in (0.0, 0.0))
    assert other not in (one,)
    assert one in (one,)


@pytest.mark.soak
def test_noise_is_hardly_ever_called_structure() -> None:
    alarms = []
    for seed in range(20):
        flights = disturbed_flights(100 + seed, SHAPES[:6], slow_torque=3.0 * (seed % 2), seconds=16.0)
        alarms.append(bool(judged(flights, flights.residual, draws=100)))
    assert sum(alarms) <= 1


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.soak) for seed in (2, 3))])
def test_a_push_in_a_slab_of_the_room_is_found_and_measured(seed: int) -> None:
    flights = disturbed_flights(seed)
    x = flights.along("position")[:, 0]
    residual = flights.add(flights.world_force(1, np.where((x > 0.1) & (x < 0.5), 0.3, 0.0)))
    found = judged(flights, residual)
    assert [(f.channel.signal, f.channel.frame, f.regressor) for f in found] == [("force_y", "world", "x")]
    (term,) = unnamed_terms([found[0].cell], [], flights.signals, flights.records, residual)
    assert isinstance(term, IntervalTerm)
    assert term.low == pytest.approx(0.1, abs=0.03)
    assert term.high == pytest.approx(0.5, abs=0.03)
    value = fitted(flights, residual, term)
    assert value == pytest.approx([0.3], rel=0.1)
    newton = VEHICLE.body.mass.value * value[0]
    assert term.formula(value, VEHICLE).startswith(f"{newton:.3g} N along world y where 0.")


def test_a_push_that_comes_and_goes_softly_is_a_curve_that_is_nothing_elsewhere() -> None:
    flights = disturbed_flights(1)
    x = flights.along("position")[:, 0]
    residual = flights.add(flights.world_force(1, 0.6 * np.exp(-(((x - 0.4) / 0.15) ** 2)) + 0.5))
    (found, *_) = judged(flights, residual)
    (term,) = unnamed_terms([found.cell], [], flights.signals, flights.records, residual)
    assert isinstance(term, CurveTerm)
    curve = term.at_knots(fitted(flights, residual - flights.world_force(1, np.full(x.size, 0.5)), term))
    assert curve[term.zero] == 0.0
    told = np.interp([-0.5, -0.2, 0.4], term.knots, curve)
    assert told == pytest.approx([0.0, 0.0, 0.6], abs=0.08)  # what is everywhere is no part of it


def test_the_condition_names_the_end_where_the_residual_lives() -> None:
    flights = disturbed_flights(4)
    x = flights.along("position")[:, 0]
    residual = flights.add(flights.world_force(2, np.where(x > 0.4, -0.4, 0.0)))
    (found,) = judged(flights, residual)
    assert (found.channel.name, found.regressor) == ("world_force_z", "x")
    assert found.condition.startswith("x > 0.")
    (term,) = unnamed_terms([found.cell], [], flights.signals, flights.records, residual)
    assert isinstance(term, IntervalTerm)
    assert term.high is None
    assert term.low == pytest.approx(0.4, abs=0.03)


def test_drag_is_a_line_over_speed() -> None:
    flights = disturbed_flights(5)
    forward = next(r for r in regressors(flights.records) if r.name == "velocity_x")
    push = np.zeros_like(flights.residual)
    push[:, 0] = -0.25 * forward.values
    residual = flights.add(push)
    (found,) = judged(flights, residual)
    assert (found.channel.signal, found.regressor) == ("force_x", "velocity_x")
    (term,) = unnamed_terms([found.cell], [], flights.signals, flights.records, residual)
    assert isinstance(term, PolynomialTerm)
    assert len(term.columns) == 1
    value = fitted(flights, residual, term)
    assert value == pytest.approx([-0.25], rel=0.1)
    assert term.formula(value, VEHICLE).endswith("N along body x, u = forward speed in m/s")


def test_what_one_flight_alone_shows_is_found_by_its_parts() -> None:
    flights = disturbed_flights(6, ("hover", "circle", "hover_turning", "figure8", "vertical"), seconds=30.0)
    z = flights.along("position")[:, 2]
    residual = flights.add(flights.world_force(2, np.where(z > 1.1, -0.4, 0.0)))
    (found,) = judged(flights, residual)
    assert (found.channel.signal, found.regressor) == ("force_z", "z")


@pytest.mark.parametrize(("size", "hertz"), some([(2.0, 4.3), (6.0, 7.77)], 2))
def test_a_line_is_found_and_measured(size: float, hertz: float) -> None:
    flights = disturbed_flights(7)
    residual = flights.add(line_in(flights, 4, size, hertz))
    (found,) = judged(flights, residual)
    line = found.line
    assert line is not None
    assert (line.channel.name, found.regressor) == ("torque_y", "time")
    assert line.frequency == pytest.approx(hertz, abs=0.01)
    assert line.amplitude == pytest.approx(size, rel=0.08)
    power = np.var(residual[flights.signals.valid[:, 4], 4])
    assert line.share == pytest.approx(0.5 * size**2 / power, rel=0.2)
    (term,) = unnamed_terms([], [line], flights.signals, flights.records, residual)
    assert len(term.columns) == 2 * len(flights.records)
    moment = size * VEHICLE.body.inertia_yy.value
    words = term.formula(fitted(flights, residual, term), VEHICLE)
    assert float(words.split()[0]) == pytest.approx(moment, rel=0.08)
    assert words.endswith(f"N m about body y at {hertz:.3g} Hz")


def test_a_broad_resonance_is_no_line() -> None:
    flights = disturbed_flights(8)
    rng = np.random.default_rng(3)
    radius, angle = np.exp(-np.pi * 1.0 * DT), 2.0 * np.pi * 5.0 * DT  # 1 Hz wide, at 5 Hz
    swing = lfilter(
        [1.0], [1.0, -2.0 * radius * np.cos(angle), radius**2], rng.standard_normal(flights.residual.shape[0])
    )
    column = np.zeros_like(flights.residual)
    column[:, 3] = 3.0 * swing / swing.std()
    assert find_lines(flights.signals, flights.records, flights.add(column)) == []


def test_what_one_manoeuvre_repeats_is_no_line() -> None:
    flights = disturbed_flights(9)
    circles = np.array([record.shape == "circle" for record in flights.records])[flights.signals.flight]
    column = line_in(flights, 0, 0.3, 1.3) * circles[:, None]
    assert find_lines(flights.signals, flights.records, flights.add(column)) == []


def test_forces_of_the_world_turn_with_the_body() -> None:
    turns = np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])  # yaw by 90 degrees
    column = as_signals(BY_NAME["world_force_y"], np.array([2.0]), turns)
    assert column == pytest.approx(np.array([[2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]))


def test_flights_without_accelerometer_and_battery_still_tell_of_torques() -> None:
    flights = disturbed_flights(11, ("circle", "lissajous", "figure8"))
    flights.records = [dataclasses.replace(r, specific_force=None, voltage=None) for r in flights.records]
    flights.signals.valid[:, [0, 1, 2, 6]] = False
    column = np.zeros_like(flights.residual)
    column[:, 3] = 4.0 * flights.along("velocity")[:, 1]
    residual = flights.add(column)
    found = gap_map(flights.signals, flights.records, residual, np.random.default_rng(0))
    assert "voltage" not in found.regressors
    silent = [name.startswith(("force", "world", "voltage")) for name in found.channels]
    assert np.all(found.p[silent] == 1.0)
    assert np.all(found.share[silent] == 0.0)
    best = found.cells[0]
    assert (best.channel.name, best.regressor.name) == ("torque_x", "velocity_y")


def test_the_map_is_the_same_for_the_same_seed() -> None:
    flights = disturbed_flights(12, ("circle", "hover"))
    first, again = (
        gap_map(flights.signals, flights.records, flights.residual, np.random.default_rng(3), 100)
        for _ in range(2)
    )
    assert np.array_equal(first.p, again.p)
    assert np.array_equal(first.share, again.share)


def test_voltage_read_ten_times_a_second_is_no_structure() -> None:
    flights = disturbed_flights(13)
    every = np.arange(0, flights.residual.shape[0], 10)
    column = np.zeros_like(flights.residual)
    noise = 0.02 * np.random.default_rng(3).standard_normal(every.size)
    drawn = np.interp(np.arange(flights.residual.shape[0]), every, noise)
    column[:, 6] = drawn - flights.residual[:, 6]
    residual = flights.add(column)
    assert judged(flights, residual) == []
