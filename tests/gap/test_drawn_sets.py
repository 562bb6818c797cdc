"""The MuJoCo room as a judge: what it hides acts as our equations say, and its logs can be read."""

from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.flights import open_flights
from calibration.gap.data import prepare_flights
from calibration.gap.estimate.held_out import HeldOutFlights
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.sensors import judge_sensing
from onboard.vehicle import EFFECTS
from onboard.vehicle.effects import Domain
from tests.gap.mujoco_flights import flights, frame
from tests.truth import drawn
from tests.truth.airframe import G, nominal
from tests.truth.mujoco_room import Hidden, build, pose_lead

AT_ONCE = ("motor_lag",)
MOVING = [
    pytest.param(name, marks=() if name in AT_ONCE else pytest.mark.further)
    for name in drawn.EFFECTS_HERE
    if EFFECTS[name].domain not in (Domain.SENSING, Domain.TIMING) and name != "battery_sag"
]
"""Effects that change how the vehicle moves; the battery's shows in the voltage alone."""


@cache
def floor() -> NDArray[np.float64]:
    """Errors of the vehicle file where nothing is hidden, by channel."""
    return HeldOutFlights(flights(Hidden())).errors(Model(nominal(frame(), "floor"))).rms()


@pytest.mark.parametrize("name", MOVING)
def test_our_equation_of_an_effect_predicts_mujocos_flights(name: str) -> None:
    hidden, effects = drawn.hide(Hidden(), name, "strong", frame(), np.random.default_rng(11))
    measured = HeldOutFlights(flights(hidden))
    vehicle = nominal(frame(), name)
    values = {
        Variable(effect, key): value for effect, all_of in effects.items() for key, value in all_of.items()
    }
    least = floor()
    known = least > 0.0
    without = (measured.errors(Model(vehicle)).rms() / least)[known]
    with_it = (measured.errors(Model(vehicle, values)).rms() / least)[known]
    excess = np.sum(without**2 - 1.0)
    # MuJoCo's drag goes with each component of the speed by itself, ours with the whole of it.
    left = 0.3 if name == "body_drag" else 0.05
    assert np.sum(with_it**2 - 1.0) < left * excess
    assert excess > 0.5


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("pose_rotation", marks=pytest.mark.further),
        pytest.param("gyro_bias", marks=pytest.mark.soak),
    ],
)
def test_sensors_of_mujocos_room_err_as_is_hidden(name: str) -> None:
    hidden, effects = drawn.hide(Hidden(), name, "strong", frame(), np.random.default_rng(11))
    pooled = judge_sensing(flights(hidden)).pooled[name]
    for mean, value in zip(pooled, effects[name].values(), strict=True):
        assert mean.error < 0.2 * max(np.abs(list(effects[name].values())))
        assert mean.mean == pytest.approx(value, abs=4.0 * mean.error)


@pytest.mark.further  # test_truth_flights asks it of the other program
def test_a_set_comes_again_with_its_seed_and_can_be_read(tmp_path: Path) -> None:
    first, again = (drawn.draw_set(6, tmp_path / name) for name in ("first", "again"))
    assert first.answer == again.answer
    assert [file.read_bytes() for file in first.files] == [file.read_bytes() for file in again.files]
    prepared = prepare_flights(open_flights(first.files)[0])
    assert len(prepared.records) == len(first.files)


def test_a_body_whose_inertia_is_wrong_can_still_be() -> None:
    for seed in range(200):
        hidden, _ = drawn.hide(Hidden(), "inertia_error", "strong", frame(), np.random.default_rng(seed))
        *small, large = sorted(
            np.array([frame().ix, frame().iy, frame().iz]) * (1.0 + np.array(hidden.inertia))
        )
        assert sum(small) > large


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast", "Euler"])
def test_a_fall_in_mujoco_is_ahead_of_its_velocity_by_what_the_logs_take_back(integrator: str) -> None:
    model = build(frame(), Hidden(), integrator, 0.0, 0.0)
    data = mujoco.MjData(model)
    data.qpos[2] = 10.0
    for _ in range(200):
        mujoco.mj_step(model, data)
    velocity = data.qvel[2]
    fallen = 10.0 - data.qpos[2]
    # From rest a body falls v^2 / 2g; one that is ahead by a time has fallen v times that time more.
    lead = (fallen - 0.5 * velocity**2 / G) / abs(velocity)
    assert lead == pytest.approx(pose_lead(integrator), abs=1e-6)
