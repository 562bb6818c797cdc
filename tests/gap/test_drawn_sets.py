"""The MuJoCo room as a judge: what it hides acts as our equations say, and its logs can be read."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.flights import open_flights
from calibration.gap.data import prepare_flights
from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.held_out import HeldOutFlights
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.sensors import judge_sensing
from onboard.vehicle import EFFECTS
from onboard.vehicle.effects import Domain
from tests.truth import drawn, paths, pilots
from tests.truth.airframe import Airframe, draw_airframe, nominal
from tests.truth.mujoco_room import STEP, Circumstances, Hidden, fly

CALM = Circumstances(
    integrator="RK4", pilot=pilots.GEOMETRIC, ticks=2, per_line=10, phase=3, speed_law=False,
    compensated=True, battery_lag=0.0, accelerometer=True, voltage=True, rest=0.0, gust=0.05,
    pose_noise=1e-4, angle_noise=5e-4,
)  # fmt: skip
AT_ONCE = ("motor_lag", "inertia_error", "com_offset", "wind")
MOVING = [
    pytest.param(name, marks=() if name in AT_ONCE else pytest.mark.soak)
    for name in drawn.EFFECTS_HERE
    if EFFECTS[name].domain not in (Domain.SENSING, Domain.TIMING) and name != "battery_sag"
]
"""Effects that change how the vehicle moves; the battery's shows in the voltage alone."""


def frame() -> Airframe:
    return draw_airframe(np.random.default_rng(3), *drawn.CLASSES[0])


def flights(hidden: Hidden, folder: Path) -> list[FlightRecord]:
    folder.mkdir(exist_ok=True)
    files = []
    for number, kind in enumerate(("eight", "shake", "climbs")):
        goals = paths.draw_path(np.random.default_rng([5, number]), kind, STEP, 14.0, 0.0, 1.0)
        files.append(folder / f"{kind}.csv")
        drawn.write_log(files[-1], fly(frame(), hidden, CALM, goals, np.random.default_rng([7, number])))
    return prepare_flights(open_flights(files)[0]).records


@cache
def floor(folder: Path) -> NDArray[np.float64]:
    """Errors of the vehicle file where nothing is hidden, by channel."""
    return HeldOutFlights(flights(Hidden(), folder)).errors(Model(nominal(frame(), "floor"))).rms()


@pytest.mark.parametrize("name", MOVING)
def test_our_equation_of_an_effect_predicts_mujocos_flights(
    name: str, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    hidden, effects = drawn.hide(Hidden(), name, "strong", frame(), np.random.default_rng(11))
    measured = HeldOutFlights(flights(hidden, tmp_path / "hidden"))
    vehicle = nominal(frame(), name)
    values = {
        Variable(effect, key): value for effect, all_of in effects.items() for key, value in all_of.items()
    }
    least = floor(tmp_path_factory.getbasetemp() / "floor")
    known = least > 0.0
    without = (measured.errors(Model(vehicle)).rms() / least)[known]
    with_it = (measured.errors(Model(vehicle, values)).rms() / least)[known]
    excess = np.sum(without**2 - 1.0)
    # MuJoCo's drag goes with each component of the speed by itself, ours with the whole of it.
    left = 0.3 if name == "body_drag" else 0.05
    assert np.sum(with_it**2 - 1.0) < left * excess
    assert excess > 0.5


@pytest.mark.parametrize("name", ["pose_rotation", pytest.param("gyro_bias", marks=pytest.mark.soak)])
def test_sensors_of_mujocos_room_err_as_is_hidden(name: str, tmp_path: Path) -> None:
    hidden, effects = drawn.hide(Hidden(), name, "strong", frame(), np.random.default_rng(11))
    pooled = judge_sensing(flights(hidden, tmp_path)).pooled[name]
    for mean, value in zip(pooled, effects[name].values(), strict=True):
        assert mean.error < 0.2 * max(np.abs(list(effects[name].values())))
        assert mean.mean == pytest.approx(value, abs=4.0 * mean.error)


def test_a_set_comes_again_with_its_seed_and_can_be_read(tmp_path: Path) -> None:
    first, again = (drawn.draw_set(6, tmp_path / name) for name in ("first", "again"))
    assert first.answer == again.answer
    assert [file.read_bytes() for file in first.files] == [file.read_bytes() for file in again.files]
    prepared = prepare_flights(open_flights(first.files)[0])
    assert len(prepared.records) == len(first.files)
