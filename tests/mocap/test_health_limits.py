"""Each limit of the pose's health, just inside and just outside, and what is counted."""

import math
from dataclasses import replace

import pytest

from mocap_bridge.health import HealthLimits, PoseHealth, PoseVerdict, has_pose
from mocap_bridge.pose import PoseSample
from mocap_bridge.rotation import Quaternion, Vector, angle_between
from tests.mocap.judged_room import HALF_TURNS, IDENTITY, PLACE, Room, pitched

REFUSED = (PoseVerdict.JUMPED, PoseVerdict.FLIPPED)

# Sums of these are exact, so that a limit itself can be shown.
EXACT = HealthLimits(
    frame_period=1 / 128,
    frozen_repeats=1000,
    coasting_age=4 / 128,
    stale_age=12 / 128,
    lost_age=64 / 128,
    speed=8.0,
    late_warning=4 / 128,
    late_age=12 / 128,
    norm_tolerance=1 / 1024,
)
GATE = 1 / 16
"""m. What `EXACT` believes of a frame."""


def beside(x: float) -> Vector:
    return (PLACE[0] + x, PLACE[1], PLACE[2])


def exact_room(**changes: float) -> Room:
    return Room(limits=replace(EXACT, **changes)).lock(noisy=False, age=0.0)


# --- ages -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("age", "verdict"),
    [
        (0.0297, PoseVerdict.OK),
        (0.0303, PoseVerdict.COASTING),
        (0.098, PoseVerdict.COASTING),
        (0.102, PoseVerdict.STALE),
        (0.49, PoseVerdict.STALE),
        (0.51, PoseVerdict.LOST),
    ],
)
def test_the_state_by_the_age_of_the_last_good_sample(age: float, verdict: PoseVerdict) -> None:
    room = Room().lock()
    assert room.health.verdict(room.now + age) is verdict


@pytest.mark.parametrize(
    ("frames", "at", "beyond"),
    [
        (4, PoseVerdict.OK, PoseVerdict.COASTING),
        (12, PoseVerdict.COASTING, PoseVerdict.STALE),
        (64, PoseVerdict.STALE, PoseVerdict.LOST),
    ],
)
def test_an_age_limit_itself_is_still_good(frames: int, at: PoseVerdict, beyond: PoseVerdict) -> None:
    room = exact_room()
    limit = room.now + frames / 128
    assert room.health.verdict(limit) is at
    assert room.health.verdict(math.nextafter(limit, math.inf)) is beyond


@pytest.mark.parametrize(
    ("silence", "verdict"),
    [(9, PoseVerdict.OK), (11, PoseVerdict.STALE), (49, PoseVerdict.STALE), (51, PoseVerdict.LOST)],
)
def test_the_sample_after_a_silence_does_not_hide_it(silence: int, verdict: PoseVerdict) -> None:
    """Nobody asked during the silence."""
    room = Room().lock()
    room.skip(silence - 1)
    assert room.show() is verdict
    assert room.health.verdict() is verdict


@pytest.mark.parametrize("silence", [0.2, 0.6])
def test_what_was_never_locked_is_not_lost_but_unknown(silence: float) -> None:
    room = Room()
    for _ in range(5):
        room.show()
    assert room.health.verdict(room.now + silence) is PoseVerdict.UNKNOWN
    room.skip(round(silence / 0.01))
    assert [room.show() for _ in range(10)] == [PoseVerdict.UNKNOWN] * 9 + [PoseVerdict.OK]


def test_a_reason_that_is_over_is_not_named_again() -> None:
    room = Room().lock()
    assert room.show(None, None) is PoseVerdict.OCCLUDED
    assert room.show() is PoseVerdict.OK
    room.skip(5)
    assert room.health.verdict() is PoseVerdict.COASTING


@pytest.mark.parametrize(
    ("age", "verdict", "warnings"),
    [
        (0.0345, PoseVerdict.OK, 0),
        (0.0355, PoseVerdict.OK, 1),
        (0.098, PoseVerdict.OK, 1),
        (0.102, PoseVerdict.LATE, 1),
    ],
)
def test_how_late_a_sample_may_come(age: float, verdict: PoseVerdict, warnings: int) -> None:
    room = Room().lock()
    assert room.show(age=age) is verdict
    assert room.health.statistics().late_warnings == warnings


def test_a_sample_as_late_as_the_limits_is_not_later() -> None:
    room = exact_room()
    room.show(noisy=False, age=4 / 128)
    assert room.health.statistics().late_warnings == 0
    room.show(noisy=False, age=math.nextafter(4 / 128, 1.0) + 1e-12)
    assert room.health.statistics().late_warnings == 1
    assert room.show(noisy=False, age=12 / 128) is PoseVerdict.OK
    assert room.show(noisy=False, age=12 / 128 + 1e-12) is PoseVerdict.LATE


# --- poses ------------------------------------------------------------------------------------------------


def sample(**changes: object) -> PoseSample:
    good = PoseSample("cf1", 1, 50.0, 50.0, PLACE, IDENTITY, False, None, None)
    return replace(good, **changes)


def test_what_is_a_pose() -> None:
    assert has_pose(sample(), 1e-3)
    for at in range(3):
        on_a_plane = tuple(0.0 if i == at else value for i, value in enumerate(PLACE))
        assert has_pose(sample(position=on_a_plane), 1e-3), "only the origin means that nothing was seen"
    assert not has_pose(sample(occluded=True), 1e-3), "the source says so itself"
    assert not has_pose(sample(position=None), 1e-3)
    assert not has_pose(sample(quaternion=None), 1e-3)
    for part in range(4):
        for bad in (math.nan, math.inf, -math.inf):
            broken = tuple(bad if i == part else value for i, value in enumerate(IDENTITY))
            assert not has_pose(sample(quaternion=broken), 1e-3)


@pytest.mark.parametrize(("off", "verdict"), [(0.00098, PoseVerdict.OK), (0.00102, PoseVerdict.OCCLUDED)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_how_far_a_quaternion_may_be_from_unit_length(off: float, verdict: PoseVerdict, sign: float) -> None:
    room = Room().lock()
    assert room.show(quaternion=(0.0, 0.0, 0.0, 1.0 + sign * off)) is verdict


def test_a_quaternion_off_by_the_tolerance_is_taken() -> None:
    assert has_pose(sample(quaternion=(0.0, 0.0, 0.0, 1.0 + 1 / 1024)), 1 / 1024)
    assert not has_pose(sample(quaternion=(0.0, 0.0, 0.0, math.nextafter(1.0 + 1 / 1024, 2.0))), 1 / 1024)


# --- gates ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frames", "elapsed", "gate"),
    [
        (1, 0.01, 0.1),
        (1, 0.002, 0.1),  # receipt times bunch: a frame lasts a frame
        (5, 0.002, 0.5),  # and five last five
        (1, 0.05, 0.5),  # a source that numbers only what it sends
        (5, 0.05, 0.5),
        (-8, 0.002, 0.1),  # a restarted source
        (1000, 0.01, 0.1),  # a counter that leaps says nothing about time
        (30, 0.3, 1.0),
    ],
)
def test_how_far_a_body_is_believed_to_have_moved(frames: int, elapsed: float, gate: float) -> None:
    """10 m/s for as long as it was unseen, and no more than 1 m."""
    for share, refused in ((0.98, False), (1.02, True)):
        room = Room().lock()
        verdict = room.show(beside(share * gate), frames=frames, elapsed=elapsed)
        assert (verdict is PoseVerdict.JUMPED) == refused, share
        assert verdict in (PoseVerdict.JUMPED, PoseVerdict.OK, PoseVerdict.STALE)


@pytest.mark.parametrize(
    ("frames", "elapsed", "gate_deg"),
    [(1, 0.01, 30.0), (1, 0.002, 30.0), (3, 0.03, 90.0), (5, 0.05, 120.0), (30, 0.3, 120.0)],
)
def test_how_far_a_body_is_believed_to_have_turned(frames: int, elapsed: float, gate_deg: float) -> None:
    """3000 deg/s for as long as it was unseen, and no more than 120 deg."""
    for share, refused in ((0.98, False), (1.02, True)):
        room = Room().lock()
        turn = pitched(math.radians(share * gate_deg))
        verdict = room.show(quaternion=turn, frames=frames, elapsed=elapsed)
        assert (verdict is PoseVerdict.FLIPPED) == refused, share
        assert verdict in (PoseVerdict.FLIPPED, PoseVerdict.OK, PoseVerdict.STALE)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_of_the_first_sample_no_direction_is_expected(axis: int, sign: float) -> None:
    room = Room()
    room.show()
    second = tuple(value + sign * 0.098 * (i == axis) for i, value in enumerate(PLACE))
    assert room.show(second) is PoseVerdict.UNKNOWN


@pytest.mark.parametrize("speed", [3.0, 9.0, -9.0])
def test_a_body_that_flies_on_is_where_it_is_expected(speed: float) -> None:
    room = Room().lock()
    assert {room.show(beside(0.01 * speed * i)) for i in range(1, 30)} == {PoseVerdict.OK}


@pytest.mark.parametrize(("speed", "verdict"), [(4.9, PoseVerdict.OK), (5.1, PoseVerdict.JUMPED)])
def test_a_body_does_not_turn_round_within_a_frame(speed: float, verdict: PoseVerdict) -> None:
    """From 5 m/s to as much backwards is 10 m/s beside the expected."""
    room = Room().lock()
    for i in range(10):
        assert room.show(beside(0.01 * speed * i)) is PoseVerdict.OK
    assert room.show(beside(0.01 * speed * 8)) is verdict


def test_a_gate_itself_is_still_inside() -> None:
    assert exact_room().show(beside(GATE), noisy=False, age=0.0) is PoseVerdict.OK
    assert exact_room().show(beside(GATE + 1e-12), noisy=False, age=0.0) is PoseVerdict.JUMPED
    turn = pitched(1.0)
    angle = angle_between(IDENTITY, turn)
    for limit, verdict in ((angle, PoseVerdict.OK), (math.nextafter(angle, 0.0), PoseVerdict.FLIPPED)):
        room = exact_room(rotation_gate_limit=limit)
        assert room.show(quaternion=turn, noisy=False, age=0.0, frames=8) is verdict


def test_the_frame_count_is_believed_up_to_the_latest_age_before_the_clock() -> None:
    for frames, refused in ((13, False), (14, True)):
        verdict = exact_room().show(beside(1.5 * GATE), noisy=False, age=0.0, frames=frames, elapsed=1 / 128)
        assert (verdict in REFUSED) == refused, frames


# --- another place ----------------------------------------------------------------------------------------


def test_a_health_that_was_told_nothing_is_on_the_ground() -> None:
    room = Room()
    room.health = PoseHealth(HealthLimits(), lambda: room.now)
    room.lock()
    verdicts = [room.show(beside(0.5)) for _ in range(10)]
    assert verdicts == [PoseVerdict.JUMPED] * 9 + [PoseVerdict.OK]


def test_another_place_counts_only_in_a_row() -> None:
    room = Room(in_flight=False).lock()
    for _ in range(6):
        assert [room.show(beside(0.3)) for _ in range(4)] == [PoseVerdict.JUMPED] * 4
        assert room.show() is PoseVerdict.OK
    assert room.health.statistics().relocks == 0


def test_many_places_are_not_another_place() -> None:
    room = Room(in_flight=False).lock()
    assert {room.show(beside(2.0 + 0.7 * (i % 3))) for i in range(40)} == {PoseVerdict.JUMPED}
    assert room.health.statistics().relocks == 0


@pytest.mark.parametrize(("step", "accepted"), [(GATE, True), (GATE + 1e-12, False), (1.02 * GATE, False)])
def test_another_place_may_move_as_fast_as_the_body(step: float, accepted: bool) -> None:
    room = exact_room()
    room.health.in_flight = False
    verdicts = [room.show(beside(2.0 + step * i), noisy=False, age=0.0) for i in range(10)]
    assert verdicts == [PoseVerdict.JUMPED] * 9 + [PoseVerdict.OK if accepted else PoseVerdict.JUMPED]


@pytest.mark.parametrize(
    ("place", "verdict"),
    [(GATE, PoseVerdict.OK), (GATE * 1.02, PoseVerdict.JUMPED), (GATE * 0.98, PoseVerdict.OK)],
)
def test_between_two_places_the_nearer_counts_and_the_believed_one_at_a_tie(
    place: float, verdict: PoseVerdict
) -> None:
    """Shares of the gates: two frames since the body was seen, one since the other place was."""
    room = exact_room()
    assert room.show(beside(1.5 * GATE), noisy=False, age=0.0) is PoseVerdict.JUMPED
    assert room.show(beside(place), noisy=False, age=0.0) is verdict


@pytest.mark.parametrize(
    ("position", "turn", "reason"),
    [(beside(0.5), IDENTITY, PoseVerdict.JUMPED), (PLACE, HALF_TURNS[0], PoseVerdict.FLIPPED)],
)
def test_another_place_that_persists_in_flight_is_lost_at_once_and_stays_so(
    position: Vector, turn: Quaternion, reason: PoseVerdict
) -> None:
    room = Room().lock()
    # At 200 Hz: before the age of the last good sample says anything.
    verdicts = [room.show(position, turn, elapsed=0.005) for _ in range(10)]
    assert verdicts == [reason] * 9 + [PoseVerdict.LOST]
    assert room.health.verdict() is PoseVerdict.LOST
    assert room.health.verdict(room.now + 0.2) is PoseVerdict.LOST
    assert [room.show() for _ in range(10)] == [PoseVerdict.LOST] * 9 + [PoseVerdict.OK]


# --- counts -----------------------------------------------------------------------------------------------


def test_every_sample_is_counted_once_and_under_its_verdict() -> None:
    room = Room()
    for _ in range(15):
        room.show()
    room.show(None, None)
    room.show(age=0.2)
    for _ in range(2):
        room.show(beside(0.5))
    room.show(quaternion=HALF_TURNS[1])
    for _ in range(3):
        room.show()
    room.skip(19)
    for _ in range(12):
        room.show()
    statistics = room.health.statistics()
    assert statistics.samples == 15 + 1 + 1 + 2 + 1 + 3 + 12
    assert statistics.good == 6 + 3 + 3
    assert statistics.rejects == {
        PoseVerdict.UNKNOWN: 9,
        PoseVerdict.OCCLUDED: 1,
        PoseVerdict.LATE: 1,
        PoseVerdict.JUMPED: 2,
        PoseVerdict.FLIPPED: 1,
        PoseVerdict.STALE: 9,
    }
    assert statistics.late_warnings == 1
    assert statistics.missing_frames == 19
    assert (statistics.duplicates, statistics.restarts, statistics.relocks) == (0, 0, 0)
