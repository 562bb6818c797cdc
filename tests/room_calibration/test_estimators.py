"""Rooms drawn at random: what is found is within its uncertainty; bad geometry is refused with what to do."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.room.ceiling_plane import ceiling_plane
from calibration.room.errors import GeometryRefused
from calibration.room.marker_body import (
    BOARD_M,
    FEET_RAD,
    MarkerBody,
    Rest,
    Standing,
    from_rests,
    joined_with_flight,
    rests_apart_deg,
)
from calibration.room.stray_touch import FALSE_ALARM, stray_touch
from calibration.room.trigger_error import trigger_error
from onboard.arrays import FloatArray
from onboard.json_file import as_json
from perchhw.mocap_calibration.touches import touches_of_one_plane

STANDING = Standing(height=0.045, height_sigma=1.5e-3)
DRAWS = 200


class DrawnRoom:
    """A subject on a drone, a plate that is nearly level, a person who puts the drone on it."""

    def __init__(self, rng: np.random.Generator, half_turn: float = 180.0, tilt: float = 0.5) -> None:
        self.rng = rng
        self.rotation = Rotation.from_rotvec(rng.normal(0.0, [0.05, 0.05, 0.05]))  # body to subject
        self.position = rng.normal(0.0, 0.02, 3)
        nose, feet = rng.normal(0.0, np.radians(5.0)), rng.normal(0.0, FEET_RAD, 2)
        self._standing = Rotation.from_rotvec([*feet, 0.0])  # the feet's plane against the body
        plate = Rotation.from_rotvec(np.radians(tilt) * rng.normal(0.0, [1.0, 1.0, 0.0]))
        self.height = STANDING.height + rng.normal(0.0, STANDING.height_sigma)
        self.plate = STANDING.plate + rng.normal(0.0, STANDING.plate_sigma)
        self._headings = [plate * Rotation.from_euler("z", a) for a in (nose, nose + np.radians(half_turn))]

    def rest(self, number: int) -> Rest:
        heading = self._headings[number]
        body = heading * self._standing.inv()
        mark = np.array([-2.5, 0.1, self.plate])
        normal = heading.as_matrix()[:, 2]
        placed = np.append(self.rng.normal(0.0, STANDING.placed_sigma, 2), 0.0)
        origin = mark + placed + self.height * normal
        subject = body * self.rotation.inv()
        seen = origin - subject.apply(self.position) + self.rng.normal(0.0, 2e-5, (200, 3))
        shaken = subject * Rotation.from_rotvec(self.rng.normal(0.0, 2e-4, (200, 3)))
        return Rest.of(seen, shaken.as_quat())

    def flown(self, found: MarkerBody) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """What a flight with this correction shows: turn and offset of the poses, with their covariances."""
        turn = (self.rotation.inv() * found.rotation).as_rotvec()
        beside = self.rotation.inv().apply(found.position - self.position)
        turn_sigma, beside_sigma = 1e-3, 5e-4
        return (
            turn + self.rng.normal(0.0, turn_sigma, 3),
            turn_sigma**2 * np.eye(3),
            beside + self.rng.normal(0.0, BOARD_M, 3) + self.rng.normal(0.0, beside_sigma, 3),
            beside_sigma**2 * np.eye(3),
        )

    def misses(self, found: MarkerBody) -> tuple[FloatArray, FloatArray]:
        """Errors of place and attitude over their standard uncertainties, three each."""
        place = (found.position - self.position) / np.sqrt(np.diag(found.position_covariance))
        turn = (self.rotation.inv() * found.rotation).as_rotvec()
        return place, turn / np.sqrt(np.diag(found.rotation_covariance))


def test_markers_are_found_within_their_uncertainty_over_drawn_rooms() -> None:
    rng = np.random.default_rng(17)
    by_rests, with_flight, refused = [], [], 0
    for _ in range(DRAWS):
        room = DrawnRoom(rng)
        rests = from_rests(room.rest(0), room.rest(1), STANDING)
        by_rests.append(np.concatenate(room.misses(rests)))
        try:
            joined = joined_with_flight(rests, *room.flown(rests))
        except GeometryRefused:
            refused += 1  # one in a few hundred is unlikely enough to be asked again
            continue
        with_flight.append(np.concatenate(room.misses(joined)))
        assert np.trace(joined.position_covariance) < np.trace(rests.position_covariance)
        assert np.sqrt(np.diag(joined.rotation_covariance)).max() < 2e-3
    for misses in (np.array(by_rests), np.array(with_flight)):
        covered = (np.abs(misses) < 1.96).mean(axis=0)
        assert (covered >= 0.9).all(), covered
        assert (covered <= 0.995).any(), covered
    assert refused <= 4


def test_headings_that_are_alike_are_refused_and_a_quarter_turn_will_do() -> None:
    rng = np.random.default_rng(3)
    alike = DrawnRoom(rng, half_turn=20.0)
    with pytest.raises(GeometryRefused, match=r"20 deg apart .* turn the drone by half a turn"):
        from_rests(alike.rest(0), alike.rest(1), STANDING)
    quarter, half = DrawnRoom(rng, half_turn=90.0), DrawnRoom(rng)
    found = [from_rests(one.rest(0), one.rest(1), STANDING) for one in (quarter, half)]
    assert found[0].position_covariance[0, 0] > 1.5 * found[1].position_covariance[0, 0]
    assert rests_apart_deg(quarter.rest(0), quarter.rest(1)) == pytest.approx(90.0, abs=0.2)


def test_a_drone_that_moved_or_stood_askew_is_refused() -> None:
    rng = np.random.default_rng(4)
    ramp = np.linspace(0.0, 0.01, 100)[:, None] * np.array([1.0, 0.0, 0.0])
    level = np.tile([0.0, 0.0, 0.0, 1.0], (100, 1))
    with pytest.raises(GeometryRefused, match=r"moved while it rested, by 2\.9 mm"):
        Rest.of(ramp, level)
    with pytest.raises(GeometryRefused, match="too few poses"):
        Rest.of(ramp[:1], level[:1])
    room = DrawnRoom(rng)
    first, second = room.rest(0), room.rest(1)
    askew = replace(second, attitude=Rotation.from_rotvec([0.3, 0.0, 0.0]) * second.attitude)
    with pytest.raises(GeometryRefused, match="stand it on a level plate both times"):
        from_rests(first, askew, STANDING)


def test_a_flight_that_contradicts_the_rests_is_refused() -> None:
    room = DrawnRoom(np.random.default_rng(5))
    rests = from_rests(room.rest(0), room.rest(1), STANDING)
    turn, turned, offset, covariance = room.flown(rests)
    with pytest.raises(GeometryRefused, match=r"body beside by .* mm about its z axis"):
        joined_with_flight(rests, turn, turned, offset + np.array([0.0, 0.0, 0.02]), covariance)


def touches(rng: np.random.Generator, truth: FloatArray, places: FloatArray, radius: float) -> FloatArray:
    lower = radius * np.sqrt(1.0 + (truth[1:] ** 2).sum())
    heights = truth[0] + places @ truth[1:] - lower + rng.normal(0.0, 5e-4, len(places))
    return np.column_stack([places, heights])


def test_ceilings_are_found_within_their_uncertainty_over_drawn_rooms() -> None:
    rng = np.random.default_rng(23)
    covered = []
    for _ in range(DRAWS):
        truth = np.array([rng.uniform(1.8, 3.0), *np.tan(np.radians(rng.normal(0.0, 1.0, 2)))])
        corners = np.array([[-1.0, -0.6], [-1.0, 0.6], [0.8, 0.6], [0.8, -0.6]]) + rng.normal(
            0.0, 0.1, (4, 2)
        )
        plane = ceiling_plane(touches(rng, truth, corners, 0.007), 0.007)
        height, sigma = plane.height(0.3, 0.1)
        tilts = plane.tilts_deg()
        wanted = np.degrees(np.arctan(truth[1:]))
        covered.append(
            [
                abs(height - truth @ [1.0, 0.3, 0.1]) < 1.96 * sigma,
                *(abs(t - w) < 1.96 * s for (t, s), w in zip(tilts, wanted, strict=True)),
            ]
        )
    shares = np.array(covered).mean(axis=0)
    assert (shares >= 0.9).all(), shares


def test_touches_in_a_line_too_few_or_off_the_plane_are_refused() -> None:
    rng = np.random.default_rng(6)
    level = np.array([2.1, 0.0, 0.0])
    line = np.array([[-1.0, 0.0], [-0.3, 0.02], [0.4, 0.0], [1.0, -0.02]])
    with pytest.raises(GeometryRefused, match="about a line and must spread by 20: touch the corners"):
        ceiling_plane(touches(rng, level, line, 0.007), 0.007)
    square = np.array([[-1.0, -0.6], [-1.0, 0.6], [0.8, 0.6], [0.8, -0.6]])
    with pytest.raises(GeometryRefused, match="3 touches of the ceiling are too few"):
        ceiling_plane(touches(rng, level, square[:3], 0.007), 0.007)
    low = touches(rng, level, square, 0.007)
    low[2, 2] -= 0.04
    with pytest.raises(GeometryRefused, match="mm off the plane of all"):
        ceiling_plane(low, 0.007)


def test_centimetres_are_milliseconds_at_the_trigger() -> None:
    error = trigger_error(2.5, 90.0, ceiling_sigma=0.01, markers_sigma=0.0, latency_sigma=0.003)
    assert error.tau == pytest.approx(0.005)
    assert as_json(error)["u95_ceiling_s"] == pytest.approx(1.96 * 0.004)
    assert trigger_error(2.5, 30.0, 0.01, 0.0, 0.0).tau == pytest.approx(0.008)


CORNERS = np.array([[-1.0, -0.6], [-1.0, 0.6], [0.8, 0.6], [0.8, -0.6]])
BESIDE = np.array([[-0.1, 0.3]])


def touched(seed: int, places: FloatArray) -> FloatArray:
    """Places of a ceiling that is not level, by a hand as steady as it is taken to be."""
    return touches(np.random.default_rng((3, seed)), np.array([2.1, 0.01, -0.02]), places, 0.007)


def test_of_plane_ceilings_one_in_a_hundred_has_a_stray_touch() -> None:
    for places in (CORNERS, np.vstack([CORNERS, BESIDE])):
        alarms = sum(stray_touch(touched(seed, places)) is not None for seed in range(2000))
        assert 0.5 * FALSE_ALARM < alarms / 2000 < 1.7 * FALSE_ALARM


def test_four_touches_say_by_how_much_one_is_off_and_not_which() -> None:
    low = touched(1, CORNERS)
    low[1, 2] -= 9e-3
    stray = stray_touch(low)
    assert stray is not None
    assert sorted(stray.numbers) == [1, 2, 3, 4]
    assert abs(stray.off) == pytest.approx(9e-3, abs=2e-3)


@pytest.mark.parametrize("number", range(1, 6))
def test_of_five_touches_the_one_that_is_off_is_named(number: int) -> None:
    held, named = 0, 0
    for seed in range(50):
        low = touched(seed, np.vstack([CORNERS, BESIDE]))
        low[number - 1, 2] -= 9e-3
        stray = stray_touch(low)
        assert stray is not None
        held += number in stray.numbers and len(stray.numbers) <= 3
        named += stray.numbers == (number,)
        assert stray.numbers != (number,) or stray.off == pytest.approx(-9e-3, abs=4e-3)
    assert held >= 47
    assert named >= 10


def test_of_several_touches_that_are_off_none_is_named() -> None:
    uneven = touched(1, np.vstack([CORNERS, BESIDE]))
    uneven[:, 2] += [8e-3, 0.0, 0.0, -8e-3, -8e-3]
    stray = stray_touch(uneven)
    assert stray is not None
    assert stray.numbers == ()


def wizard(first: FloatArray, again: FloatArray) -> tuple[FloatArray, list[int], list[str]]:
    """The touches that the wizard takes, the numbers that it asks for, and what it says: of places that are
    touched first, and of those where it is touched anew."""
    asked: list[int] = []
    said: list[str] = []
    forgotten: set[int] = set()

    def touch(number: int, others: Sequence[FloatArray], where: str) -> FloatArray:
        asked.append(number)
        return np.array((again if number in forgotten else first)[number - 1])

    return touches_of_one_plane(touch, forgotten.add, said.append, goes_on=False), asked, said


def test_the_wizard_takes_four_touches_and_has_one_that_is_off_made_again() -> None:
    five = touched(1, np.vstack([CORNERS, BESIDE]))
    taken, asked, said = wizard(five, five)
    assert (len(taken), asked, said) == (4, [1, 2, 3, 4], [])
    low = five.copy()
    low[3, 2] -= 20e-3
    taken, asked, said = wizard(low, five)
    assert asked == [1, 2, 3, 4, 5, 4]
    assert taken == pytest.approx(five)
    assert "off the plane of the others: touch a point more, half way from the middle" in said[0]
    assert re.fullmatch(r"touch 4 is [12]\d\.\d mm off the plane of the others: touch there again", said[1])
    assert len(said) == 2
    taken, asked, said = wizard(low, low)
    assert asked == [1, 2, 3, 4, 5, 4]
    assert "touch 4 is" in said[2]
    assert "is the ceiling flat there?" in said[2]


def test_where_touches_leave_it_open_which_is_off_the_wizard_has_each_of_these_made_again() -> None:
    five = touched(1, np.vstack([CORNERS, BESIDE]))
    low = five.copy()
    low[3, 2] -= 9e-3
    taken, asked, said = wizard(low, five)
    assert sorted(asked[5:]) == [2, 4]
    assert taken == pytest.approx(five)
    assert said[1].startswith("touch 2 or 4 is")


def test_a_calibration_that_was_ended_while_touches_were_made_again_asks_for_all_of_them() -> None:
    low = touched(1, np.vstack([CORNERS, BESIDE]))
    low[3, 2] -= 9e-3
    known = dict(enumerate(low, 1))
    asked: list[str] = []

    def touch(number: int, others: Sequence[FloatArray], where: str) -> FloatArray:
        if number not in known:
            asked.append(where)
            raise KeyboardInterrupt
        return np.array(known[number])

    for goes_on in (False, True):
        with pytest.raises(KeyboardInterrupt):
            touches_of_one_plane(touch, known.pop, lambda text: None, goes_on)
    assert sorted(known) == [1, 3, 5]
    assert len(set(asked)) == 1
    assert "touched before" in asked[0]
