"""What the commands of an approach say of a flip's start: thrusts, without what only keeps it straight."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.flights import Flight, PoseSource
from calibration.gap.landings.outcomes.starts import STRAIGHT, straightened, trigger_start
from calibration.gap.landings.segments import NotUsed
from onboard.arrays import FloatArray
from onboard.vehicle import load_vehicle

AT = 3.0
PARTS = np.array([[1, 1, 1, 1], [-1, -1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1]])
"""Collective, roll, pitch, yaw of M1 to M4 (front right, rear right, rear left, front left)."""


def approach(seed: int) -> tuple[FloatArray, FloatArray]:
    """Commands (s; N) of 3 s at 50 Hz about hover."""
    rng = np.random.default_rng(seed)
    return np.arange(0.0, AT, 0.02), 0.093 + 0.01 * rng.standard_normal((150, 4))


@given(st.integers(0, 1000), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02))
def test_held_roll_and_yaw_are_no_thrust(seed: int, roll: float, yaw: float) -> None:
    """Two drones that differ by what they need to fly straight start their flips alike."""
    t, thrust = approach(seed)
    trimmed = thrust + roll * PARTS[1] + yaw * PARTS[3]
    np.testing.assert_allclose(
        straightened((t, trimmed), AT)[1], straightened((t, thrust), AT)[1], atol=1e-12
    )


@given(st.integers(0, 1000))
def test_the_rest_of_the_commands_stays(seed: int) -> None:
    """Collective and pitch in every row, and how roll and yaw vary about what was held."""
    t, thrust = approach(seed)
    told, found = thrust @ PARTS.T, straightened((t, thrust), AT)[1] @ PARTS.T
    np.testing.assert_allclose(found[:, [0, 2]], told[:, [0, 2]], atol=1e-12)
    np.testing.assert_allclose(np.diff(found, axis=0), np.diff(told, axis=0), atol=1e-12)
    np.testing.assert_allclose(found[t > AT - STRAIGHT][:, [1, 3]].mean(axis=0), 0.0, atol=1e-12)


def test_what_was_held_long_before_does_not_count() -> None:
    t, thrust = approach(0)
    changed = thrust + np.where(t <= AT - STRAIGHT, 0.01, 0.0)[:, None] * PARTS[1]
    found, plain = (straightened((t, one), AT)[1] for one in (changed, thrust))
    np.testing.assert_allclose(found[t > AT - STRAIGHT], plain[t > AT - STRAIGHT], atol=1e-12)


def test_commands_that_end_too_early_stay_as_they_are() -> None:
    t, thrust = approach(0)
    assert straightened((t, thrust), AT + 10.0)[1] is thrust


@pytest.mark.parametrize(
    ("ended", "reason"),
    [
        ({}, "the policy never fired"),
        ({"finished": False}, "its record ends before the policy fired"),
        ({"aborted_by": "link_alive"}, "aborted before the policy fired: link_alive"),
    ],
)
def test_only_an_approach_that_came_to_its_end_has_a_policy_that_never_fired(
    ended: dict[str, Any], reason: str
) -> None:
    flight = Flight(
        "attempt", Path("attempt"), "perchhw", PoseSource.MOCAP, np.arange(3.0), {}, {}, trigger=None, **ended
    )
    start = trigger_start(flight, load_vehicle("crazyflie21-upgraded"), None)
    assert isinstance(start, NotUsed)
    assert reason in start.reason
