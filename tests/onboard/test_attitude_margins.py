"""Margins of the attitude loop: the loops of before, the law's own, and the motors that they assume."""

import cmath
import dataclasses
import math

import numpy as np
import pytest

from onboard.attitude_margins import (
    DELAY_LIMIT,
    LAGS,
    PHASE_LIMIT_DEG,
    AttitudeMargins,
    attitude_margins,
    vehicle_margins,
)
from onboard.controller import AUTHORS_GAINS, DEFAULT_GAINS, ControllerGains, controller_gains
from onboard.quantity import Quantity
from onboard.vehicle import Effect, known_vehicles, load_vehicle

WITHOUT_LEAD = DEFAULT_GAINS._replace(
    kp_xy=0.4, kd_xy=0.32,
    kr_xy=0.012, kw_xy=0.0021, kr_z=0.003, kw_z=0.001, lead_zero=0.0, lead_pole=0.0,
)  # fmt: skip
"""The gains before the law had a lead."""


@pytest.mark.parametrize(
    ("gains", "lag", "phase_deg", "delay_ms"),
    [
        # Calculated elsewhere, for one axis and without the position loop.
        (WITHOUT_LEAD, 0.05, 11.0, 5.0),
        (WITHOUT_LEAD, 0.08, 5.0, 3.0),
        (AUTHORS_GAINS, 0.05, 20.0, 11.0),
    ],
)
def test_loops_that_were_calculated_elsewhere(
    gains: ControllerGains, lag: float, phase_deg: float, delay_ms: float
) -> None:
    margins = attitude_margins(gains, lag, lag)
    assert margins.phase_deg == pytest.approx(phase_deg, abs=1.5)
    assert 1e3 * margins.delay == pytest.approx(delay_ms, abs=1.0)
    assert not margins.suffice


def test_a_loop_that_is_lost_has_a_negative_phase_and_stands_no_delay() -> None:
    margins = attitude_margins(WITHOUT_LEAD, 0.15, 0.15)
    assert margins.phase_deg < 0.0
    assert margins.delay == 0.0


def over_all_lags(gains: ControllerGains) -> AttitudeMargins:
    lags = np.linspace(LAGS[0], LAGS[-1], 41).tolist()
    cases = [attitude_margins(gains, lag, lag) for lag in lags]
    return AttitudeMargins(min(case.phase_deg for case in cases), min(case.delay for case in cases))


@pytest.mark.parametrize("name", known_vehicles())
def test_every_known_vehicle_has_the_margins_over_all_lags(name: str) -> None:
    vehicle = load_vehicle(name)
    margins = over_all_lags(controller_gains(vehicle))
    assert margins.phase_deg >= PHASE_LIMIT_DEG
    assert margins.delay >= DELAY_LIMIT
    assert margins.suffice
    own = vehicle_margins(vehicle)
    assert own.phase_deg >= margins.phase_deg
    assert own.delay >= margins.delay


def test_motors_of_75_ms_up_and_141_ms_down_have_the_margins() -> None:
    assert attitude_margins(DEFAULT_GAINS, 0.075, 0.141).suffice
    assert not attitude_margins(WITHOUT_LEAD, 0.075, 0.141).suffice


def test_effects_of_lag_and_delay_count() -> None:
    bare = load_vehicle("crazyflie21-upgraded")
    gains = controller_gains(bare)

    def with_effect(name: str, parameter: str, value: float, unit: str) -> AttitudeMargins:
        effect = Effect(name=name, parameters={parameter: Quantity(value, unit, 0.0, "test case")})
        return vehicle_margins(dataclasses.replace(bare, effects=(effect,)))

    assert vehicle_margins(bare) == attitude_margins(gains, 0.05, 0.15)
    assert with_effect("motor_lag", "scale", 2.0, "1") == attitude_margins(gains, 0.1, 0.3)
    assert with_effect("motor_lag_asymmetry", "ratio", 4.0, "1") == attitude_margins(gains, 0.025, 0.3)
    delayed = with_effect("command_delay", "delay", 0.01, "s")
    assert delayed.delay == pytest.approx(vehicle_margins(bare).delay - 0.01, abs=1e-4)


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_an_inertia_that_is_10_percent_off_leaves_the_margins(factor: float) -> None:
    gains = DEFAULT_GAINS._replace(
        inertia_xx=factor * DEFAULT_GAINS.inertia_xx,
        inertia_yy=factor * DEFAULT_GAINS.inertia_yy,
        inertia_zz=factor * DEFAULT_GAINS.inertia_zz,
    )
    assert over_all_lags(gains).suffice


@pytest.mark.parametrize("delay", [0.01, 0.03, 0.06])
def test_a_delay_of_any_length_costs_what_it_turns_the_loop_by(delay: float) -> None:
    gains = controller_gains(load_vehicle("crazyflie21-stock"))
    for lag in LAGS:
        free, late = attitude_margins(gains, lag, lag), attitude_margins(gains, lag, lag, delay)
        assert late.phase_deg < free.phase_deg
        assert late.delay == pytest.approx(max(free.delay - delay, 0.0), abs=1e-12)


def test_more_lag_of_the_loop_costs_the_phase_that_it_has_at_the_crossover() -> None:
    slow = attitude_margins(DEFAULT_GAINS, 0.2, 0.2)
    slower = attitude_margins(DEFAULT_GAINS, 0.25, 0.25)
    assert slower.phase_deg < slow.phase_deg < attitude_margins(DEFAULT_GAINS, 0.15, 0.15).phase_deg
    assert not slow.suffice


def pair_response(w: float, up: float, down: float) -> complex:
    """Fundamental of half the difference of two motors that are told +-cos(w t), over that command."""
    steps = 2000
    dt = 2.0 * math.pi / w / steps
    keep_up, keep_down = math.exp(-dt / up), math.exp(-dt / down)
    periods = 3 + int(6.0 * down / (dt * steps))
    first, second, total = 0.0, 0.0, 0j
    for count in range(periods * steps):
        command = math.cos(2.0 * math.pi * (count + 0.5) / steps)
        first = command + (first - command) * (keep_up if command > first else keep_down)
        second = -command + (second + command) * (keep_up if -command > second else keep_down)
        if count >= (periods - 1) * steps:
            total += 0.5 * (first - second) * cmath.exp(-2j * math.pi * (count + 1) / steps)
    return 2.0 * total / steps


@pytest.mark.parametrize(("up", "down"), [(0.05, 0.15), (0.075, 0.141), (0.1, 0.1)])
@pytest.mark.parametrize("w", [5.0, 15.0, 25.0, 45.0])
def test_motors_that_fall_slower_than_they_rise_lag_by_their_mean(w: float, up: float, down: float) -> None:
    mean = 1.0 / (1.0 + 1j * w * 0.5 * (up + down))
    pair = pair_response(w, up, down)
    assert abs(mean) == pytest.approx(abs(pair), rel=0.05)
    less = math.degrees(cmath.phase(pair) - cmath.phase(mean))
    assert -0.1 <= less <= 2.6
