"""Touches of the ceiling until they are of one plane, or nobody can do more for it."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from calibration.room.ceiling_plane import TOUCHES
from calibration.room.stray_touch import StrayTouch, stray_touch
from onboard.arrays import FloatArray

MOST_TOUCHES = TOUCHES + 1
"""With one more than are needed, where these disagree."""

_CORNERS = "corners of a large rectangle"
_BESIDE = "half way from the middle of the rectangle to that of a side"
_LIKELY = 3
"""Touches that are made anew where they may be the one, at most."""
_AGAIN = "where it was touched before, the marker against the ceiling itself"


class TouchRequest(Protocol):
    """Has the ceiling touched, and gives the place (3,), m."""

    def __call__(self, number: int, others: Sequence[FloatArray], where: str) -> FloatArray:
        """Touch `number`, from 1, away from the `others`, unless it is known; `where`, for the person."""


def touches_of_one_plane(
    touch: TouchRequest, forget: Callable[[int], None], tell: Callable[[str], None], goes_on: bool
) -> FloatArray:
    """Touches, (4, 3) or (5, 3), m: one more where four disagree, and that anew which is off the others.

    Args:
        touch: has the ceiling touched.
        forget: a touch that is known, by its number.
        tell: warns the person.
        goes_on: whether the fifth was made before, in a calibration that was ended then.
    """
    touches: list[FloatArray] = []
    for number in range(1, TOUCHES + 1):
        touches.append(touch(number, touches, _AGAIN if goes_on else _CORNERS))
    stray = stray_touch(np.array(touches))
    if stray is None and not goes_on:
        return np.array(touches)
    if stray is not None:
        tell(_in_words(stray, f"touch a point more, {_BESIDE}"))
    touches.append(touch(MOST_TOUCHES, touches, _BESIDE))
    stray = stray_touch(np.array(touches))
    if stray is not None and 0 < len(stray.numbers) <= _LIKELY:
        tell(_in_words(stray, "touch there again"))
        for again in stray.numbers:  # all at once: a calibration that goes on then has to ask for them
            forget(again)
        for again in stray.numbers:
            others = [one for number, one in enumerate(touches, 1) if number != again]
            touches[again - 1] = touch(again, others, _AGAIN)
        stray = stray_touch(np.array(touches))
    if stray is not None:
        tell(_in_words(stray, "is the ceiling flat there? Its height is as uncertain as that"))
    return np.array(touches)


def _in_words(stray: StrayTouch, then: str) -> str:
    if not stray.numbers:
        return (
            f"touches are not on one plane, by {1e3 * abs(stray.off):.1f} mm, and not for one alone: {then}"
        )
    which = " or ".join(str(number) for number in sorted(stray.numbers))
    return f"touch {which} is {1e3 * abs(stray.off):.1f} mm off the plane of the others: {then}"
