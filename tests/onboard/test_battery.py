"""Battery compensation: the errata's table of voltages, inverses, and the 8-bit PWM."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.battery import (
    ThrustMap,
    ThrustMapForm,
    battery_current,
    duty_for_thrust,
    open_circuit_voltage,
    quantise_pwm,
    terminal_voltage,
    thrust_from_voltage,
    voltage_from_thrust,
)
from onboard.vehicle import known_thrust_maps, read_thrust_map

GF = 9.80665e-3
MAPS = {name: read_thrust_map(name).compiled() for name in known_thrust_maps()}
# The canonical form of errata 1, with numbers near the paper's upgraded motor.
MAPS["log"] = ThrustMap(
    int(ThrustMapForm.TWO_REGION_LOG),
    np.array([0.9, 1.2 * GF, 1.6, 3.0 * GF, 5.0 * GF, 0.0, 0.0, 0.0]),
)

# Errata 1, columns "quadratic, stock", "quadratic, upgraded" and "coefficients that flew".
ERRATA = {
    1: (0.572, 0.472, 0.429),
    2: (0.995, 0.791, 0.752),
    3: (1.347, 1.049, 1.023),
    4: (1.655, 1.272, 1.260),
    5: (1.932, 1.470, 1.475),
    6: (2.207, 1.697, 1.713),
    8: (2.568, 2.005, 2.038),
    10: (2.857, 2.247, 2.294),
    12: (3.106, 2.453, 2.512),
    15: (3.430, 2.720, 2.795),
}


@pytest.mark.parametrize("grams", sorted(ERRATA))
def test_voltages_are_those_of_the_errata(grams: int) -> None:
    for name, volts in zip(("paper-stock", "paper-upgraded", "flown-2022"), ERRATA[grams], strict=True):
        assert voltage_from_thrust(MAPS[name], grams * GF) == pytest.approx(volts, abs=6e-4)


@pytest.mark.parametrize(
    ("name", "below", "above"), [("paper-stock", 1.932, 1.975), ("paper-upgraded", 1.470, 1.490)]
)
def test_the_jump_at_five_grams(name: str, below: float, above: float) -> None:
    thrust_map = MAPS[name]
    assert voltage_from_thrust(thrust_map, 5.0 * GF) == pytest.approx(below, abs=5e-4)
    assert voltage_from_thrust(thrust_map, 5.0 * GF * (1 + 1e-12)) == pytest.approx(above, abs=5e-4)
    assert thrust_from_voltage(thrust_map, 0.5 * (below + above)) == pytest.approx(5.0 * GF)


def test_hover_voltages_of_the_paper_vehicle() -> None:
    hover = 38.1 / 4 * GF
    assert voltage_from_thrust(MAPS["paper-upgraded"], hover) == pytest.approx(2.19, abs=0.005)
    assert voltage_from_thrust(MAPS["paper-stock"], hover) == pytest.approx(2.79, abs=0.005)


def test_packs_of_many_cells_have_their_voltages_too() -> None:
    """The square of the voltage, up to 12 cells."""
    square = ThrustMap(int(ThrustMapForm.FIRMWARE_CUBIC), np.array([0.0, 0.0, 0.0165, *[0.0] * 5]))
    for volts in (3.0, 15.9, 16.1, 25.2, 50.4):
        assert voltage_from_thrust(square, 0.0165 * volts**2) == pytest.approx(volts, rel=1e-12)


@pytest.mark.parametrize("name", MAPS)
@given(grams=st.floats(0.8, 20.0))
def test_inverse_round_trip(name: str, grams: float) -> None:
    thrust = grams * GF
    voltage = voltage_from_thrust(MAPS[name], thrust)
    assert thrust_from_voltage(MAPS[name], voltage) == pytest.approx(thrust, abs=1e-9)
    if abs(grams - 5.0) > 0.3 and voltage > 0.0:
        again = voltage_from_thrust(MAPS[name], thrust_from_voltage(MAPS[name], voltage))
        assert abs(again - voltage) < 1e-9


@pytest.mark.parametrize("name", MAPS)
def test_thrust_never_falls_when_the_voltage_rises(name: str) -> None:
    thrusts = [thrust_from_voltage(MAPS[name], v) for v in np.linspace(-0.5, 5.0, 2000)]
    assert np.all(np.diff(thrusts) >= 0.0)
    assert thrusts[0] == 0.0
    volts = [voltage_from_thrust(MAPS[name], f) for f in np.linspace(0.0, 0.2, 2000)]
    assert np.all(np.diff(volts) >= 0.0)
    assert all(math.isfinite(v) for v in volts)


def test_cubic_is_the_firmwares_polynomial() -> None:
    c = MAPS["bitcraze-p250"].coefficients
    thrust = thrust_from_voltage(MAPS["bitcraze-p250"], 3.0)
    assert thrust == pytest.approx(float(np.polynomial.Polynomial(c[:4])(3.0)))
    roots = np.roots([c[3], c[2], c[1], c[0] - 0.1])
    real = roots[np.abs(roots.imag) < 1e-9].real
    assert voltage_from_thrust(MAPS["bitcraze-p250"], 0.1) == pytest.approx(real[0], abs=1e-9)


def test_log_form_is_continuous_and_starts_at_zero() -> None:
    at, delta = 5.0 * GF, 1e-9
    low, high = (voltage_from_thrust(MAPS["log"], at + d) for d in (-delta, delta))
    assert high - low < 1e-6
    assert voltage_from_thrust(MAPS["log"], 1e-9) < 1e-6


def test_duty_holds_the_thrust_over_the_battery() -> None:
    thrust_map = MAPS["paper-upgraded"]
    for battery in (3.0, 3.5, 4.1):
        duty = duty_for_thrust(0.09, battery, thrust_map)
        assert thrust_from_voltage(thrust_map, duty * battery) == pytest.approx(0.09, abs=1e-12)
    assert duty_for_thrust(0.147, 2.5, thrust_map) == 1.0


@pytest.mark.parametrize(
    ("thrust", "battery"),
    [(0.0, 4.0), (-0.1, 4.0), (math.nan, 4.0), (0.1, math.nan), (0.1, 0.0), (0.1, 1.99), (0.002, 4.0)],
)
def test_what_cannot_be_known_stops_the_motor(thrust: float, battery: float) -> None:
    for thrust_map in MAPS.values():
        assert duty_for_thrust(thrust, battery, thrust_map, 0.25 * GF) == 0.0


@given(st.floats(0.0, 1.0))
def test_pwm_has_eight_bits(duty: float) -> None:
    applied = quantise_pwm(duty)
    assert applied * 256 == int(applied * 256)
    assert applied <= duty
    assert duty - applied < 1 / 256 + 2e-5


def test_pwm_ends() -> None:
    assert quantise_pwm(1.0) == 255 / 256
    assert quantise_pwm(2.0) == 255 / 256
    assert quantise_pwm(-1.0) == 0.0
    assert quantise_pwm(math.nan) == 0.0
    assert quantise_pwm(0.5, 16) == pytest.approx(0.5, abs=2e-5)


def test_battery_is_a_source_behind_a_resistance() -> None:
    assert open_circuit_voltage(4.1, 0.6, 900.0, 450.0) == pytest.approx(3.8)
    current = battery_current(7.5, 0.1, 0.1, 0.1, 0.1)
    assert current == pytest.approx(3.0)
    assert terminal_voltage(4.1, 0.2, current) == pytest.approx(3.5)
    assert terminal_voltage(4.1, 0.2, 100.0) == 0.0
