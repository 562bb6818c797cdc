"""The error of the integrator that docs/physics.md states, as its benchmark prints it."""

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def printed() -> dict[str, Any]:
    command = [sys.executable, str(ROOT / "benchmarks" / "integrator_error.py"), "--landings", "150"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


@pytest.mark.further
def test_free_flight_is_second_order(printed: dict[str, Any]) -> None:
    """Halving the step divides every error by four."""
    orders = np.array(list(printed["free_flight"]["order"].values()))
    assert np.all((orders > 1.95) & (orders < 2.05)), orders


@pytest.mark.further
def test_landings_at_1_khz_agree_with_8_khz(printed: dict[str, Any]) -> None:
    """150 random landings, all outcomes among them."""
    landings = printed["landings"]
    assert landings["outcomes"]["four_leg"] > 50
    assert len(landings["outcomes"]) >= 4
    error = landings["against_8_khz"]["1_khz"]
    assert error["same_outcome"] >= 0.98
    assert error["impact_time_ms"]["median"] < 0.005
    assert error["impact_tilt_deg"]["median"] < 0.01
    assert error["impact_tilt_deg"]["q95"] < 1.0
    assert error["place_mm"]["median"] < 0.3
    assert error["place_mm"]["q95"] < 10.0
    assert error["place_without_hull_contact_mm"]["q95"] < 1.0


@pytest.mark.further
def test_landings_converge(printed: dict[str, Any]) -> None:
    """Each halving of the step brings the place of rest nearer to that of 64 kHz."""
    fine = printed["landings"]["against_64_khz"]
    places = [fine[f"{rate}_khz"]["place_mm"]["median"] for rate in (1, 2, 4, 8)]
    assert all(finer < 0.75 * coarser for coarser, finer in pairwise(places)), places
