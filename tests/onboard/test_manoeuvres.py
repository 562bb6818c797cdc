"""Courses of test flights: what they ask, and why some cannot be flown."""

import numpy as np
import pytest

from onboard.manoeuvres import MANOEUVRES, CourseBuilder, CourseError, manoeuvre
from onboard.room import RoomGeometry

ROOM = RoomGeometry()


@pytest.mark.parametrize("kind", MANOEUVRES)
def test_a_course_is_one_motion_that_returns_to_its_start(kind: str) -> None:
    course = manoeuvre(kind).course({}, ROOM)
    for end in (0, -1):
        assert np.allclose(course.velocity[end], 0.0)
        assert np.allclose(course.acceleration[end], 0.0)
        assert np.allclose(course.position[end], course.start, atol=1e-3)
        assert abs(course.yaw[end]) < 1e-6
    step = np.diff(course.position, axis=0)
    between = 0.5 * (course.velocity[1:] + course.velocity[:-1]) / 100.0
    assert np.abs(np.cumsum(step - between, axis=0)).max() < 0.01
    assert np.abs(np.linalg.norm(course.acceleration, axis=1)).max() < 9.0


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        ("circles", {"radius": 2.0}, "spans y"),
        ("vertical_steps", {"rise": 2.0}, "spans z"),
        ("circles", {"speed": 50.0}, "must be 0.2 to 5"),
        ("circles", {"diameter": 1.0}, "diameter is unknown"),
        ("loops", {}, "not a kind of test flight"),
    ],
)
def test_a_course_that_cannot_be_flown_says_why(kind: str, values: dict[str, float], message: str) -> None:
    with pytest.raises(CourseError, match=message):
        manoeuvre(kind).course(values, ROOM)


def test_pushes_that_do_not_end_at_rest_are_refused() -> None:
    with pytest.raises(CourseError, match="at rest"):
        CourseBuilder((0.0, 0.0, 1.0)).push(((1.0, 0.0, 0.0), 0.5))
