"""Attempts with all that is on board in the loop: they are the lab's, and rollouts leave out what decides."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from onboard.policy.bundle import encode_bundle
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.room import RoomGeometry
from onboard.trajectory import fit_approach
from onboard.vehicle import load_vehicle
from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE, AttemptRequest
from perchhw.cli.main import run
from perchhw.flight.attempt import fly_attempt
from perchhw.lab_process import SimulatedLab
from perchhw.learning.as_flown import flyable
from perchhw.learning.grid import Condition
from perchhw.record import read_run
from sim_backend.engine_name import EngineName, usable_engine
from sim_backend.errors import SimulationError
from sim_backend.physics.parameters import PARAMETERS, physics_parameters
from sim_backend.physics.rollout import ROLLOUT, End
from sim_backend.whole_attempt import WholeAttempts

VEHICLE, ROOM = load_vehicle(DEFAULT_VEHICLE), RoomGeometry()
BUNDLE = encode_bundle(load_policy(shipped_policy_path(DEFAULT_POLICY)))
SPEED, ANGLE_DEG = 3.4, 42.5
PLAN = fit_approach(SPEED, ANGLE_DEG, ROOM)


def flown(count: int, engine: EngineName | None = None, seed: int = 0, **changed: float) -> NDArray[np.void]:
    """So many attempts, each with a generator of its own; `changed` replaces physics of the vehicle. They
    fly the code of the lab's drones unless another is asked for."""
    attempts = WholeAttempts(VEHICLE, BUNDLE, usable_engine(engine))
    parameters = np.array([physics_parameters(VEHICLE, ROOM)], dtype=PARAMETERS)
    for name, value in changed.items():
        parameters[name] = value
    outs = np.zeros(count, ROLLOUT)
    for k, out in enumerate(outs):
        attempts.fly(parameters, PLAN, np.random.default_rng((seed, k)), out)
    return outs


@pytest.fixture(scope="module")
def several() -> NDArray[np.void]:
    """Attempts of the vehicle as it is."""
    return flown(12)


@pytest.mark.further
def test_the_labs_flight_is_one_of_them(several: NDArray[np.void], tmp_path: Path) -> None:
    """What the policy saw when it fired in a whole lab, over the real protocols."""
    with SimulatedLab("lab") as lab:
        result = fly_attempt(
            AttemptRequest(
                speed=SPEED,
                angle_deg=ANGLE_DEG,
                index=0,
                folder=tmp_path,
                drone=lab.drones[0],
                mocap=lab.mocap[0],
                policy=DEFAULT_POLICY,
                vehicle=DEFAULT_VEHICLE,
                room=ROOM,
                seed=3,
            )
        )
    assert result.triggered
    seen = read_run(tmp_path).series["trigger"].messages[0]
    for name in ("tau", "theta_x", "d_ceil", "a_rot"):
        low, high = several[name].min(), several[name].max()
        assert low - 0.5 * (high - low) < seen[name] < high + 0.5 * (high - low), name


def test_the_estimate_still_climbs_when_the_drone_no_longer_does(several: NDArray[np.void]) -> None:
    """The accelerometer's filter (7.5 ms) and the filter's means over 10 ms (5 ms) are late: right after the
    acceleration of 3.1 m/s2 along z has ended, the velocity is too large by up to 3.1 m/s2 times 12.5 ms. It
    is seen through cues that are 5 to 10 ms old, at a v_z that has passed its peak."""
    error = several["d_ceil"] / several["tau"] - several["velocity_z"]
    assert np.all(error > 0.01)
    assert error.mean() < 1.5 * PLAN.az * 0.0125


@pytest.mark.further
def test_late_poses_bring_the_trigger_nearer_to_the_ceiling(several: NDArray[np.void]) -> None:
    """The drone is where it takes itself to be that much earlier."""

    def left(outs: NDArray[np.void]) -> float:
        touched = outs[outs["contact"] == 1]
        return float((touched["impact_time"] - touched["trigger_time"]).mean())

    assert left(flown(12, pose_delay=0.01)) < left(several) - 0.005


@pytest.mark.further
def test_both_engines_fly_the_same_attempts() -> None:
    reference, c = (flown(4, engine, seed=2) for engine in (EngineName.REFERENCE, EngineName.C))
    assert reference["triggered"].tolist() == c["triggered"].tolist() == [1] * 4
    np.testing.assert_allclose(c["trigger_time"], reference["trigger_time"], atol=0.011)
    np.testing.assert_allclose(c["velocity_z"], reference["velocity_z"], atol=0.03)


def test_the_same_generator_gives_the_same_attempt(several: NDArray[np.void]) -> None:
    assert flown(1)[0] == several[0]


@pytest.mark.further
def test_a_policy_that_does_not_fire_brakes_below_the_ceiling() -> None:
    attempts = WholeAttempts(VEHICLE, BUNDLE, EngineName.REFERENCE)
    parameters = np.array([physics_parameters(VEHICLE, ROOM)], dtype=PARAMETERS)
    out = np.zeros(1, ROLLOUT)[0]
    far = fit_approach(1.0, 60.0, ROOM)  # slower than anything that the policy knows
    attempts.fly(parameters, far, np.random.default_rng(0), out)
    assert (out["triggered"], out["contact"], out["feet"]) == (0, 0, 0)
    assert out["end"] == End.TIMEOUT
    assert 0.0 < out["d_min"] < 0.6


def test_a_broken_bundle_is_refused() -> None:
    parameters = np.array([physics_parameters(VEHICLE, ROOM)], dtype=PARAMETERS)
    with pytest.raises(SimulationError, match="refuses the policy"):
        WholeAttempts(VEHICLE, BUNDLE[:-4], EngineName.REFERENCE).fly(
            parameters, PLAN, np.random.default_rng(0), np.zeros(1, ROLLOUT)[0]
        )


def test_conditions_that_fit_no_room_are_left_out() -> None:
    fits, does_not = Condition(3.3, 45.0), Condition(3.5, 85.0)
    assert flyable([does_not, fits], ROOM.ceiling_z) == (fits,)


def test_validation_tells_of_them_beside_rollouts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the default vehicle, of which real flights tell too: as a document, and as text."""
    asked = ["learn", "validate", "--policy", "default", "--domain", "none", "--speeds", "3.3,3.5"]
    asked += ["--angles", "45,85", "--rollouts", "3", "--as-flown", "2", "--out", str(tmp_path)]
    assert run(["--json", *asked]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((tmp_path / "validation.json").read_text(encoding="utf-8"))
    assert told["conditions"] == 4
    assert told["as_flown"]["attempts_per_condition"] == 2
    assert 0.0 <= told["real_rate"]["ci95"][0] < told["real_rate"]["ci95"][1] <= 1.0
    with Path(told["as_flown"]["table"]).open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert 0 < len(rows) == told["as_flown"]["conditions"] < 4
    assert run(asked) == 0
    text = capsys.readouterr().out
    assert "to be expected in reality" in text
    assert "with all that is on board" in text


def test_a_grid_that_fits_nowhere_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["learn", "validate", "--policy", "default", "--speeds", "3.5", "--angles", "85"]
    assert run([*asked, "--rollouts", "1", "--as-flown", "1", "--out", str(tmp_path)]) == 2
    assert "campaign plan" in capsys.readouterr().err
