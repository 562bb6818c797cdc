"""A rehearsal on the drone's own model: what it flies, what the verdict says, both engines the same."""

import numpy as np
import pytest

from onboard.app_interface import EndReason, LandingState, Log, Parameter, Rehearsal, TrajectoryStatus
from onboard.firmware.compiler import find_compiler
from onboard.policy.bundle import encode_bundle
from onboard.ring import Ring, decode_ring
from onboard.rotation import body_z
from perchhw.rehearsal.verdict import judge
from sim_backend.engine_name import EngineName
from sim_backend.lab_faults import DroneFaults
from tests.rehearsal.desk import PLAN, POLICY, TRUE, Desk
from tests.sim_crazyflie.simulated_flight import ENGINES, Flight

START = (PLAN.x0, PLAN.y0, PLAN.z0)
APART = 2e-4
"""m, m/s, 1 and, times ten, rad/s: two programs that fly for two seconds and a half by their own numbers,
one of them in float32."""


@pytest.fixture(scope="module", params=ENGINES[:2])
def engine(request: pytest.FixtureRequest) -> EngineName:
    engine = EngineName(request.param)
    if engine is EngineName.C and find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot rehearse")
    return engine


@pytest.fixture(autouse=True)
def flown_by(engine: EngineName, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Flight, "engine", engine)


def rehearsed(engine: EngineName, faults: DroneFaults | None = None) -> Ring:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Flight, "engine", engine)
        return Desk(faults, Rehearsal.MODEL).rehearse()


@pytest.fixture(scope="module")
def rings() -> dict[EngineName, Ring]:
    """Of each engine, once asked for."""
    return {}


@pytest.fixture
def ring(engine: EngineName, rings: dict[EngineName, Ring]) -> Ring:
    return rings.setdefault(engine, rings.get(engine) or rehearsed(engine))


def model(desk: Desk) -> list[float]:
    return [desk.flight.log(name) for name in Log if name.startswith("perchM.")]


def test_the_verdict_passes_and_the_model_flew_the_approach(ring: Ring) -> None:
    verdict = judge(ring, EndReason.TRIGGERED, PLAN, POLICY, TRUE)
    assert verdict.failures == ()
    assert verdict.trigger_sample_difference == 0
    away = verdict.input_difference
    assert away is not None
    assert 0.0 < away["position_m"] < 0.05, "the law has an error of its own"
    assert 0.0 < away["velocity_m_s"] < 0.15
    assert abs(away["tau_s"]) < 0.002


def test_the_model_flips_as_the_law_asks_it_to(ring: Ring) -> None:
    """With poses from the host the flip runs into its time limit; here the body turns, and so it is cut."""
    law = ring.periods["law"][:, 0]
    at = ring.ticks.tolist().index(ring.end_tick)
    upright = np.array([body_z(q)[2] for q in law["estimate"]["quaternion"].astype(float)])
    own = np.array([body_z(q)[2] for q in law["own_attitude"].astype(float)])
    assert upright[: at + 1].min() > 0.9
    cut = int(np.argmax(law["thrusts"][at + 1 :].max(axis=1) == 0.0)) + at + 1
    assert upright[cut - 1] > 0.0 > upright[cut + 1]
    assert 0.05 < (ring.ticks[cut] - ring.end_tick) / 1000.0 < 0.3
    assert law["estimate"]["gyro"][cut, 1] < -10.0, "nose up"
    assert np.abs(own - upright).max() < 0.02


def test_both_engines_fly_it_alike(rings: dict[EngineName, Ring]) -> None:
    if find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot rehearse")
    c, reference = (
        rings.setdefault(name, rings.get(name) or rehearsed(name))
        for name in (EngineName.C, EngineName.REFERENCE)
    )
    assert c.end_tick == reference.end_tick, "the same sample"
    assert np.array_equal(c.ticks, reference.ticks)
    for name, most in (
        ("position", APART),
        ("velocity", APART),
        ("quaternion", APART),
        ("gyro", 10.0 * APART),
    ):
        found = np.abs(c.periods["law"]["estimate"][name] - reference.periods["law"]["estimate"][name]).max()
        assert found <= most, (name, found)


def test_one_weight_changed_on_the_drone_fails(engine: EngineName) -> None:
    ring = rehearsed(engine, DroneFaults(policy_weight=1.001))
    verdict = judge(ring, EndReason.TRIGGERED, PLAN, POLICY, TRUE)
    assert not verdict.passed
    assert any("moment differs" in failure for failure in verdict.failures)


def test_an_armed_approach_finds_the_model_at_its_start_each_time() -> None:
    desk = Desk(kind=Rehearsal.MODEL)
    desk.flight.upload(encode_bundle(POLICY))
    assert desk.begin()
    desk.flight.run(0.05)
    assert model(desk) == pytest.approx([0.0] * 6, abs=1e-5)
    desk.flight.set_plan(PLAN)
    for _ in range(2):
        desk.flight.write(Parameter.TRAJECTORY_ARM, 1)
        assert desk.flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED
        desk.flight.run(0.5)
        assert model(desk) == pytest.approx([*START, 0.0, 0.0, 0.0], abs=1e-5)
        desk.flight.write(Parameter.GO, 1)
        desk.flight.run(0.8)
        assert model(desk)[0] > PLAN.x0 + 0.2
        desk.flight.write(Parameter.TRAJECTORY_ARM, 0)
        desk.flight.run(3.0, until=lambda: desk.state() is LandingState.IDLE)
        assert desk.state() is LandingState.IDLE


def test_numbers_that_are_no_approach_are_refused_and_leave_the_model() -> None:
    desk = Desk(kind=Rehearsal.MODEL)
    assert desk.begin()
    desk.flight.set_plan(PLAN._replace(vx=float("nan")))
    desk.flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert desk.flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.REFUSED_NUMBERS
    assert model(desk) == pytest.approx([0.0] * 6, abs=1e-5)


def test_poses_of_somebody_else_do_not_move_it(ring: Ring) -> None:
    desk = Desk(kind=Rehearsal.MODEL)
    desk.arm()
    desk.flight.write(Parameter.GO, 1)
    for ms in range(round(1000 * (PLAN.impact_time + 1.0))):
        if ms % 10 == 0:
            desk.flight.firmware.localization.external_pose(4.0, 2.0, 0.1, 0.0, 0.0, 0.0, 1.0)
        desk.flight.tick()
    disturbed = decode_ring(desk.flight.firmware.engine.record())
    assert np.array_equal(disturbed.ticks, ring.ticks)
    assert np.array_equal(disturbed.periods["law"]["estimate"], ring.periods["law"]["estimate"])


@pytest.mark.parametrize("number", [3, 255])
def test_a_kind_that_is_none_is_refused(number: int) -> None:
    desk = Desk()
    desk.flight.write(Parameter.REHEARSE, number)
    assert desk.flight.param(Parameter.REHEARSE) == Rehearsal.OFF
    assert desk.flight.firmware.supervisor.arm(True)


def test_the_other_kind_in_an_approach_ends_the_rehearsal() -> None:
    """What believes to be somewhere else all at once must not go on."""
    desk = Desk(kind=Rehearsal.MODEL)
    desk.arm()
    desk.flight.write(Parameter.GO, 1)
    desk.flight.run(0.5)
    desk.flight.write(Parameter.REHEARSE, Rehearsal.POSES)
    assert desk.flight.param(Parameter.REHEARSE) == Rehearsal.OFF
    desk.flight.run(0.01)
    assert desk.state() is LandingState.IDLE
    assert desk.flight.param(Parameter.TRAJECTORY_ARM) == 0


def test_the_models_attitude_does_not_stay_when_it_has_ended() -> None:
    """It hung upside down: what is armed next begins with the estimate."""
    desk = Desk(kind=Rehearsal.MODEL)
    desk.rehearse()
    desk.flight.write(Parameter.REHEARSE, Rehearsal.OFF)
    desk.flight.run(0.01)
    desk.kind = Rehearsal.POSES
    assert desk.begin()
    desk.flight.write("kalman.resetEstimation", 1)
    desk.send(0.3)
    desk.flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert desk.flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED
    desk.send(0.02)
    desk.flight.write(Parameter.REHEARSE, Rehearsal.OFF)
    desk.flight.run(0.4)
    first = decode_ring(desk.flight.firmware.engine.record()).periods[0]["law"][0]
    assert abs(np.dot(first["own_attitude"], first["estimate"]["quaternion"])) > np.cos(np.deg2rad(1.0))


def test_a_policy_that_does_not_fire_ends_in_a_brake_and_a_hold() -> None:
    """The law has the model on its own numbers: it stops below the ceiling, and stays there."""
    desk = Desk(kind=Rehearsal.MODEL)
    desk.arm()
    desk.flight.write(Parameter.POLICY_ARM, 0)
    desk.flight.write(Parameter.GO, 1)
    heights, seen = [], set()
    for _ in range(5000):
        desk.flight.tick()
        heights.append(model(desk)[2])
        seen.add(desk.state())
    assert {LandingState.BRAKE, LandingState.HOLD} <= seen
    assert desk.flight.log("perch.reason") == EndReason.MISSED_TRIGGER
    assert PLAN.z0 < max(heights) < PLAN.ceiling_z
    held = model(desk)
    desk.flight.write(Parameter.TRAJECTORY_ARM, 0)
    desk.flight.run(2.0)
    assert desk.state() is LandingState.IDLE
    assert model(desk) == pytest.approx([*held[:3], 0.0, 0.0, 0.0], abs=0.02)
    assert desk.flight.position[2] < 0.1
