"""The machine's own attitude: what turns it, how fast, and when."""

import math
from typing import Any

import pytest

from mocap_bridge.rotation import angle_between
from onboard.landing.state_machine import LandingState
from onboard.rotation import (
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
)
from tests.onboard.landing.rig import LEVEL, NAN, PLAN, Rig

UNKNOWN = (NAN, NAN, NAN, NAN)
TURNED = from_rotation_vector((0.2, -0.3, 0.4))


def known(state: LandingState) -> Rig:
    """A rig in `state` with a level attitude."""
    rig = Rig()
    rig.step()
    rig.memory["state"] = int(state)
    rig.inputs = rig.inputs._replace(trajectory_armed=True)
    return rig


def turn_of(rig: Rig, **changes: Any) -> float:
    """Angle (rad) by which one step turns the own attitude."""
    before = tuple(rig.memory["attitude"])
    return angle_between(before, rig.step(**changes).attitude)


def test_the_first_estimate_is_taken_as_it_is() -> None:
    rig = Rig()
    assert rig.step(quaternion=UNKNOWN, gyro=(5.0, 0.0, 0.0)).attitude == (0.0, 0.0, 0.0, 0.0)
    assert rig.step(gyro=(5.0, 0.0, 0.0)).attitude == (0.0, 0.0, 0.0, 0.0)
    doubled = tuple(2.0 * part for part in TURNED)
    assert rig.step(quaternion=doubled, gyro=(5.0, 0.0, 0.0)).attitude == pytest.approx(TURNED, abs=1e-12)


@pytest.mark.parametrize("part", range(4))
@pytest.mark.parametrize("bad", [NAN, math.inf, -math.inf])
def test_an_estimate_with_a_part_that_is_no_number_is_none(part: int, bad: float) -> None:
    broken = tuple(bad if i == part else value for i, value in enumerate(LEVEL))
    rig = Rig()
    assert rig.step(quaternion=broken).attitude == (0.0, 0.0, 0.0, 0.0)
    rig.step(quaternion=LEVEL)
    assert rig.step(quaternion=broken).attitude == pytest.approx(LEVEL)


@pytest.mark.parametrize("rate", [(3.0, 0.0, 0.0), (0.0, -20.0, 0.0), (1.0, 2.0, -3.0)])
@pytest.mark.parametrize("dt", [1e-3, 0.02, 0.098])
def test_the_gyro_turns_it(rate: tuple[float, float, float], dt: float) -> None:
    rig = Rig()
    rig.step(quaternion=TURNED)
    output = rig.step(quaternion=UNKNOWN, gyro=rate, dt=dt)
    expected = multiply(TURNED, from_rotation_vector(tuple(dt * part for part in rate)))
    assert output.attitude == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("dt", [-0.05, -1e-3, 0.0, 0.1, 0.102, 1.0, NAN])
def test_a_step_of_no_sound_length_turns_nothing(dt: float) -> None:
    for changes in ({"gyro": (0.0, 1.0, 0.0)}, {"quaternion": TURNED}):
        assert turn_of(known(LandingState.IDLE), dt=dt, **changes) == 0.0


@pytest.mark.parametrize("part", range(3))
def test_a_gyro_that_is_no_number_turns_nothing(part: int) -> None:
    gyro = tuple(NAN if i == part else 1.0 for i in range(3))
    rig = known(LandingState.IDLE)
    assert rig.step(gyro=gyro, quaternion=UNKNOWN).attitude == pytest.approx(LEVEL)


@pytest.mark.parametrize("rate", [1e30, 1e200])
def test_a_gyro_too_great_to_be_squared_is_forgotten_again(rate: float) -> None:
    """Its numbers are finite, and their squares are not: in float32, the drone's, from 1e22 rad/s on."""
    rig = Rig()
    rig.step()
    assert math.isfinite(sum(rig.step(gyro=(rate, rate, rate)).attitude))
    for _ in range(2000):
        output = rig.step(gyro=(0.0, 0.0, 0.0))
    assert angle_between(output.attitude, LEVEL) < 1e-3


@pytest.mark.parametrize("dt", [1e-3, 2e-3, 0.098])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("error", [(0.05, 0.0, 0.0), (0.0, -0.06, 0.0), (0.02, 0.03, -0.04)])
def test_a_small_error_goes_with_5_per_second(error: tuple[float, ...], sign: float, dt: float) -> None:
    """In any state but the flip, and whichever of its two signs the estimate's quaternion has."""
    estimate = tuple(sign * part for part in from_rotation_vector(error))
    for state in LandingState:
        if state is LandingState.FLIP:
            continue
        rig = known(state)
        output = rig.step(quaternion=estimate, dt=dt)
        moved = from_rotation_vector(tuple(5.0 * dt * part for part in error))
        assert output.attitude == pytest.approx(moved, abs=2e-3 * dt), state


def test_the_correction_is_taken_in_the_bodys_frame() -> None:
    rig = Rig()
    rig.step(quaternion=TURNED)
    error = (0.05, 0.0, 0.0)
    output = rig.step(quaternion=multiply(TURNED, from_rotation_vector(error)))
    done = multiply(conjugate(TURNED), output.attitude)
    assert done[:3] == pytest.approx((0.5 * 5e-3 * 0.05, 0.0, 0.0), abs=1e-7)


LOOSE = (LandingState.IDLE, LandingState.CUT, LandingState.FAULT)


@pytest.mark.parametrize("state", [state for state in LandingState if state is not LandingState.FLIP])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.48, -0.6, 0.64)])
@pytest.mark.parametrize("angle", [0.12, 0.5, 2.0])
def test_a_large_error_goes_slowly_where_the_vehicle_flies(
    state: LandingState, axis: tuple[float, ...], angle: float
) -> None:
    """With 0.5 rad/s at most; where nothing depends on it, as fast as its share says."""
    rig = known(state)
    turn = turn_of(rig, quaternion=from_rotation_vector(tuple(angle * part for part in axis)))
    free = 5.0 * 2.0 * math.sin(0.5 * angle) * 1e-3
    assert turn == pytest.approx(free if state in LOOSE else 0.5e-3, rel=1e-3)


def test_in_the_flip_only_the_gyro_turns_it() -> None:
    rig = Rig()
    rig.flip()
    assert turn_of(rig, quaternion=TURNED) == 0.0
    assert turn_of(rig, quaternion=TURNED, gyro=(0.0, -20.0, 0.0)) == pytest.approx(0.02, rel=1e-6)


def test_it_is_what_the_machine_hands_out() -> None:
    rig = Rig()
    rig.step(quaternion=TURNED)
    output = rig.approach(PLAN.t_x)
    assert output.attitude == tuple(rig.memory["attitude"])
    assert rotate(output.attitude, (0.0, 0.0, 1.0)) == pytest.approx(
        rotate(TURNED, (0.0, 0.0, 1.0)), abs=1e-6
    )
