"""The public tables against our earlier fits (bench notes 2.3, acceptance 11); the paper's as quadratics."""

from pathlib import Path

import numpy as np
import pytest

from calibration.bench.thrust.analysis import analyse, read_table
from calibration.bench.thrust.compensation import achievable
from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.figures import curve_figure, validation_figure
from calibration.bench.thrust.shape import firmware_inverse, inverse
from calibration.bench.thrust.thrust_result import ThrustResult, flyable_map, imported_json
from onboard.battery import thrust_from_voltage, voltage_from_thrust
from onboard.json_file import as_json
from onboard.vehicle.file_format import read_thrust_map
from onboard.vehicle.model import ThrustMapDescription

GF = 9.80665e-3


@pytest.fixture(scope="module")
def folder(shared_data: Path) -> Path:
    return shared_data / "bench" / "thrust"


def fitted(path: Path) -> ThrustResult:
    table = read_table(path)
    assert isinstance(table, ThrustData)
    return analyse(table)


def maps(path: Path) -> dict[str, ThrustMapDescription]:
    table = read_table(path)
    assert isinstance(table, dict)
    return table


@pytest.mark.parametrize(
    ("file", "cubic", "log", "points"),
    [("bitcraze_2015_cf20.csv", 0.150, 0.141, 15), ("forster_cmd_thrust.csv", 0.095, 0.107, 30)],
)
def test_fits_are_those_of_the_notes(folder: Path, file: str, cubic: float, log: float, points: int) -> None:
    result = fitted(folder / file)
    assert result.data.voltage.size == points
    assert result.forms["firmware_cubic"].fit.rms == pytest.approx(cubic, abs=2e-3)
    assert result.forms["two_region_log"].fit.rms == pytest.approx(log, abs=3e-3)
    assert result.forms["quadratic_through_zero"].fit.rms > result.forms["firmware_cubic"].fit.rms
    assert result.chosen == "firmware_cubic"
    content = as_json(result)
    assert content["chosen"] == "firmware_cubic"
    assert content["rms_gf"] == result.best.fit.rms
    assert all(content["forms"][name]["coefficients"]["break_thrust" if name != "firmware_cubic" else "c0"]
               for name in ("firmware_cubic", "two_region_log", "two_quadratic"))  # fmt: skip
    for figure in (curve_figure(result), validation_figure(result)):
        assert figure.axes[0].lines


def test_corrected_aic_of_the_notes(folder: Path) -> None:
    forms = fitted(folder / "bitcraze_2015_cf20.csv").forms
    expected = {
        "firmware_cubic": -40.3,
        "two_region_log": -42.1,
        "quadratic_through_zero": -28.3,
        "text_log": -34.2,
    }
    assert {name: round(forms[name].aicc, 1) for name in expected} == expected


def test_vehicle_map_gives_the_fitted_curve(folder: Path) -> None:
    result = fitted(folder / "bitcraze_2015_cf20.csv")
    voltage = np.linspace(0.3, 3.0, 30)
    for name in ("firmware_cubic", "two_region_log", "two_quadratic"):
        compiled = flyable_map(result, name).compiled()
        there = np.array([thrust_from_voltage(compiled, v) for v in voltage]) / GF
        np.testing.assert_allclose(
            there, np.maximum(result.forms[name].fit.thrust_at(voltage), 0.0), atol=1e-9
        )
        assert all(one.sigma >= 0.0 for one in flyable_map(result, name).coefficients.values())
    with pytest.raises(ThrustTableError, match="may not fly"):
        flyable_map(result, "text_log")


def test_every_usable_map_is_smooth_and_invertible(folder: Path) -> None:
    for file in ("bitcraze_2015_cf20.csv", "forster_cmd_thrust.csv"):
        result = fitted(folder / file)
        highest = result.thrust_max.value
        for report in result.forms.values():
            if not report.usable:
                continue
            assert report.map is not None
            compiled = report.map.compiled()
            grid = np.arange(1e-3, 4.3, 1e-3)
            thrust = np.array([thrust_from_voltage(compiled, v) for v in grid])
            assert np.all(np.diff(thrust[thrust > 0.0]) > 0.0)
            assert np.all(np.isfinite(inverse(compiled, np.linspace(0.0, 1.2 * highest, 200))))
            step = voltage_from_thrust(compiled, 5.0000001 * GF) - voltage_from_thrust(
                compiled, 4.9999999 * GF
            )
            assert 0.0 < step < 1e-3


def test_papers_table_comes_in_as_quadratics(folder: Path) -> None:
    table = maps(folder / "seed_table_coeffs.csv")
    for motor, low, high in (("stock", 1.932, 1.975), ("upgraded", 1.470, 1.490)):
        compiled = table[motor].compiled()
        assert voltage_from_thrust(compiled, 5.0 * GF) == pytest.approx(low, abs=1e-3)
        assert voltage_from_thrust(compiled, 5.0000001 * GF) == pytest.approx(high, abs=1e-3)
        assert "header misprint" in table[motor].coefficients["low_a"].source
        library = read_thrust_map(f"paper-{motor}").compiled()
        np.testing.assert_allclose(compiled.coefficients, library.coefficients, rtol=1e-12)
    content = imported_json(table)
    assert set(content["forms"]) == {"stock", "upgraded"}
    assert content["rms_gf"] is None


def test_bitcrazes_cubics_survive_single_precision(folder: Path) -> None:
    for name, description in maps(folder / "bitcraze_2025_poly.csv").items():
        compiled = description.compiled()
        thrust = np.linspace(0.0193, {"T350": 0.18, "B500": 0.2}.get(name, 0.12), 300)
        error = firmware_inverse(compiled.coefficients[:4], thrust) - inverse(compiled, thrust)
        assert np.max(np.abs(error)) < 2e-4, name
        assert achievable(compiled, 3.2) < achievable(compiled, 3.8)


def test_another_table_is_refused(folder: Path) -> None:
    with pytest.raises(ThrustTableError, match="is not of a thrust table"):
        read_table(folder / "forster_thrust_torque.csv")
