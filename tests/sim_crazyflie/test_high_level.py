"""The high-level commander's plans and the commander's priorities."""

import errno
import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backend.crazyflie.commander import (
    Commander,
    Priority,
    compress_quaternion,
    decode_generic,
)
from sim_backend.crazyflie.high_level import (
    FlatState,
    HighLevelCommand,
    HighLevelCommander,
    PlannerState,
    smooth_polynomial,
)
from sim_backend.crazyflie.interfaces import FirmwareAssertion
from sim_backend.crazyflie.ports.localization import decompress_quaternion
from sim_backend.crazyflie.setpoint import Mode, Setpoint

ON_FLOOR = FlatState((0.3, -0.2, 0.02), yaw=0.4)


def takeoff(height: float, duration: float) -> bytes:
    return struct.pack("<Bff?f", 0, height, 0.0, True, duration)


def go_to(x: float, y: float, z: float, yaw: float, duration: float, relative: bool = False) -> bytes:
    return struct.pack("<BBB5f", 0, relative, False, x, y, z, yaw, duration)


@pytest.fixture
def planner() -> HighLevelCommander:
    commander = HighLevelCommander()
    commander.setpoint(ON_FLOOR, 0.0)
    return commander


@pytest.fixture
def hovering(planner: HighLevelCommander) -> HighLevelCommander:
    assert planner.command(HighLevelCommand.TAKEOFF_2, takeoff(0.5, 2.0), 0.0) == 0
    return planner


def at(planner: HighLevelCommander, now: float) -> Setpoint:
    setpoint = planner.setpoint(ON_FLOOR, now)
    assert setpoint is not None
    return setpoint


@given(
    st.floats(0.1, 20),
    *[st.tuples(*[st.floats(-5, 5)] * 3) for _ in range(2)],
)
def test_polynomial_meets_its_ends_without_jerk(
    duration: float, start: tuple[float, float, float], end: tuple[float, float, float]
) -> None:
    p = np.polynomial.Polynomial(smooth_polynomial(duration, start, end))
    scale = 1.0 + abs(np.array([*start, *end])).max() * max(1.0, 1.0 / duration**3, duration**2)
    for t, ends in ((0.0, start), (duration, end)):
        for order in range(3):
            assert (p.deriv(order) if order else p)(t) == pytest.approx(ends[order], abs=1e-8 * scale)
        assert p.deriv(3)(t) == pytest.approx(0.0, abs=1e-7 * scale)


def test_takeoff_rises_straight_and_stays(hovering: HighLevelCommander) -> None:
    assert hovering.state is PlannerState.FLYING
    middle, end, later = at(hovering, 1.0), at(hovering, 2.0), at(hovering, 9.0)
    assert middle.position[2] == pytest.approx((0.5 + 0.02) / 2)
    assert middle.velocity[2] > 0.4
    assert end.position == pytest.approx((0.3, -0.2, 0.5))
    assert later.position == pytest.approx((0.3, -0.2, 0.5))
    assert later.velocity == (0.0, 0.0, 0.0)
    assert later.yaw == pytest.approx(0.4)
    assert hovering.finished(2.0)
    assert not hovering.finished(1.99)


def test_second_takeoff_is_refused(hovering: HighLevelCommander) -> None:
    assert hovering.command(HighLevelCommand.TAKEOFF_2, takeoff(1.0, 2.0), 3.0) == 1


def test_go_to_starts_from_the_plan_and_turns_the_short_way(hovering: HighLevelCommander) -> None:
    assert hovering.command(HighLevelCommand.GO_TO_2, go_to(1.0, 0.0, 1.0, math.radians(-170), 2.0), 3.0) == 0
    assert hovering.command(HighLevelCommand.GO_TO_2, go_to(1.0, 0.0, 1.0, math.radians(170), 2.0), 6.0) == 0
    start, middle, end = at(hovering, 6.0), at(hovering, 7.0), at(hovering, 8.0)
    assert start.position == pytest.approx((1.0, 0.0, 1.0))
    assert math.cos(middle.yaw) == pytest.approx(-1.0), "over 180 degrees, not through 0"
    assert math.cos(end.yaw - math.radians(170)) == pytest.approx(1.0)


def test_relative_go_to_adds_to_the_setpoint(hovering: HighLevelCommander) -> None:
    hovering.command(HighLevelCommand.GO_TO_2, go_to(0.5, 0.0, 0.25, 0.0, 1.0, relative=True), 3.0)
    assert at(hovering, 5.0).position == pytest.approx((0.8, -0.2, 0.75))


def test_landing_ends_in_motors_off(hovering: HighLevelCommander) -> None:
    assert hovering.command(HighLevelCommand.LAND_2, takeoff(0.0, 2.0), 3.0) == 0
    assert hovering.command(HighLevelCommand.LAND_2, takeoff(0.0, 2.0), 3.5) == 1, "already landing"
    assert not at(hovering, 4.9).is_null
    at(hovering, 5.0)
    assert at(hovering, 5.01).is_null


def test_blocked_commander_answers_busy_and_forgets_its_plan(hovering: HighLevelCommander) -> None:
    hovering.block(True)
    assert hovering.state is PlannerState.IDLE
    assert hovering.command(HighLevelCommand.TAKEOFF_2, takeoff(0.5, 2.0), 5.0) == errno.EBUSY
    hovering.block(False)
    assert hovering.command(HighLevelCommand.TAKEOFF_2, takeoff(0.5, 2.0), 5.0) == 0


def test_unknown_and_malformed_commands(planner: HighLevelCommander) -> None:
    assert planner.command(HighLevelCommand.SPIRAL, bytes(27), 0.0) == errno.ENOEXEC
    assert planner.command(99, b"", 0.0) == errno.ENOEXEC
    assert planner.command(HighLevelCommand.TAKEOFF_2, b"\0\0", 0.0) == errno.ENOEXEC


def test_group_mask_selects(planner: HighLevelCommander) -> None:
    planner.command(HighLevelCommand.SET_GROUP_MASK, b"\x02", 0.0)
    payload = bytearray(takeoff(0.5, 2.0))
    payload[0] = 1
    assert planner.command(HighLevelCommand.TAKEOFF_2, bytes(payload), 0.0) == 0
    assert planner.state is PlannerState.IDLE
    payload[0] = 2
    planner.command(HighLevelCommand.TAKEOFF_2, bytes(payload), 0.0)
    assert planner.state is PlannerState.FLYING


def test_uploaded_polynomial_flies_relative_and_backwards(planner: HighLevelCommander) -> None:
    piece = [0.0] * 32
    piece[1] = 1.0  # x = t for 2 s
    piece[16] = 0.7  # z = 0.7
    planner.memory[132:264] = struct.pack("<33f", *piece, 2.0)
    assert (
        planner.command(HighLevelCommand.DEFINE_TRAJECTORY, struct.pack("<BBBIB", 3, 1, 0, 132, 1), 0.0) == 0
    )
    assert (
        planner.command(HighLevelCommand.START_TRAJECTORY_2, struct.pack("<BBBBBf", 0, 0, 0, 0, 3, 2.0), 0.0)
        == 0
    )
    assert at(planner, 2.0).position == pytest.approx((1.0, 0.0, 0.7))
    assert at(planner, 2.0).velocity[0] == pytest.approx(0.5)
    assert at(planner, 9.0).position == pytest.approx((2.0, 0.0, 0.7))
    planner.command(HighLevelCommand.START_TRAJECTORY_2, struct.pack("<BBBBBf", 0, 1, 0, 1, 3, 1.0), 10.0)
    assert at(planner, 10.5).position == pytest.approx((1.5, 0.0, 0.7))
    assert at(planner, 10.5).velocity[0] == pytest.approx(-1.0)
    outside = struct.pack("<BBBIB", 4, 1, 0, 4000, 1)
    planner.command(HighLevelCommand.DEFINE_TRAJECTORY, outside, 0.0)
    start = struct.pack("<BBBBBf", 0, 0, 0, 0, 4, 1.0)
    assert planner.command(HighLevelCommand.START_TRAJECTORY_2, start, 0.0) == errno.ENOEXEC


# The commander


@pytest.fixture
def events() -> list[str]:
    return []


@pytest.fixture
def commander(events: list[str]) -> Commander:
    return Commander(lambda: events.append("stop"), lambda: events.append("tell"))


def test_crtp_setpoints_win_until_relaxed(commander: Commander, events: list[str]) -> None:
    commander.set(Setpoint(), Priority.HIGH_LEVEL, 10)
    commander.generic(struct.pack("<Bffff", 7, 1.0, 2.0, 3.0, 90.0), 20)
    assert events == ["stop"]
    commander.set(Setpoint(), Priority.HIGH_LEVEL, 30)
    assert commander.setpoint.position == (1.0, 2.0, 3.0)
    assert commander.set_at == 20
    assert commander.setpoint.yaw == pytest.approx(math.pi / 2)
    commander.relax()
    commander.set(Setpoint(), Priority.HIGH_LEVEL, 40)
    assert commander.setpoint.is_null
    assert events == ["stop", "tell"]


def test_a_setpoint_that_is_set_again_is_the_same_and_young(commander: Commander) -> None:
    """An engine knows a setpoint by its identity: who sets it changes nothing of it."""
    wish = Setpoint(mode_x=Mode.ABSOLUTE, position=(1.0, 2.0, 3.0))
    commander.set(wish, Priority.CRTP, 20)
    commander.set(wish, Priority.CRTP, 30)
    assert commander.setpoint is wish
    assert commander.set_at == 30
    with pytest.raises(AttributeError):
        wish.position = (0.0, 0.0, 0.0)  # type: ignore[misc]


def test_thrust_is_locked_until_a_zero(commander: Commander) -> None:
    commander.rpyt(struct.pack("<fffH", 0, 0, 0, 30000), 1)
    assert commander.setpoint.thrust == 0
    commander.rpyt(struct.pack("<fffH", 0, 0, 0, 0), 2)
    commander.rpyt(struct.pack("<fffH", 5, -10, 20, 65535), 3)
    assert commander.setpoint.thrust == 60000
    assert commander.setpoint.roll == pytest.approx(math.radians(5))
    assert commander.setpoint.pitch == pytest.approx(math.radians(10))
    assert commander.setpoint.rates[2] == pytest.approx(math.radians(-20))
    commander.rpyt(struct.pack("<fffH", 0, 0, 0, 999), 4)
    assert commander.setpoint.thrust == 0


def test_full_state_in_si() -> None:
    quaternion = (0.1, -0.2, 0.3, math.sqrt(1 - 0.14))
    numbers = [1000, -2000, 300, 40, 50, 60, 70, 80, 90, compress_quaternion(quaternion), 1, 2, -30000]
    setpoint = decode_generic(b"\x06" + struct.pack("<9hI3h", *numbers))
    assert setpoint.position == pytest.approx((1.0, -2.0, 0.3))
    assert setpoint.rates[2] == pytest.approx(-30.0)
    assert setpoint.quaternion == pytest.approx(quaternion, abs=2e-3)
    assert setpoint.mode_quat is Mode.ABSOLUTE


@pytest.mark.parametrize("kind", [1, 2, 4, 5, 6, 8, 9, 10, 11])
def test_wrong_length_is_an_assert(kind: int) -> None:
    with pytest.raises(FirmwareAssertion, match=f"type {kind}"):
        decode_generic(bytes([kind, 1, 2, 3]))


def test_lengths_that_the_firmware_does_not_check() -> None:
    assert decode_generic(b"\x00garbage").is_null
    assert decode_generic(b"\x63").is_null, "unknown type"
    assert decode_generic(b"\x07" + struct.pack("<f", 1.5)).position == (1.5, 0.0, 0.0)


@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(c * c for c in q) > 1e-3))
def test_quaternion_compression_round_trip(raw: tuple[float, float, float, float]) -> None:
    q = np.array(raw) / np.linalg.norm(raw)
    back = np.array(decompress_quaternion(compress_quaternion(tuple(q))))
    assert abs(abs(q @ back) - 1.0) < 1e-5


def test_a_landing_right_after_a_hand_over_comes_down_where_the_drone_is(
    hovering: HighLevelCommander,
) -> None:
    at(hovering, 2.0)
    here = FlatState((1.7, 0.1, 0.48), (0.5, 0.0, 0.0))
    hovering.hold(here, 2.0)
    assert hovering.command(HighLevelCommand.LAND_2, takeoff(0.0, 2.0), 2.001) == 0
    begins, ends = at(hovering, 2.01), at(hovering, 4.1)
    assert begins.position == pytest.approx(here.position, abs=0.02)
    assert ends.position[:2] == pytest.approx(here.position[:2], abs=1e-6)
