"""The hold: where it leads a vehicle that arrives with a speed."""

import math

import pytest

from onboard.landing.state_machine import LandingOutput, LandingState
from tests.onboard.landing.exact import tip_over
from tests.onboard.landing.rig import LEVEL, PLAN, Rig

HEIGHT = PLAN.ceiling_z - 0.7
"""m. Where it sinks to."""


def hold_from(position: tuple[float, float, float], velocity: tuple[float, float, float]) -> Rig:
    """A rig that begins to hold there."""
    rig = Rig()
    rig.brake()
    rig.step(position=position, velocity=velocity, abort=False)
    assert rig.state is LandingState.HOLD
    return rig


def at(rig: Rig, t: float) -> LandingOutput:
    """The setpoint `t` s after the hold began; the vehicle stays where it is."""
    return rig.step(time=float(rig.memory["hold_time"]) + t, velocity=(0.0, 0.0, 0.0))


def stopped(p: float, v: float, a: float, t: float) -> tuple[float, float, float]:
    """Position, velocity and acceleration `t` s after a stop with `a` began, along one line."""
    end = abs(v) / a
    if t >= end:
        return p + 0.5 * v * end, 0.0, 0.0
    pull = -math.copysign(a, v)
    return p + v * t + 0.5 * pull * t * t, v + pull * t, pull


SIDEWAYS = [(1.5, 0.0), (-1.5, 0.0), (0.0, 0.8), (0.0, -0.8), (0.9, -1.2)]
TIMES = [0.0, 0.01, 0.1, 0.19, 0.21, 0.36, 0.39, 1.0, 5.0]


@pytest.mark.parametrize(("vx", "vy"), SIDEWAYS)
@pytest.mark.parametrize("t", TIMES)
def test_sideways_it_stops_with_4_metres_per_second_squared(vx: float, vy: float, t: float) -> None:
    rig = hold_from((0.3, 0.2, 1.0), (vx, vy, 0.2))
    output = at(rig, t)
    speed = math.hypot(vx, vy)
    way, fast, pull = stopped(0.0, speed, 4.0, t)
    for axis, (start, share) in enumerate(((0.3, vx / speed), (0.2, vy / speed))):
        assert output.position[axis] == pytest.approx(start + share * way, abs=1e-6)
        assert output.velocity[axis] == pytest.approx(share * fast, abs=1e-6)
        assert output.acceleration[axis] == pytest.approx(share * pull, abs=1e-6)


@pytest.mark.parametrize("vz", [0.2, 1.0, -0.6, -1.2])
@pytest.mark.parametrize("t", TIMES)
def test_below_its_height_it_stops_where_it_can(vz: float, t: float) -> None:
    rig = hold_from((0.0, 0.0, 0.9), (0.0, 0.0, vz))
    output = at(rig, t)
    z, fast, pull = stopped(0.9, vz, 4.0, t)
    assert output.position == pytest.approx((0.0, 0.0, z), abs=1e-6)
    assert output.velocity == pytest.approx((0.0, 0.0, fast), abs=1e-6)
    assert output.acceleration == pytest.approx((0.0, 0.0, pull), abs=1e-6)


def test_at_its_height_it_stops_as_below() -> None:
    output = at(hold_from((0.0, 0.0, HEIGHT), (0.0, 0.0, -0.6)), 0.05)
    assert output.position[2] == pytest.approx(HEIGHT - 0.6 * 0.05 + 2.0 * 0.05**2)
    assert output.velocity[2] == pytest.approx(-0.6 + 4.0 * 0.05)


@pytest.mark.parametrize("above", [0.01, 0.1, 0.4])
@pytest.mark.parametrize("t", [0.0, 0.015, 0.025, 0.19, 0.21, 0.79, 0.81, 3.0])
def test_above_its_height_it_sinks_with_half_a_metre_per_second(above: float, t: float) -> None:
    rig = hold_from((0.0, 0.0, HEIGHT + above), (0.0, 0.0, -0.6))
    output = at(rig, t)
    sinking = 0.5 * t < above
    assert output.position[2] == pytest.approx(HEIGHT + max(0.0, above - 0.5 * t), abs=1e-6)
    assert output.velocity == pytest.approx((0.0, 0.0, -0.5 if sinking else 0.0))
    assert output.acceleration == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("z", [0.9, HEIGHT + 0.2])
def test_a_clock_that_went_back_holds_at_the_begin(z: float) -> None:
    rig = hold_from((0.3, 0.2, z), (1.0, 0.5, -0.6))
    begin = at(rig, 0.0)
    assert at(rig, -0.2)[1:4] == begin[1:4]


@pytest.mark.parametrize("z", [0.9, HEIGHT])
def test_without_a_speed_it_stays(z: float) -> None:
    rig = hold_from((0.3, 0.2, 0.9), (0.0, 0.0, 0.1))
    rig.memory["hold_velocity"][:] = 0.0
    rig.memory["hold_position"][2] = z
    for t in (0.0, 0.5):
        assert at(rig, t)[1:4] == ((0.3, 0.2, z), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_a_hold_remembers_where_it_began() -> None:
    rig = hold_from((0.3, 0.2, 0.9), (1.0, 0.5, -0.6))
    assert rig.memory["hold_time"] == rig.inputs.time
    first = at(rig, 0.0)
    assert first.position == (0.3, 0.2, 0.9)
    assert first.velocity == pytest.approx((1.0, 0.5, -0.6))


# --- handing over -----------------------------------------------------------------------------------------


def handed_over(velocity: tuple[float, float, float], after: float) -> bool:
    """Whether a hold that began `after` s ago, and is no longer armed, is left to the other controller."""
    rig = hold_from((0.0, 0.0, 1.0), (0.0, 0.0, 0.1))
    rig.memory["hold_time"] = 0.0
    rig.step(time=after, velocity=velocity, trajectory_armed=False)
    return rig.state is LandingState.IDLE


@pytest.mark.parametrize(
    ("velocity", "slow"),
    [
        ((0.6, 0.0, 0.0), True),
        ((0.0, -0.6, 0.0), True),
        ((0.0, 0.0, -0.6), True),
        ((0.0, 0.0, 0.2), True),
        ((0.601, 0.0, 0.0), False),
        ((0.43, 0.43, 0.0), False),
        ((0.0, 0.43, -0.43), False),
        ((0.0, 0.0, 0.201), False),
        ((-0.59, 0.0, 0.12), False),
    ],
)
def test_a_hold_is_handed_over_when_it_has_slowed_down_or_has_had_its_time(
    velocity: tuple[float, float, float], slow: bool
) -> None:
    assert handed_over(velocity, 0.02) == slow
    assert handed_over(velocity, 1.5) == slow
    assert handed_over(velocity, math.nextafter(1.5, 2.0))


def test_a_hold_that_is_still_armed_is_not_handed_over() -> None:
    rig = hold_from((0.0, 0.0, 1.0), (0.0, 0.0, 0.1))
    rig.step(time=rig.inputs.time + 9.0, velocity=(0.0, 0.0, 0.0), trajectory_armed=True)
    assert rig.state is LandingState.HOLD


def test_motors_that_are_cut_are_not_handed_over() -> None:
    """Slow, no longer armed and long enough in its hold: tilt comes first."""
    rig = hold_from((0.0, 0.0, 1.0), (0.0, 0.0, 0.1))
    rig.memory["hold_time"] = rig.inputs.time - 9.0
    rig.step(
        **{**tip_over(80.0), "quaternion": LEVEL, "velocity": (0.0, 0.0, 0.0), "trajectory_armed": False}
    )
    assert rig.state is LandingState.CUT
