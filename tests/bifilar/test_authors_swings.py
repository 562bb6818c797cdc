"""The authors' logs: 18 with host stamps (2022), six from cfclient (2024)."""

import math
from pathlib import Path

import numpy as np
import pytest

from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.inertia import formula_inertia
from calibration.bench.inertia.paper import peak_period
from calibration.bench.inertia.recordings import read_swing
from calibration.bench.inertia.rig import Rig
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.measurement import Estimate

MEANS_2022 = {  # s, notes of the bench, section 2.5
    "BaseModel__BaseModel_Ixx": 2.2044,
    "BaseModel__BaseModel_Iyy": 2.1560,
    "BaseModel__BaseModel_Izz": 3.1221,
    "Narrow_Medium__NarrowMedium_Ixx": 2.6744,
    "Narrow_Medium__NarrowMedium_Iyy": 2.7524,
    "Narrow_Medium__NarrowMedium_Izz": 3.4695,
}
PERIODS_2024 = {
    "Ixx_1": 0.6003,
    "Ixx_2": 0.6744,
    "Ixx_3": 0.7429,
    "Iyy_1": 0.6224,
    "Iyy_2": 0.7066,
    "Izz_1": 0.8032,
}
AXES = {"xx": (1.0, 0.0, 0.0), "yy": (0.0, 1.0, 0.0), "zz": (0.0, 0.0, 1.0)}


@pytest.fixture(scope="module")
def folder(shared_data: Path) -> Path:
    return shared_data / "habas2022"


def fit(path: Path) -> SwingFit:
    return fit_swing(read_swing(path, AXES[path.stem[-8:-6]]))


@pytest.mark.parametrize("group", MEANS_2022)
def test_repeated_logs_agree(folder: Path, group: str) -> None:
    fits = [fit(path) for path in sorted((folder / "bifilar_2022").glob(f"{group}_Log-?.csv"))]
    periods = np.array([one.period.value for one in fits])
    assert len(periods) == (4 if group.startswith("Base") else 2)
    assert np.mean(periods) == pytest.approx(MEANS_2022[group], rel=5e-4)
    assert np.max(np.abs(periods / np.mean(periods) - 1.0)) < 0.003
    assert np.std(periods, ddof=1) / np.mean(periods) < 0.0015
    for one in fits:
        codes = {finding.code for finding in one.findings}
        assert codes <= {"few_cycles", "large_amplitude", "host_time"}
        assert "host_time" in codes
        assert math.radians(10.0) < one.start_amplitude < math.radians(26.0)
        assert 0.004 < one.damping_ratio < 0.009


@pytest.mark.parametrize("name", PERIODS_2024)
def test_client_logs(folder: Path, name: str) -> None:
    path = folder / "bifilar_2024" / f"{name}.csv"
    one = fit_swing(read_swing(path, AXES[name[1:3]]))
    assert one.period.value == pytest.approx(PERIODS_2024[name], rel=5e-4)
    assert one.clock == "drone"
    assert one.loss == 0.0
    assert 0.002 < one.sine_period / one.period.value - 1.0 < 0.009
    assert not one.rejected


def test_a_plain_pendulum_is_not_taken_for_a_torsion(folder: Path) -> None:
    """The vehicle swings about two axes at once there: 1.48 s and 2.31 s."""
    found = fit_swing(read_swing(folder / "bifilar_2022" / "BaseModel__BaseModel_Gravity_Log-1.csv"))
    assert "cross_axis" in {finding.code for finding in found.findings}


def test_the_authors_value_comes_from_their_estimator(folder: Path) -> None:
    swing = read_swing(folder / "bifilar_2022" / "BaseModel__BaseModel_Iyy_Log-4.csv")
    separation = Estimate(0.031, "m", 0.0)
    rig = Rig(
        Estimate(0.0343, "kg", 0.0),
        separation,
        separation,
        Estimate(0.572, "m", 0.0),
        gravity=Estimate(9.8066, "m/s2", 0.0),
    )
    theirs = formula_inertia(peak_period(swing), rig)
    ours = formula_inertia(fit_swing(swing).period.value, rig)
    assert theirs == pytest.approx(16.99e-6, rel=1e-3)
    assert theirs / ours - 1.0 == pytest.approx(0.019, abs=0.002)


def test_their_estimator_fails_where_the_note_says(folder: Path) -> None:
    wrong = set()
    for group, period in MEANS_2022.items():
        for path in (folder / "bifilar_2022").glob(f"{group}_Log-?.csv"):
            if abs(peak_period(read_swing(path)) / period - 1.0) > 0.1:
                wrong.add(path.stem)
    assert wrong == {
        "BaseModel__BaseModel_Izz_Log-1",
        "Narrow_Medium__NarrowMedium_Iyy_Log-1",
        "Narrow_Medium__NarrowMedium_Iyy_Log-2",
        "Narrow_Medium__NarrowMedium_Izz_Log-1",
        "Narrow_Medium__NarrowMedium_Izz_Log-2",
    }
