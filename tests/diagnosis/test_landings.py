"""Landings and misses are explained as what the simulation did; flips are measured as they were commanded."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.flights import Trigger
from calibration.flights.perchhw_run import flight_from_run
from onboard.policy.action import action_moments
from onboard.policy.bundle import policy_crc32
from onboard.policy.files import find_policy, load_policy, save_policy
from onboard.policy.model import Policy
from onboard.policy.trigger import trigger_values
from onboard.vehicle import Vehicle
from perchhw.attempt import Outcome
from perchhw.diagnosis import Cause, diagnose
from perchhw.diagnosis.diagnose import judge_of
from perchhw.diagnosis.flip import Flip, measure_flip
from perchhw.diagnosis.landing import Judge
from perchhw.diagnosis.no_trigger import diagnose_no_trigger
from perchhw.record.run import read_run
from tests.label.simulated import Landing, land
from tests.report.recorded import record_landing

ATTACHED = {
    Outcome.FOUR_LEG: Cause.FOUR_LEGS,
    Outcome.FOUR_LEG_BODY_CONTACT: Cause.FOUR_LEGS_BODY_CONTACT,
    Outcome.TWO_LEG: Cause.TWO_LEGS,
    Outcome.TWO_LEG_BODY_CONTACT: Cause.TWO_LEGS,
}
MISSED = (Cause.BODY_FIRST, Cause.FEET_LET_GO, Cause.CEILING_NOT_REACHED)


@pytest.fixture(scope="module")
def policy() -> Policy:
    return load_policy(find_policy("default"))


@pytest.fixture(scope="module")
def landings(vehicle: Vehicle) -> list[Landing]:
    rng = np.random.default_rng(11)
    taus = (0.14, 0.18, 0.22, 0.25, 0.28, 0.4)
    return [land(vehicle, 2.5, 60.0, tau, -6e-3, rng) for tau in taus]


def test_the_cause_is_what_the_simulation_did(
    landings: list[Landing], vehicle: Vehicle, tmp_path: Path
) -> None:
    told = []
    for number, landing in enumerate(landings):
        run = read_run(record_landing(landing, tmp_path / str(number), vehicle, 2.5, 60.0))
        found = diagnose(run, vehicle, Judge(None, None))
        told.append(found.cause)
        expected = ATTACHED.get(landing.truth)
        assert found.cause is expected if expected else found.cause in MISSED, (landing.truth, found)
        if found.cause is Cause.TWO_LEGS:
            assert found.values["pair"] in ("fore", "hind")
            assert f"its {found.values['pair']} legs only" in found.sentence
    assert told[0] is Cause.BODY_FIRST  # far too late: it is still upright at the ceiling
    assert told[-1] is Cause.CEILING_NOT_REACHED  # far too early
    assert Cause.TWO_LEGS in told


def test_a_flip_is_measured(landings: list[Landing], vehicle: Vehicle, tmp_path: Path) -> None:
    run = read_run(record_landing(landings[3], tmp_path / "run", vehicle, 2.5, 60.0))
    flight = flight_from_run(run)
    assert flight.trigger is not None
    snapshot = {**flight.trigger.snapshot, "a_rot": -6e-3}
    trigger = Trigger(flight.trigger.t, snapshot)
    flip = measure_flip(flight, trigger, vehicle, None)
    assert flip.delivered == pytest.approx(1.0 / 1.15, abs=0.03)  # no delays in this simulation
    more = measure_flip(flight, Trigger(trigger.t, {**snapshot, "a_rot": -9e-3}), vehicle, None)
    assert more.delivered is not None
    assert flip.delivered is not None
    assert more.delivered < 0.75 * flip.delivered
    assert flip.touch is not None
    assert flip.touch.ceiling_error_m == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("frames", [1, 2])
def test_poses_that_show_an_older_state_once_are_no_blow(
    frames: int, landings: list[Landing], vehicle: Vehicle, tmp_path: Path
) -> None:
    """As those of a simulated room whose lab was late for a moment."""
    run = read_run(record_landing(landings[3], tmp_path / "run", vehicle, 2.5, 60.0))
    flight = flight_from_run(run)
    assert flight.trigger is not None
    touch = measure_flip(flight, flight.trigger, vehicle, None).touch
    assert touch is not None
    poses = run.series["pose"]
    rising = np.flatnonzero(
        (poses.t > flight.trigger.t + 0.08) & (poses.t < flight.trigger.t + touch.after_s)
    )
    for first in rising[: -frames - 2]:
        heights = [message["z"] for message in poses.messages]
        for late in range(first, first + frames):
            poses.messages[late]["z"] = heights[first - 1]
        again = measure_flip(flight_from_run(run), flight.trigger, vehicle, None).touch
        assert again is not None
        assert again.after_s == pytest.approx(touch.after_s, abs=0.011)
        for message, height in zip(poses.messages, heights, strict=True):
            message["z"] = height


def test_what_falls_meets_no_ceiling(landings: list[Landing], vehicle: Vehicle, tmp_path: Path) -> None:
    run = read_run(record_landing(landings[4], tmp_path / "run", vehicle, 2.5, 60.0))
    trigger = flight_from_run(run).trigger
    assert trigger is not None
    assert measure_flip(flight_from_run(run), trigger, vehicle, None).touch is None
    poses = run.series["pose"]
    heights = [message["z"] for message in poses.messages]
    falls = np.flatnonzero(
        (np.diff(heights, prepend=heights[0]) < -0.005) & (poses.t > trigger.t) & (poses.t < trigger.t + 0.65)
    )
    assert falls.size > 5
    for late in falls:
        poses.messages[late]["z"] = heights[late - 1]
        assert measure_flip(flight_from_run(run), trigger, vehicle, None).touch is None
        poses.messages[late]["z"] = heights[late]


@pytest.mark.parametrize(("shift", "cause"), [(0.05, Cause.FLIP_LATE), (-0.05, Cause.FLIP_EARLY)])
def test_a_region_elsewhere_makes_a_flip_late_or_early(
    landings: list[Landing], vehicle: Vehicle, policy: Policy, tmp_path: Path, shift: float, cause: Cause
) -> None:
    failed = next(one for one in landings if one.truth is Outcome.FAILURE and one.flight.trigger is not None)
    run = read_run(record_landing(failed, tmp_path / "run", vehicle, 2.5, 60.0))
    flight = flight_from_run(run)
    assert flight.trigger is not None
    seen = flight.trigger.snapshot
    # A region that begins `shift` before the recorded trigger, whatever the flow there.
    around = replace(
        policy,
        scaler_mean=np.array([seen["tau"] + shift - 0.012, seen["theta_x"], seen["d_ceil"]], np.float32),
        scaler_std=np.array([0.012, 50.0, 50.0], np.float32),
        support_vectors=np.zeros((1, 3), np.float32),
        dual_coefficients=np.ones(1, np.float32),
        gamma=np.float32(1.0),
        intercept=np.float32(-np.exp(-1.0)),
    )
    found = diagnose(run, vehicle, Judge(None, around))
    assert found.cause is cause
    late = found.values["late_ms"]
    assert isinstance(late, float)
    assert late == pytest.approx(1e3 * shift, abs=15.0)
    words = f"{abs(late):.0f} ms {'late' if shift > 0 else 'early'}: tau"
    assert words in found.sentence
    run.info["outcome"] = Outcome.FOUR_LEG  # a landing that forgave it
    forgiven = diagnose(run, vehicle, Judge(None, around))
    assert forgiven.cause is Cause.FOUR_LEGS
    assert words in forgiven.sentence


def test_a_drone_that_computes_something_else_is_named(
    landings: list[Landing], vehicle: Vehicle, policy: Policy, tmp_path: Path
) -> None:
    run = read_run(record_landing(landings[3], tmp_path / "run", vehicle, 2.5, 60.0))
    snapshot = run.series["trigger"].messages[0]
    state = np.array([[snapshot[name] for name in ("tau", "theta_x", "d_ceil")]], np.float32)
    snapshot["trigger_value"] = float(trigger_values(policy.compiled(), state)[0])
    moment = float(action_moments(policy.compiled(), state)[0])
    snapshot["a_rot"] = moment
    assert diagnose(run, vehicle, Judge(policy, None)).cause is not Cause.OTHER_POLICY_COMPUTED
    snapshot["a_rot"] = 0.9 * moment
    found = diagnose(run, vehicle, Judge(policy, None))
    assert found.cause is Cause.OTHER_POLICY_COMPUTED
    assert f"its policy gives {moment * 1e3:.2f}" in found.sentence


def test_a_body_that_the_poses_have_clear_of_the_ceiling_did_not_touch_first(
    landings: list[Landing], vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At load a lab's clock and that of the poses are 60 ms apart: the attitude at the blow is an old one."""
    run = read_run(record_landing(landings[3], tmp_path / "run", vehicle, 2.5, 60.0))
    run.info["outcome"] = Outcome.FOUR_LEG
    assert "touched first" in diagnose(run, vehicle, Judge(None, None)).sentence

    def behind(*arguments: Any) -> Flip:
        flip = measure_flip(*arguments)
        assert flip.touch is not None
        return replace(flip, touch=flip.touch._replace(feet_margin_m=-0.013))

    monkeypatch.setattr("perchhw.diagnosis.landing.measure_flip", behind)
    found = diagnose(run, vehicle, Judge(None, None))
    assert found.cause is Cause.FOUR_LEGS
    assert "touched first" not in found.sentence
    run.info["outcome"] = Outcome.FOUR_LEG_BODY_CONTACT
    assert "the body touched first" in diagnose(run, vehicle, Judge(None, None)).sentence


def test_a_trigger_that_never_came(
    landings: list[Landing], vehicle: Vehicle, policy: Policy, tmp_path: Path
) -> None:
    run = read_run(record_landing(landings[-1], tmp_path / "run", vehicle, 2.5, 60.0))
    flight = replace(flight_from_run(run), trigger=None)
    own = Judge(policy, policy)
    assert diagnose_no_trigger(replace(flight, commanded_speed=4.0), own).cause is Cause.TOO_SLOW
    _, cues = flight.series("tau", "theta_x", "d_ceil")
    flow = float(cues[-1, 1])  # the region is around the last state, but at 2.1 times its flow
    away = replace(
        policy,
        scaler_mean=np.array([cues[-1, 0], 2.1 * flow, cues[-1, 2]], np.float32),
        scaler_std=np.array([0.05, 0.5 * flow, 0.2], np.float32),
        support_vectors=np.zeros((1, 3), np.float32),
        dual_coefficients=np.ones(1, np.float32),
        gamma=np.float32(1.0),
        intercept=np.float32(-np.exp(-1.0)),
        tau_min=np.float32(cues[-1, 0] - 0.05),
        tau_max=np.float32(cues[-1, 0] + 0.05),
    )
    found = diagnose_no_trigger(flight, Judge(away, away))
    assert found.cause is Cause.REGION_MISSED
    assert "theta_x was" in found.sentence
    assert f"below the region, which begins at {1.6 * flow:.1f}" in found.sentence
    entered = replace(away, scaler_mean=np.array(cues[-1], np.float32))
    told = diagnose_no_trigger(flight, Judge(away, entered))
    assert told.cause is Cause.REGION_ELSEWHERE
    assert told.sentence.startswith(found.sentence)  # held against the policy that flew
    assert "that of the policy that ships for this vehicle was entered at tau 0." in told.sentence
    unknown = diagnose_no_trigger(flight, Judge(None, away))
    assert (unknown.cause, "tau" in unknown.sentence) == (Cause.REGION_MISSED, False)
    data = {name: values for name, values in flight.data.items() if name != "tau"}
    valid = {name: mask for name, mask in flight.valid.items() if name != "tau"}
    assert diagnose_no_trigger(replace(flight, data=data, valid=valid), own).cause is Cause.NO_CUES


@pytest.mark.parametrize(
    ("flown", "judged_by"), [("default", "default"), ("pads", "pads"), ("mine", "default")]
)
def test_a_policy_that_ships_for_the_vehicle_is_judged_by_itself(
    landings: list[Landing], vehicle: Vehicle, tmp_path: Path, flown: str, judged_by: str
) -> None:
    """Any other of the same vehicle by the default one, so that it can be told where it differs."""
    run = read_run(record_landing(landings[3], tmp_path / "run", vehicle, 2.5, 60.0))
    pads = load_policy(find_policy("pads"))
    save_policy(replace(pads, intercept=pads.intercept + np.float32(0.01)), tmp_path / "mine")
    run.config["policy"] = str(tmp_path / "mine") if flown == "mine" else flown
    region = judge_of(run).region
    assert region is not None
    assert policy_crc32(region) == policy_crc32(load_policy(find_policy(judged_by)))
