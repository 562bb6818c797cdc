"""Any input at all."""

import math
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.landing.state_machine import (
    LandingState,
    OutputMode,
)
from onboard.rotation import body_z
from tests.drawn_examples import examples
from tests.onboard.landing.rig import LIMITS, NAN, PLAN, Rig, steps_until_cut

numbers = st.one_of(st.floats(-5.0, 5.0), st.sampled_from([0.0, NAN, math.inf, -math.inf, 1e300]))
vectors = st.tuples(numbers, numbers, numbers)
samples = st.fixed_dictionaries(
    {
        "position": vectors,
        "velocity": vectors,
        "quaternion": st.tuples(numbers, numbers, numbers, numbers),
        "gyro": vectors,
        "pose_age": numbers,
        "tau": numbers,
        "theta_x": numbers,
        "d_ceil": numbers,
        "trigger_value": numbers,
        "a_rot": numbers,
        "evaluated": st.booleans(),
        "policy_armed": st.booleans(),
        "trajectory_armed": st.booleans(),
        "go": st.booleans(),
        "abort": st.booleans(),
        "flying": st.booleans(),
    }
)


@settings(max_examples=examples(80))
@given(st.sampled_from(["idle", "approach", "trigger", "brake", "hold"]), st.lists(samples, max_size=8))
def test_no_input_makes_it_forget_its_rules(where: str, sequence: list[dict[str, Any]]) -> None:
    rig = Rig()
    match where:
        case "approach":
            rig.approach(1.0)
        case "trigger":
            rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
            rig.step(**{**rig.trigger_sample(), "evaluated": False})
        case "brake":
            rig.brake()
        case "hold":
            rig.hold()
    for sample in sequence:
        before = rig.state
        output = rig.step(**sample)
        assert all(0.0 <= thrust <= LIMITS.thrust_max for thrust in output.thrusts)
        assert output.collective == (0.0 if rig.state is not LandingState.HOLD else output.collective)
        assert output.collective in (0.0, LIMITS.weight)
        if rig.state is LandingState.FLIP and before is not LandingState.FLIP:
            assert before is LandingState.APPROACH
            assert sample["policy_armed"]
            assert sample["evaluated"]
            assert sample["trigger_value"] >= 0.0
            assert math.isfinite(sum(sample["position"]) + sum(sample["velocity"]) + sample["a_rot"])
        if before in (LandingState.CUT, LandingState.FAULT) and rig.state is not before:
            assert [sample[key] for key in ("flying", "policy_armed", "trajectory_armed")] == [False] * 3
        if rig.state in (LandingState.CUT, LandingState.FAULT):
            assert output.mode == OutputMode.OFF


def test_two_machines_with_the_same_inputs_do_the_same() -> None:
    first, second = Rig(), Rig()
    for rig in (first, second):
        rig.flip()
        steps_until_cut(rig)
    assert first.memory.tobytes() == second.memory.tobytes()
    assert body_z(first.memory["attitude"])[2] <= 0.0
