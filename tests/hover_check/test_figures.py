"""The figures of a check, from records whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from onboard.arrays import FloatArray
from perchhw.hover_check.ended import resistance_aloft
from perchhw.hover_check.lag import _modelled_rates, motor_lag
from perchhw.hover_check.poses import stream
from perchhw.hover_check.thrust import hover_thrust
from perchhw.hover_check.vibration import folded, noise_in_band, vibration
from perchhw.hover_check.windows import CheckWindows, RecordTooShort
from tests.hover_check.numbers import VEHICLE, series, windows


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.08])
def test_thrust_is_the_share_of_the_weight_that_the_commands_give(factor: float) -> None:
    found = hover_thrust(windows(shares=(factor,) * 4), VEHICLE)
    assert abs(found.thrust.value - factor) < found.thrust.u95
    assert all(abs(share.value - 1.0) < 0.005 for share in found.shares)


def test_one_weak_motor_is_told_from_a_centre_of_mass_and_leaves_the_thrust_alone() -> None:
    weak = hover_thrust(windows(shares=(1.0, 1.12, 1.0, 1.0)), VEHICLE)
    assert [round(share.value, 2) for share in weak.shares] == [1.0, 1.12, 1.0, 1.0]
    assert weak.thrust.value == pytest.approx(1.0, abs=0.01)
    ahead = hover_thrust(windows(shares=(1.06, 0.94, 0.94, 1.06)), VEHICLE)
    assert [round(share.value, 2) for share in ahead.shares] == [1.06, 0.94, 0.94, 1.06]
    assert ahead.thrust.value == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("resistance", [0.15, 0.23, 0.46])
def test_resistance_comes_from_the_fall_at_take_off_and_not_from_the_discharge(resistance: float) -> None:
    found = hover_thrust(windows(resistance=resistance), VEHICLE).resistance
    assert abs(found.value - resistance) < found.u95 < 0.05


@pytest.mark.parametrize("resistance", [0.23, 0.46])
def test_a_flight_that_was_ended_still_tells_its_battery(resistance: float) -> None:
    run = windows(resistance=resistance).run
    found = resistance_aloft(run, VEHICLE)
    assert found is not None
    assert abs(found.value - resistance) < found.u95
    assert resistance_aloft(replace(run, events=()), VEHICLE) is None


def test_vibration_is_what_is_above_30_hz() -> None:
    each = np.full(4, 0.0934)
    shaken = vibration(windows(shake=0.05), VEHICLE, each)
    assert abs(shaken.gyro.value - 0.05) < 0.002
    assert vibration(windows(), VEHICLE, each).gyro.value < 1e-6
    assert [round(rotor.rate_hz) for rotor in shaken.rotors] == [328] * 4
    assert not any(rotor.told for rotor in shaken.rotors)  # 7 % of the rate is a quarter of the band
    known = replace(VEHICLE.motors.thrust_coefficient, sigma=1e-10)  # type: ignore[type-var]
    sharp = replace(VEHICLE, motors=replace(VEHICLE.motors, thrust_coefficient=known))
    assert vibration(windows(), sharp, each).rotors[0].told


def test_white_noise_behind_the_filter_leaves_in_the_band_what_is_expected() -> None:
    from scipy.signal import butter, lfilter

    rng = np.random.default_rng(5)
    noise = rng.standard_normal((200_000, 3))
    b, a = butter(2, 80.0, fs=1000.0)
    logged = lfilter(b, a, noise, axis=0)[::10]
    power = np.abs(np.fft.rfft(logged, axis=0)) ** 2
    frequencies = np.fft.rfftfreq(len(logged), 0.01)
    band = power[frequencies >= 30.0].sum() / power[1:].sum() * (logged.var(axis=0).sum())
    assert noise_in_band(1.0, 80.0) == pytest.approx(np.sqrt(band), rel=0.02)
    assert folded(np.array([327.0, 370.0, 40.0])) == pytest.approx([27.0, 30.0, 40.0])


def test_frames_that_never_came_are_missing_and_a_gap() -> None:
    whole, holes = stream(windows()), stream(windows(lost=slice(100, 110)))
    assert (whole.missing.value, round(whole.rate.value)) == (0.0, 100)
    assert whole.age.value == pytest.approx(0.006)
    assert holes.missing.value == pytest.approx(10 / 1800, rel=0.02)
    assert holes.longest_gap.value == pytest.approx(0.11)


@pytest.mark.parametrize("scale", [0.6, 1.0, 1.7])
def test_lag_is_that_of_the_motors_whose_commands_and_rates_are_seen(scale: float) -> None:
    found = motor_lag(_doublets(scale), VEHICLE)
    assert found.value == pytest.approx(scale, rel=0.06)
    assert found.u95 < 0.3


def _doublets(scale: float) -> CheckWindows:
    """Commands that tip to and fro, and what the file's motors at `scale` times its lag make of them."""
    still = windows()
    t = np.arange(0.0, still.doublets[1], 0.01)
    push = 3000.0 * np.sign(np.sin(2.0 * np.pi * 1.6 * t)) * (t > still.doublets[0] + 0.2)
    commands = 41500.0 + np.outer(push, [-1.0, 1.0, 1.0, -1.0]) + np.outer(np.roll(push, 40), [-1, -1, 1, 1])
    motors = series(
        "motors", t, **{f"m{i + 1}": column for i, column in enumerate(commands.T)}, drone_time_ms=1e3 * t
    )
    volts = still.run.series["power"].numbers("vbat")[int(100 * still.doublets[0]) :]
    rates = _rates(commands, float(volts.mean()), scale)
    gyro = series("rates", t, gx=rates[:, 0], gy=rates[:, 1], gz=0.0, drone_time_ms=1e3 * t)
    run = replace(still.run, series={**still.run.series, "motors": motors, "rates": gyro})
    return replace(still, run=run)


def _rates(commands: FloatArray, volts: float, scale: float) -> FloatArray:
    from perchhw.hover_check.lag import SCALES
    from perchhw.hover_check.thrust import thrusts_of

    wanted = thrusts_of(VEHICLE.motors.thrust_map_compiled(), commands, np.full(len(commands), volts), 8)
    slow = replace(
        VEHICLE.motors,
        time_constant_up=replace(
            VEHICLE.motors.time_constant_up, value=scale * VEHICLE.motors.time_constant_up.value
        ),
        time_constant_down=replace(
            VEHICLE.motors.time_constant_down, value=scale * VEHICLE.motors.time_constant_down.value
        ),
    )
    unit = int(np.argmin(np.abs(SCALES - 1.0)))
    return _modelled_rates(wanted, replace(VEHICLE, motors=slow))[unit]


def test_a_record_without_its_course_says_so() -> None:
    still = windows()
    with pytest.raises(RecordTooShort, match="no test flight"):
        CheckWindows.of(replace(still.run, events=()), 20.0, 29.0)
    with pytest.raises(RecordTooShort, match="has no motors"):
        hover_thrust(replace(still, run=replace(still.run, series={})), VEHICLE)
