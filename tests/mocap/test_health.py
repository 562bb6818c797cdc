import csv
import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocap_bridge.health import HealthLimits, PoseHealth, PoseVerdict
from mocap_bridge.pose import PoseSample
from mocap_bridge.rotation import Quaternion, Vector, multiply
from tests.drawn_examples import examples
from tests.mocap.judged_room import HALF_TURNS, IDENTITY, Room, pitched


def test_unknown_until_ten_good_samples():
    room = Room()
    assert room.health.verdict() is PoseVerdict.UNKNOWN
    assert [room.show() for _ in range(10)] == [PoseVerdict.UNKNOWN] * 9 + [PoseVerdict.OK]


def test_bad_samples_before_the_lock_start_the_count_again():
    room = Room()
    for _ in range(9):
        room.show()
    assert room.show(None, None) is PoseVerdict.OCCLUDED
    assert [room.show() for _ in range(10)] == [PoseVerdict.UNKNOWN] * 9 + [PoseVerdict.OK]


@pytest.mark.parametrize(
    ("position", "quaternion"),
    [
        (None, None),
        ((0.0, 0.0, 0.0), IDENTITY),
        ((math.nan, 0.0, 1.0), IDENTITY),
        ((math.inf, 0.0, 1.0), IDENTITY),
        ((1.0, 2.0, 1.5), (0.0, 0.0, 0.0, 0.0)),
        ((1.0, 2.0, 1.5), (0.0, 0.0, 0.0, 1.0011)),
        ((1.0, 2.0, 1.5), (math.nan, 0.0, 0.0, 1.0)),
        ((1.0, 2.0, 1.5), None),
    ],
)
def test_what_is_no_pose_is_never_ok(position: Vector | None, quaternion: Quaternion | None):
    room = Room().lock()
    assert room.show(position, quaternion, noisy=False) is PoseVerdict.OCCLUDED
    assert room.show() is PoseVerdict.OK


def test_states_by_age_and_the_latch():
    room = Room().lock()
    room.skip(2)
    assert room.health.verdict() is PoseVerdict.OK
    room.skip(2)
    assert room.health.verdict() is PoseVerdict.COASTING
    assert room.show() is PoseVerdict.OK
    room.skip(11)
    assert room.health.verdict() is PoseVerdict.STALE
    # A good sample does not end it; ten in a row do.
    assert [room.show() for _ in range(10)] == [PoseVerdict.STALE] * 9 + [PoseVerdict.OK]
    room.skip(51)
    assert room.health.verdict() is PoseVerdict.LOST
    assert [room.show() for _ in range(4)] == [PoseVerdict.LOST] * 4
    assert room.show(None, None) is PoseVerdict.OCCLUDED
    assert [room.show() for _ in range(10)] == [PoseVerdict.LOST] * 9 + [PoseVerdict.OK]


def test_occlusion_is_named_as_the_reason_while_coasting():
    room = Room().lock()
    verdicts = []
    for _ in range(12):
        room.show(None, None)
        verdicts.append(room.health.verdict())
    assert verdicts[:3] == [PoseVerdict.OK] * 3
    assert verdicts[3:10] == [PoseVerdict.OCCLUDED] * 7
    assert verdicts[10:] == [PoseVerdict.STALE] * 2


def test_a_frozen_source_is_known_at_the_third_identical_position():
    room = Room().lock()
    still = (1.0, 2.0, 1.5)
    verdicts = [room.show(still, noisy=False) for _ in range(5)]
    assert verdicts == [
        PoseVerdict.OK,
        PoseVerdict.OK,
        PoseVerdict.FROZEN,
        PoseVerdict.FROZEN,
        PoseVerdict.FROZEN,
    ]
    assert room.show() is PoseVerdict.OK
    for _ in range(14):
        room.show(still, noisy=False)
    assert room.health.verdict() is PoseVerdict.STALE


def test_a_late_sample_is_refused_and_an_old_one_counted():
    room = Room().lock()
    assert room.show(age=0.036) is PoseVerdict.OK
    assert room.show(age=0.101) is PoseVerdict.LATE
    assert room.health.statistics().late_warnings == 2


@pytest.mark.parametrize("turn", HALF_TURNS)
@pytest.mark.parametrize("in_flight", [True, False])
def test_a_single_flipped_frame_is_refused_and_the_next_is_good(turn: Quaternion, in_flight: bool):
    room = Room(in_flight).lock()
    assert room.show(quaternion=turn) is PoseVerdict.FLIPPED
    assert room.show() is PoseVerdict.OK


@pytest.mark.parametrize("step", [0.11, 0.5, 5.0])
def test_a_single_jump_is_refused_and_the_next_is_good(step: float):
    room = Room().lock()
    assert room.show((1.0 + step, 2.0, 1.5)) is PoseVerdict.JUMPED
    assert room.show() is PoseVerdict.OK


@pytest.mark.parametrize(
    ("position", "turn"), [((1.3, 2.0, 1.5), IDENTITY), ((1.0, 2.0, 1.5), HALF_TURNS[2])]
)
def test_a_persistent_new_pose_is_accepted_on_the_ground_and_lost_in_flight(
    position: Vector, turn: Quaternion
):
    ground = Room(in_flight=False).lock()
    verdicts = [ground.show(position, turn) for _ in range(12)]
    assert PoseVerdict.OK not in verdicts[:9]
    assert verdicts[9:] == [PoseVerdict.OK] * 3
    assert ground.health.statistics().relocks == 1

    flight = Room(in_flight=True).lock()
    verdicts = [flight.show(position, turn) for _ in range(200)]
    assert PoseVerdict.OK not in verdicts
    assert verdicts[9] is PoseVerdict.LOST
    assert flight.health.verdict() is PoseVerdict.LOST
    # The body where it was believed to be: ten good samples end it.
    assert [flight.show() for _ in range(10)] == [PoseVerdict.LOST] * 9 + [PoseVerdict.OK]


def test_a_persistent_new_pose_is_accepted_after_landing():
    room = Room().lock()
    for _ in range(30):
        room.show((1.5, 2.0, 1.5))
    room.health.in_flight = False
    assert room.show((1.5, 2.0, 1.5)) is PoseVerdict.OK


def test_an_inverted_landing_is_believed_to_the_end():
    """A flip at 35 rad/s through 180 deg while climbing at 3 m/s, then a dead stop at the ceiling."""
    room = Room().lock()
    for i in range(20):
        assert room.show((1.0, 2.0, 1.5 + 0.03 * i)) is PoseVerdict.OK
    top = 1.5 + 0.03 * 19
    for i in range(1, 10):
        angle = min(0.35 * i, math.pi)
        assert room.show((1.0 + 0.01 * i, 2.0, top + 0.03 * i), pitched(-angle)) is PoseVerdict.OK
    for _ in range(20):
        assert room.show((1.09, 2.0, top + 0.27), pitched(-math.pi)) is PoseVerdict.OK


def test_a_flip_seen_through_a_hole_of_50_ms_is_believed():
    room = Room().lock()
    for i in range(1, 9):
        visible = not 2 <= i <= 6
        verdict = room.show((1.0, 2.0, 1.5 + 0.025 * i) if visible else None, pitched(-0.25 * i))
        assert verdict is (PoseVerdict.OK if visible else PoseVerdict.OCCLUDED)


def test_a_marker_swap_during_a_flip_does_not_hide_the_rest_of_it():
    room = Room().lock()
    for i in range(1, 9):
        true = pitched(-0.35 * i)
        shown = multiply(true, HALF_TURNS[2]) if i in (3, 4) else true
        assert room.show(quaternion=shown) is (PoseVerdict.FLIPPED if i in (3, 4) else PoseVerdict.OK)


def test_gaps_duplicates_and_restarts_are_counted():
    room = Room().lock()
    room.skip(3)
    assert room.show() is PoseVerdict.OK
    room.frame -= 1
    assert room.show() is PoseVerdict.COASTING
    room.frame = 2
    assert room.show() is PoseVerdict.OK
    statistics = room.health.statistics()
    assert statistics.missing_frames == 3
    assert statistics.duplicates == 1
    assert statistics.restarts == 1


@settings(max_examples=examples(60))
@given(
    st.lists(
        st.tuples(
            st.none() | st.tuples(*[st.floats(-5.0, 5.0) | st.just(math.nan) for _ in range(3)]),
            st.tuples(*[st.floats(-1.0, 1.0) for _ in range(4)]),
            st.integers(1, 60),
        ),
        max_size=40,
    )
)
def test_whatever_comes_nothing_bad_is_ok(shown):
    """Any nonsense in flight: no OK without a unit-quaternion pose, and none beyond the gate."""
    room = Room().lock()
    last_good, last_good_frame = (1.0, 2.0, 1.5), room.frame
    for position, quaternion, skipped in shown:
        room.skip(skipped - 1)
        verdict = room.show(position, quaternion, noisy=False)
        if verdict is PoseVerdict.OK:
            assert position is not None
            assert all(math.isfinite(value) for value in position)
            assert math.hypot(*quaternion) == pytest.approx(1.0, abs=1.1e-3)
            limit = min(1.0, 0.1 * (room.frame - last_good_frame)) + 1e-3
            assert math.dist(position, last_good) <= limit
            last_good, last_good_frame = position, room.frame


def real_flights(shared_data: Path) -> list[np.ndarray]:
    """Columns t, px, py, pz, qx, qy, qz, qw of the NanoBench flights: real Vicon at 100 Hz."""
    names = ["t", "px", "py", "pz", "qx", "qy", "qz", "qw"]
    flights = []
    for path in sorted((shared_data / "nanobench").glob("*.csv.gz")):
        with gzip.open(path, "rt", newline="") as lines:
            rows = [[float(row[name]) for name in names] for row in csv.DictReader(lines)]
        flights.append(np.array(rows))
    return flights


def judge_flight(flight: np.ndarray, flipped: dict[int, Quaternion]) -> list[PoseVerdict]:
    health = PoseHealth(HealthLimits(), lambda: 0.0)
    health.in_flight = True
    verdicts = []
    for i, row in enumerate(flight.tolist()):
        t, x, y, z, *q = row
        quaternion = (q[0], q[1], q[2], q[3])
        if i in flipped:
            quaternion = multiply(quaternion, flipped[i])
        frame = round((t - flight[0, 0]) / 0.01)
        sample = PoseSample("cf", frame, t, t, (x, y, z), quaternion, False, None, None)
        verdicts.append(health.observe(sample))
    return verdicts


@pytest.mark.slow
@pytest.mark.further
def test_no_false_alarm_on_real_flights(shared_data: Path):
    flights = real_flights(shared_data)
    assert sum(len(flight) for flight in flights) > 70_000
    for flight in flights:
        assert set(judge_flight(flight, {})[9:]) == {PoseVerdict.OK}


@pytest.mark.slow
def test_every_single_frame_half_turn_in_real_flights_is_refused_and_nothing_else(shared_data: Path):
    rng = np.random.default_rng(11)
    for flight in real_flights(shared_data)[::3]:
        where = rng.choice(np.arange(20, len(flight)), len(flight) // 20, replace=False)
        flipped = {int(i): HALF_TURNS[rng.integers(3)] for i in where}
        verdicts = judge_flight(flight, flipped)
        refused = {i for i, verdict in enumerate(verdicts) if i >= 9 and verdict is not PoseVerdict.OK}
        assert refused == set(flipped)
