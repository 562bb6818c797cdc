"""The verdict: what passes, and what must not."""

import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from onboard.app_interface import EndReason, Parameter, PolicyStatus
from onboard.policy.bundle import decode_bundle, encode_bundle
from onboard.policy.model import Float32Array, Policy
from onboard.ring import Ring, decode_ring
from perchhw.rehearsal.loop_time import LoopTime
from perchhw.rehearsal.physics import Physics
from perchhw.rehearsal.record import save_rehearsal
from perchhw.rehearsal.session import Rehearsed
from perchhw.rehearsal.verdict import A_ROT_BOUND, FORCE_BOUND, TRIGGER_VALUE_BOUND, judge
from sim_backend.crazyflie.policy_slot import with_a_weight_changed
from sim_backend.lab_faults import DroneFaults
from tests.rehearsal.desk import PLAN, POLICY, TRUE, Desk
from tests.sim_crazyflie.simulated_flight import Flight

TRIGGERED = EndReason.TRIGGERED


@pytest.fixture(scope="module")
def ring() -> Ring:
    return Desk().rehearse()


def test_a_drone_that_computes_as_the_reference_passes(ring: Ring) -> None:
    verdict = judge(ring, TRIGGERED, PLAN, POLICY, TRUE)
    assert verdict.passed
    assert verdict.trigger_sample_difference == 0
    assert verdict.trigger_value_difference <= TRIGGER_VALUE_BOUND
    assert verdict.a_rot_difference_n_m <= A_ROT_BOUND
    assert verdict.force_difference_n is not None
    assert verdict.force_difference_n <= FORCE_BOUND


def test_a_flight_is_judged_as_a_rehearsal_is() -> None:
    flight = Flight(seed=1)
    assert flight.upload(encode_bundle(POLICY)) == PolicyStatus.ACTIVE
    flight.fly_to_start(PLAN)
    flight.set_plan(PLAN)
    for name in (Parameter.TRAJECTORY_ARM, Parameter.POLICY_ARM, Parameter.GO):
        flight.write(name, 1)
    flight.run(PLAN.impact_time + 1.0)
    assert flight.log("perch.reason") == TRIGGERED
    flown = decode_ring(flight.firmware.engine.record())
    verdict = judge(flown, TRIGGERED, PLAN, POLICY, TRUE)
    assert verdict.failures == ()
    assert verdict.input_difference is not None
    assert verdict.input_difference["velocity_m_s"] < 0.4


def test_what_the_drone_got_is_told_apart_from_what_it_made_of_it(ring: Ring) -> None:
    """Poses without accelerations leave the estimate behind; the verdict is on what was made of it."""
    away = judge(ring, TRIGGERED, PLAN, POLICY, TRUE).input_difference
    assert away is not None
    assert 0.0 < away["position_m"] < 0.2
    assert 0.0 < away["velocity_m_s"] < 1.0
    assert 0.0 < abs(away["tau_s"]) < 0.05


def test_one_weight_changed_on_the_drone_fails() -> None:
    ring = Desk(DroneFaults(policy_weight=1.001)).rehearse()
    verdict = judge(ring, TRIGGERED, PLAN, POLICY, TRUE)
    assert not verdict.passed
    assert any("moment differs" in failure for failure in verdict.failures)


def test_one_support_vector_changed_fails(ring: Ring) -> None:
    coefficients = POLICY.dual_coefficients.copy()
    coefficients[np.argmax(coefficients)] *= np.float32(1.001)
    verdict = judge(ring, TRIGGERED, PLAN, replace(POLICY, dual_coefficients=coefficients), TRUE)
    assert not verdict.passed


def with_each_number_changed(factor: float) -> Iterator[tuple[str, Policy]]:
    """The policy with one number times `factor`, for each of its network and of its support vectors."""
    by = np.float32(factor)
    for place, layer in enumerate(POLICY.layers):
        for name in ("weights", "bias"):
            for values in _each(getattr(layer, name), by):
                layers = list(POLICY.layers)
                layers[place] = replace(layer, **{name: values})
                yield "network", replace(POLICY, layers=tuple(layers))
    for name in ("dual_coefficients", "support_vectors"):
        for values in _each(getattr(POLICY, name), by):
            yield "trigger", replace(POLICY, **{name: values})


def _each(values: Float32Array, by: np.float32) -> Iterator[Float32Array]:
    for place in np.ndindex(values.shape):
        changed = values.copy()
        changed[place] *= by
        yield changed


@pytest.mark.soak
def test_how_many_numbers_have_a_part_in_the_approach(ring: Ring, capsys: pytest.CaptureFixture[str]) -> None:
    """Support vectors far from this approach have none; a checksum is what covers them."""
    noticed, all_ = Counter[str](), Counter[str]()
    for part, policy in with_each_number_changed(1.01):
        all_[part] += 1
        noticed[part] += not judge(ring, TRIGGERED, PLAN, policy, TRUE).passed
    with capsys.disabled():
        sys.stdout.write(json.dumps({"noticed": noticed, "of": all_}) + "\n")
    assert noticed["network"] > 0.9 * all_["network"]
    assert noticed["trigger"] > 0.7 * all_["trigger"]


def test_no_trigger_is_a_fail(ring: Ring) -> None:
    verdict = judge(ring, EndReason.MISSED_TRIGGER, PLAN, POLICY, TRUE)
    assert verdict.failures == ("the drone did not trigger: its approach ended with missed_trigger",)
    silent = replace(POLICY, intercept=np.float32(-50.0))
    verdict = judge(ring, TRIGGERED, PLAN, silent, TRUE)
    assert "the reference does not trigger on the drone's inputs" in verdict.failures


def test_a_sample_too_early_or_too_late_is_a_fail(ring: Ring) -> None:
    for by in (-1, 1):
        verdict = judge(replace(ring, end_tick=ring.end_tick + 10 * by), TRIGGERED, PLAN, POLICY, TRUE)
        assert verdict.trigger_sample_difference == -by
        assert f"the reference triggers {-by:+d} samples after the drone" in verdict.failures


def test_a_ring_without_the_trigger_is_a_fail(ring: Ring) -> None:
    verdict = judge(replace(ring, end_tick=ring.end_tick - 5000), TRIGGERED, PLAN, POLICY, TRUE)
    assert "the drone's ring does not hold its trigger" in verdict.failures


@pytest.mark.parametrize("by", [2e-6, np.nan])
def test_a_force_that_differs_is_a_fail(ring: Ring, by: float) -> None:
    periods = ring.periods.copy()
    at = ring.ticks.tolist().index(ring.end_tick)
    periods["law"]["thrusts"][at, 1, 2] += by
    verdict = judge(replace(ring, periods=periods), TRIGGERED, PLAN, POLICY, TRUE)
    assert any("force differs" in failure for failure in verdict.failures)


def test_a_verdict_on_what_is_no_number_can_be_written(ring: Ring, tmp_path: Path) -> None:
    periods = ring.periods.copy()
    at = ring.ticks.tolist().index(ring.end_tick)
    periods["law"]["thrusts"][at] = periods["a_rot"][at - 3] = np.nan
    periods["law"]["estimate"]["velocity"][at] = np.nan
    spoilt = replace(ring, periods=periods)
    verdict = judge(spoilt, TRIGGERED, PLAN, POLICY, TRUE)
    folder = save_rehearsal(
        tmp_path, Rehearsed(Physics.HOST, "c", 1, spoilt, verdict, LoopTime(310.5, 480.0))
    )
    said = json.loads((folder / "verdict.json").read_text())
    assert said["pass"] is False
    assert said["loop_us"] == {"mean": 310.5, "most": 480.0}
    assert (said["a_rot_difference_n_m"], said["input_difference"]["velocity_m_s"]) == (None, None)
    assert any("moment differs by inf N m" in failure for failure in said["failures"])


def test_the_changed_weight_is_one() -> None:
    bundle = encode_bundle(POLICY)
    changed = decode_bundle(with_a_weight_changed(bundle, 1.01))
    before = decode_bundle(bundle)
    differing = [
        int((a.weights != b.weights).sum()) for a, b in zip(before.layers, changed.layers, strict=True)
    ]
    assert (sum(differing), differing[-1]) == (1, 1)
