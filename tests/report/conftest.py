"""Runs to report on."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from onboard.vehicle import Vehicle, load_vehicle
from perchhw.cli.main import run
from perchhw.record import RunRecorder
from tests.label.simulated import land
from tests.report.recorded import record_landing

STORED = ("--vehicle", "crazyflie21-upgraded-stored")
"""Feet that always hold: pairs of a small grid suffice to train on."""


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    return load_vehicle("crazyflie21-upgraded")


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory, vehicle: Vehicle) -> Path:
    """A folder with two landings and an attempt that was refused before it began."""
    root = tmp_path_factory.mktemp("runs")
    rng = np.random.default_rng(4)
    for number, (speed, angle, tau) in enumerate(((3.0, 70.0, 0.23), (2.0, 40.0, 0.20))):
        landing = land(vehicle, speed, angle, tau, -7e-3, rng)
        record_landing(landing, root / f"run-{number}", vehicle, speed, angle)
    with RunRecorder(root / "run-2", {"speed_m_s": 2.0, "angle_deg": 55.0}) as recorder:
        recorder.event("refused", 1.0, reason="battery <3.2 V & falling")
        recorder.close(outcome="aborted", aborted_by="battery <3.2 V & falling")
    return root


@pytest.fixture(scope="session")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small folder of ``perchhw learn all``; not to be changed."""
    folder = tmp_path_factory.mktemp("learned") / "runs"
    grid = ["--speeds", "2.0,2.5,3.0", "--angles", "40,50,60", "--repeats", "2"]
    assert (
        run(
            [
                "learn",
                "all",
                *STORED,
                *grid,
                "--sensing",
                "realistic",
                "--rollouts",
                "6",
                "--out",
                str(folder),
            ]
        )
        == 0
    )
    return folder


@pytest.fixture
def copy_of_learned(learned: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(learned, tmp_path / "learned"))


@pytest.fixture(scope="session")
def leg_study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small folder of ``perchhw learn legs``; not to be changed."""
    folder = tmp_path_factory.mktemp("legs") / "runs"
    designs = ["--designs", "narrow-short,wide-long"]
    grid = ["--speeds", "2.0,3.0", "--angles", "40,70,90", "--repeats", "1", "--rollouts", "6"]
    assert run(["learn", "legs", *designs, *grid, "--out", str(folder)]) == 0
    return folder
