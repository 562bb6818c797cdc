"""Our firmware app in the simulated drone: policy upload, arming, approach, trigger, flip, cut, brake."""

import dataclasses
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from onboard.app_interface import (
    EngineCode,
    LandingState,
    Log,
    Parameter,
    PolicyStatus,
    TrajectoryStatus,
)
from onboard.landing.state_machine import EndReason
from onboard.policy.bundle import encode_bundle
from onboard.policy.files import find_policy, import_authors_policy, load_policy
from onboard.room import RoomGeometry
from onboard.trajectory import ApproachPlan, fit_approach, plan_approach
from onboard.vehicle import load_vehicle
from sim_backend.crazyflie.supervisor import SupervisorState
from sim_backend.engine_name import EngineName
from sim_backend.warm_up import warm_up
from tests.sim_crazyflie.simulated_flight import LEGS, VEHICLE, Flight
from tests.sim_crazyflie.small_policy import small_policy
from tests.tiers import some

pytestmark = pytest.mark.usefixtures("either_engine")

BUNDLE = encode_bundle(small_policy())
PLAN = fit_approach(2.5, 60.0, RoomGeometry())
STEPS_S = 0.004
"""Two steps of the control loop: every request is consumed by then."""


def ready_to_go(plan: ApproachPlan = PLAN, *, policy: bytes | None = BUNDLE, seed: int = 0) -> Flight:
    """A drone that hovers at the start with everything armed."""
    flight = Flight(seed)
    if policy is not None:
        assert flight.upload(policy) == PolicyStatus.ACTIVE
    flight.set_plan(plan)
    flight.fly_to_start(plan)
    if policy is not None:
        flight.write(Parameter.POLICY_ARM, 1)
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED
    return flight


def give(flight: Flight, flag: Parameter) -> None:
    """Write a one-shot flag, and wait for the control loop to consume it."""
    flight.write(flag, 1)
    flight.run(STEPS_S, until=lambda: flight.param(flag) == 0)
    assert flight.param(flag) == 0


def state(flight: Flight) -> LandingState:
    return LandingState(int(flight.log("perch.state")))


def run_until(flight: Flight, wanted: LandingState, seconds: float = 6.0) -> float:
    passed = flight.run(seconds, until=lambda: state(flight) is wanted)
    assert state(flight) is wanted, f"{state(flight).name} instead of {wanted.name}"
    return passed


def test_the_drone_says_which_code_it_runs(either_engine: EngineName) -> None:
    flight = Flight()
    assert EngineCode(int(flight.param(Parameter.ENGINE))).name.lower() == either_engine
    flight.firmware.reboot()
    assert EngineCode(int(flight.param(Parameter.ENGINE))).name.lower() == either_engine


def test_trajectory_arming_is_refused_with_a_reason() -> None:
    flight = Flight()
    flight.set_plan(PLAN)
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.REFUSED_NOT_FLYING
    assert flight.param(Parameter.TRAJECTORY_ARM) == 0
    flight.hover(0.5)
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.REFUSED_TOO_FAR
    flight.run(0.1)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.REFUSED_TOO_FAR, "it stays readable"
    flight.write(Parameter.ACCELERATION_X, 0.0)
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.REFUSED_NUMBERS
    give(flight, Parameter.GO)
    assert state(flight) is LandingState.IDLE


def test_approach_triggers_flips_cuts_and_lands_on_four_feet() -> None:
    flight = ready_to_go(seed=1)
    give(flight, Parameter.GO)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.FLYING
    run_until(flight, LandingState.FLIP)
    assert flight.log("perchT.count") == 1
    assert flight.log("perchT.trigVal") >= 0.0
    assert flight.log("perchT.aRot") == pytest.approx(-5.5e-3)
    # The authors' flights: v_z +0.07 +- 0.09 m/s, v_x -0.17 +- 0.27 m/s, pitch 4.5 +- 4.3 deg.
    assert flight.log("perchT.vz") == pytest.approx(PLAN.vz, abs=0.1)
    assert flight.log("perchT.vx") == pytest.approx(PLAN.vx, abs=0.1)
    assert abs(flight.log("perchT.pitch")) < 0.1
    # The firmware's own filter, linked against our physics: +14 to +19 mm/s and -15 to -18 mm.
    truth, estimator = flight.drone.state, flight.firmware.estimator
    assert 0.012 < estimator.velocity()[2] - truth["velocity"][2] < 0.021
    assert -0.021 < estimator.position()[2] - truth["position"][2] < -0.014
    assert flight.log("perchT.dCeil") == pytest.approx(2.1 - flight.position[2], abs=0.06)
    assert flight.log("perchT.tau") == pytest.approx(
        flight.log("perchT.dCeil") / flight.log("perchT.vz"), rel=0.01
    )
    assert abs(flight.log("perchT.tick") - flight.firmware.tick_ms()) <= 2
    flight.run(0.02)
    ratios = flight.firmware.ratios
    assert ratios[0] == ratios[3] > 20000
    assert ratios[1] == ratios[2] == 0
    flip = run_until(flight, LandingState.CUT, 0.5)
    assert 0.12 < flip < 0.35
    assert not flight.firmware.ratios.any()
    flight.run(3.0)
    truth = flight.drone.state
    assert truth["foot_attached"].sum() == 4
    assert not truth["body_contact"]
    assert flight.firmware.supervisor.state is SupervisorState.CRASHED, "hanging upside down is a tumble"
    assert not flight.firmware.ratios.any()


def test_a_wrong_pose_in_the_flip_does_not_move_the_cut() -> None:
    cuts = []
    for bad in (False, True):
        flight = ready_to_go()
        flight.write(Parameter.GO, 1)
        run_until(flight, LandingState.FLIP)
        flight.run(0.05)
        if bad:
            x, y, z = flight.position
            flight.firmware.localization.external_pose(x, y, z, 0.0, 0.98, 0.0, 0.2)
        cuts.append(run_until(flight, LandingState.CUT, 0.5))
    assert cuts[1] == pytest.approx(cuts[0], abs=0.003)


def test_cut_is_latched_until_disarmed_and_not_flying() -> None:
    flight = ready_to_go()
    flight.write(Parameter.GO, 1)
    run_until(flight, LandingState.CUT)
    flight.run(2.0)
    assert state(flight) is LandingState.CUT
    flight.write(Parameter.TRAJECTORY_ARM, 0)
    flight.write(Parameter.POLICY_ARM, 0)
    flight.run(1.0)
    assert state(flight) is LandingState.IDLE
    assert not flight.firmware.ratios.any()


def test_missed_trigger_brakes_below_the_ceiling_and_hands_back() -> None:
    plan = plan_approach(1.0, 60.0, 0.0, 2.1, 1.0, 3.1, 0.5)
    flight = ready_to_go(plan, policy=None)
    flight.write(Parameter.GO, 1)
    run_until(flight, LandingState.BRAKE)
    assert flight.firmware.app is not None
    assert flight.firmware.engine.reason is EndReason.MISSED_TRIGGER
    run_until(flight, LandingState.HOLD)
    flight.run(3.0)
    assert not flight.drone.state["ceiling_contact"]
    here = flight.position
    flight.write(Parameter.TRAJECTORY_ARM, 0)
    flight.run(2.0)
    assert state(flight) is LandingState.IDLE
    assert flight.position == pytest.approx(here, abs=0.15)
    assert flight.land() == 0
    flight.run(5.0)
    assert flight.position[2] < 0.1


@pytest.mark.parametrize("climb", some([1.25, 1.75], 2))
def test_a_policy_that_does_not_fire_brakes_below_the_ceiling(climb: float) -> None:
    """The shipped policy's range, a vertical approach, and the errors of the filter."""
    default = load_policy(find_policy("default"))
    never = encode_bundle(dataclasses.replace(default, intercept=np.float32(-1e3)))
    flight = ready_to_go(plan_approach(climb, 89.0, 0.0, 2.1, 1.0, 3.1, 0.5), policy=never)
    flight.write(Parameter.GO, 1)
    run_until(flight, LandingState.HOLD)
    assert flight.firmware.engine.reason is EndReason.MISSED_TRIGGER
    assert not flight.drone.state["ceiling_contact"]
    flight.write(Parameter.POLICY_ARM, 0)
    flight.write(Parameter.TRAJECTORY_ARM, 0)
    run_until(flight, LandingState.IDLE)
    assert flight.land() == 0
    flight.run(5.0)
    assert flight.position[2] < 0.1
    assert flight.info.can_fly  # its supervisor saw neither a tumble nor a crash


def test_abort_brakes() -> None:
    flight = ready_to_go()
    flight.write(Parameter.GO, 1)
    flight.run(1.2)
    give(flight, Parameter.ABORT)
    assert state(flight) in (LandingState.BRAKE, LandingState.HOLD)
    flight.run(3.0)
    assert state(flight) is LandingState.HOLD
    assert np.abs(flight.drone.state["velocity"]).max() < 0.1
    assert flight.log("perchT.count") == 0


def test_an_approach_ends_where_somebody_changes_the_configuration_and_nothing_falls() -> None:
    flight = ready_to_go()
    flight.write(Parameter.GO, 1)
    flight.run(1.2)
    flight.write("powerDist.idleThrust", 7000)
    flight.run(3.0)
    assert state(flight) is LandingState.HOLD
    assert flight.info.is_flying
    assert np.abs(flight.drone.state["velocity"]).max() < 0.1
    assert flight.log("perchT.count") == 0


def test_poses_that_stop_end_the_approach() -> None:
    flight = ready_to_go()
    flight.write(Parameter.GO, 1)
    flight.run(1.0)
    flight.poses = False
    flight.run(0.3)
    assert flight.firmware.app is not None
    assert flight.firmware.engine.reason is EndReason.POSE_LOST
    assert flight.log("perchT.count") == 0


def test_a_hold_whose_estimate_is_lost_carries_its_weight_and_then_cuts() -> None:
    flight = ready_to_go()
    flight.write(Parameter.GO, 1)
    flight.run(1.2)
    give(flight, Parameter.ABORT)
    run_until(flight, LandingState.HOLD)
    flight.run(1.5)
    sinking = float(flight.drone.state["velocity"][2])
    flight.poses = False
    flight.firmware.localization.external_pose(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    flight.run(0.45)
    assert state(flight) is LandingState.HOLD
    assert float(flight.drone.state["velocity"][2]) == pytest.approx(sinking, abs=0.3)
    assert flight.position[2] > 0.3
    flight.run(0.1)
    assert state(flight) is LandingState.FAULT
    assert not flight.firmware.ratios.any()


def test_nobody_flies_against_a_stop() -> None:
    for stop in ("high level stop", "emergency stop", "disarm"):
        flight = ready_to_go()
        flight.write(Parameter.GO, 1)
        flight.run(1.5)
        if stop == "high level stop":
            flight.firmware.high_level.stop()
        elif stop == "disarm":
            flight.firmware.supervisor.arm(False)
        else:
            flight.firmware.supervisor.emergency_stop()
        flight.run(0.1)
        assert not flight.firmware.ratios.any(), stop
        flight.run(2.0)
        assert flight.position[2] < 0.4, stop


def test_authors_policy_fires_on_the_simulated_drone(shared_data: Path) -> None:
    policy = import_authors_policy(shared_data / "habas2022" / "policy" / "flown_policy.json")
    flight = ready_to_go(policy=encode_bundle(policy))
    flight.write(Parameter.GO, 1)
    run_until(flight, LandingState.CUT)
    flight.run(2.0)
    assert flight.log("perchT.count") == 1
    assert 0.15 < flight.log("perchT.tau") < 0.3
    assert -9.6e-3 < flight.log("perchT.aRot") < -3e-3
    assert flight.drone.state["foot_attached"].sum() >= 2


def test_warm_up_compiles_everything_that_a_flight_calls() -> None:
    warm_up(load_vehicle(VEHICLE, LEGS))
    before = compiled_signatures()
    for end in (LandingState.CUT, LandingState.BRAKE):
        flight = ready_to_go()
        flight.write(Parameter.GO, 1)
        if end is LandingState.BRAKE:
            flight.run(0.3)
            flight.write(Parameter.ABORT, 1)
        run_until(flight, end)
        flight.run(1.0)
    assert compiled_signatures() == before


def compiled_signatures() -> dict[str, int]:
    """How many versions of each kernel of ours are compiled in this process."""
    found = {}
    for name, module in list(sys.modules.items()):
        if name.startswith(("onboard.", "sim_backend.")):
            for value in vars(module).values():
                if isinstance(value, Dispatcher):
                    function = value.py_func
                    found[f"{function.__module__}.{function.__qualname__}"] = len(value.signatures)
    return found


def test_a_log_of_the_motors_is_their_mean_over_its_interval() -> None:
    flight = Flight(seed=3)
    flight.run(1.0)
    flight.arm()
    flight.run(1.0, until=lambda: flight.info.can_fly)
    flight.takeoff(0.5)
    flight.run(0.7)
    given = []
    for _ in range(5):
        flight.run(0.002)
        given.append([flight.log(f"motor.m{motor}req") for motor in range(1, 5)])
    means = [flight.log(name) for name in (Log.MEAN_M1, Log.MEAN_M2, Log.MEAN_M3, Log.MEAN_M4)]
    assert means == pytest.approx(np.mean(given, axis=0), abs=2.0)
    assert np.ptp(given, axis=0).max() > 20.0, "a mean of the same numbers would show nothing"
