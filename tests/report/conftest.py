"""Runs to report on."""

from pathlib import Path

import numpy as np
import pytest

from onboard.vehicle import Vehicle, load_vehicle
from perchhw.record import RunRecorder
from tests.label.simulated import land
from tests.report.recorded import record_landing


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
