"""The mixer: geometry of the motors, round trip, and what gives way in saturation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.mixer import flip_thrusts, mix

ARM_X, ARM_Y, C, MOST = 0.0325, 0.0325, 0.00618, 0.147
CORNERS = np.array([[1, -1], [-1, -1], [-1, 1], [1, 1]])


def wrench(
    thrusts: tuple[float, ...], arm_x: float = ARM_X, arm_y: float = ARM_Y
) -> tuple[float, float, float, float]:
    """Collective and moments by r x F at the motors' places, independent of the mixer's formulas."""
    places = CORNERS * [arm_x, arm_y]
    tau = sum(np.cross([x, y, 0.0], [0.0, 0.0, f]) for (x, y), f in zip(places, thrusts, strict=True))
    drag = C * (thrusts[1] + thrusts[3] - thrusts[0] - thrusts[2])
    return sum(thrusts), float(tau[0]), float(tau[1]), drag


moments = st.floats(-1e-3, 1e-3)


@given(st.floats(0.2, 0.35), moments, moments, st.floats(-2e-4, 2e-4))
def test_within_the_range_the_wrench_is_exact(collective: float, tx: float, ty: float, tz: float) -> None:
    thrusts = mix(collective, tx, ty, tz, ARM_X, ARM_Y, C, MOST)
    assert wrench(thrusts) == pytest.approx((collective, tx, ty, tz), abs=1e-12)


def test_unequal_arms() -> None:
    thrusts = mix(0.3, 1e-3, -5e-4, 1e-4, 0.03, 0.04, C, MOST)
    assert wrench(thrusts, 0.03, 0.04) == pytest.approx((0.3, 1e-3, -5e-4, 1e-4))


@pytest.mark.parametrize(
    ("asked", "louder"),
    [
        ((0.3, 1e-3, 0.0, 0.0), (3, 4)),  # roll to the right side down needs the left motors
        ((0.3, 0.0, 1e-3, 0.0), (2, 3)),  # nose down needs the back motors
        ((0.3, 0.0, -1e-3, 0.0), (1, 4)),  # nose up needs the front motors
        ((0.3, 0.0, 0.0, 1e-4), (2, 4)),
    ],
)
def test_signs_on_each_axis(asked: tuple[float, float, float, float], louder: tuple[int, int]) -> None:
    thrusts = mix(*asked, ARM_X, ARM_Y, C, MOST)
    quiet = [thrust for number, thrust in enumerate(thrusts, 1) if number not in louder]
    assert min(thrusts[number - 1] for number in louder) > max(quiet)


@given(st.floats(-0.2, 2.0), st.floats(-8e-3, 8e-3), st.floats(-8e-3, 8e-3), st.floats(-5e-3, 5e-3))
def test_saturation_keeps_attitude_authority(collective: float, tx: float, ty: float, tz: float) -> None:
    thrusts = mix(collective, tx, ty, tz, ARM_X, ARM_Y, C, MOST)
    assert all(0.0 <= thrust <= MOST for thrust in thrusts)
    got = wrench(thrusts)
    reach = abs(tx) / (4 * ARM_Y) + abs(ty) / (4 * ARM_X)
    share = min(1.0, 0.5 * MOST / reach) if reach > 0.0 else 1.0
    assert got[1:3] == pytest.approx((share * tx, share * ty), abs=1e-9)
    # Yaw never turns the wrong way or too hard.
    assert got[3] * tz >= -1e-15
    assert abs(got[3]) <= abs(tz) + 1e-12


def test_full_collective_gives_way_to_roll() -> None:
    thrusts = mix(4 * MOST, 2e-3, 0.0, 0.0, ARM_X, ARM_Y, C, MOST)
    collective, tau_x, _, _ = wrench(thrusts)
    assert tau_x == pytest.approx(2e-3)
    assert collective == pytest.approx(4 * MOST - 2e-3 / ARM_Y)


@given(st.floats(-9.5e-3, 9.5e-3).filter(lambda moment: abs(moment) > 1e-6))
def test_flip_gives_the_moment_with_two_motors(a_rot: float) -> None:
    thrusts = flip_thrusts(a_rot, ARM_X)
    _, tau_x, tau_y, tau_z = wrench(thrusts)
    assert tau_y == pytest.approx(a_rot)
    assert abs(tau_x) < 1e-15
    assert abs(tau_z) < 1e-15
    still = (1, 2) if a_rot < 0 else (0, 3)
    assert [thrusts[i] for i in still] == [0.0, 0.0]


def test_flip_thrust_of_a_flown_moment() -> None:
    """Errata 7: 6.83 N mm puts both front motors at 10.72 g."""
    front = flip_thrusts(-6.83e-3, ARM_X)[0]
    assert front / 9.80665e-3 == pytest.approx(10.72, abs=0.01)
    assert flip_thrusts(math.nan, ARM_X) == (0.0, 0.0, 0.0, 0.0)
