"""Replaying a policy over records whose state and cues came in log blocks of their own, as a flight's do."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.flights import open_flight
from onboard.app_interface import LandingState
from onboard.arrays import FloatArray
from onboard.json_file import as_json
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.policy.trigger import trigger_values
from perchhw.record import RunRecorder
from perchhw.record.replay import PolicyReplay, replay_policy

HOST_MINUS_DRONE = 100.0
POLICY = load_policy(shipped_policy_path("default"))


def approach() -> FloatArray:
    """Cues of an approach at 2.5 m/s and 50 deg, one a row each 10 ms, until well after the policy fires."""
    vx, vz = 1.6, 1.9
    d_ceil = 0.9 - 0.01 * vz * np.arange(35)
    return np.stack((d_ceil / vz, vx / d_ceil, d_ceil), axis=1)


CUES = approach()
FIRED = int(np.flatnonzero(trigger_values(POLICY.compiled(), CUES.astype(np.float32)) >= 0.0)[0])


def cues_of(i: int) -> dict[str, float]:
    return dict(zip(("tau", "theta_x", "d_ceil"), map(float, CUES[i]), strict=True))


def write(
    folder: Path,
    *,
    states: Sequence[int] | None = None,
    snapshot: bool = True,
    lost: int | None = None,
    uptime_ms: int = 0,
    drone_time: bool = True,
) -> None:
    """Evaluations at drone times 5000, 5010, ... ms; the state is logged 1 ms and the cues 4 ms later.

    Args:
        folder: where to.
        states: state of the landing app at each evaluation; by default it flips where the policy fires.
        snapshot: whether the trigger snapshot was still written.
        lost: evaluation whose cues never arrived.
        uptime_ms: what the drone's tick had before the 24 bits of the log packets last wrapped.
        drone_time: whether the messages carry the drone's time.
    """
    flips = [LandingState.APPROACH] * FIRED + [LandingState.FLIP] * (len(CUES) - FIRED)

    def send(topic: str, drone_ms: int, **fields: Any) -> None:
        timed = {"drone_time_ms": drone_ms} if drone_time else {}
        recorder.write(topic, HOST_MINUS_DRONE + 1e-3 * drone_ms, {**fields, **timed})

    with RunRecorder(folder, {}) as recorder:
        for i, state in enumerate(states or flips):
            send("cues", 5001 + 10 * i, state=int(state))
            if i != lost:
                send("cues", 5004 + 10 * i, **cues_of(i), trigger_value=0.0, a_rot=0.0)
        if snapshot:
            tick_ms = uptime_ms + 5000 + 10 * FIRED
            recorder.write("trigger", 107.0, {"count": 1, "tick_ms": tick_ms, **cues_of(FIRED)})


def replay(folder: Path) -> PolicyReplay:
    return replay_policy(open_flight(folder), POLICY)


@pytest.mark.parametrize("lost", [None, FIRED])
@pytest.mark.parametrize("uptime_ms", [0, 3 << 24])
def test_the_firing_cues_are_found_although_they_arrive_after_the_trigger(
    tmp_path: Path, lost: int | None, uptime_ms: int
) -> None:
    write(tmp_path / "run", lost=lost, uptime_ms=uptime_ms)
    result = replay(tmp_path / "run")
    assert result.recorded_trigger == pytest.approx(HOST_MINUS_DRONE + 5.0 + 0.01 * FIRED)
    assert result.fires_at == result.recorded_trigger
    assert result.t.size == FIRED + 1
    assert result.trigger_value_max == result.trigger_value[-1]
    assert result.a_rot_at_firing == result.a_rot[-1]


def test_the_firing_cues_are_found_without_a_snapshot(tmp_path: Path) -> None:
    write(tmp_path / "run", snapshot=False)
    result = replay(tmp_path / "run")
    assert result.recorded_trigger == pytest.approx(HOST_MINUS_DRONE + 5.001 + 0.01 * FIRED)
    assert result.fires_at == pytest.approx(HOST_MINUS_DRONE + 5.004 + 0.01 * FIRED)
    assert result.t.size == FIRED + 1


def test_a_record_without_drone_times_goes_by_the_hosts(tmp_path: Path) -> None:
    write(tmp_path / "run", drone_time=False)
    assert replay(tmp_path / "run").fires_at == pytest.approx(
        HOST_MINUS_DRONE + 5.004 + 0.01 * FIRED, abs=0.011
    )


def test_only_what_the_drone_saw_in_its_approach_counts(tmp_path: Path) -> None:
    """Cues at which the policy would fire, seen while it braked, are left out; so is the wait before."""
    before = [LandingState.TRAJECTORY_ARMED] * 5
    states = before + [LandingState.APPROACH] * (FIRED - 8) + [LandingState.BRAKE] * (len(CUES) - FIRED + 3)
    write(tmp_path / "braked", states=states, snapshot=False)
    result = replay(tmp_path / "braked")
    assert (result.fires_at, result.recorded_trigger, result.t.size) == (None, None, FIRED - 8)
    assert result.trigger_value_max is not None
    assert result.trigger_value_max < 0.0


def test_nothing_evaluated_is_null_not_zero(tmp_path: Path) -> None:
    write(tmp_path / "run", states=[LandingState.IDLE] * len(CUES), snapshot=False)
    result = replay(tmp_path / "run")
    document = as_json(result)
    assert document["samples"] == 0
    assert document["trigger_value_max"] is None
    assert (document["fires_at"], document["a_rot_at_firing"]) == (None, None)
    assert "nothing to evaluate" in result.in_words()
