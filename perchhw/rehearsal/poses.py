"""Poses of an approach that nobody flies, as motion capture would send them."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Self

from onboard.arrays import Vector
from onboard.closing import Closing
from onboard.link.errors import LinkLost
from onboard.timebase import Timebase
from onboard.trajectory import ApproachPlan, smooth_approach

if TYPE_CHECKING:
    from onboard.link import DroneLink

PERIOD_S = 0.01
LEVEL = (0.0, 0.0, 0.0, 1.0)
"""What the drone's own gyro and accelerometer say of a drone on a desk: the attitude does not take part."""

NEAREST = 0.02
"""m. No pose comes nearer to the ceiling."""


def ideal_state(plan: ApproachPlan, smoothing: float, elapsed: float) -> tuple[Vector, Vector]:
    """Position (m) and velocity (m/s) of a drone that follows its approach exactly, `elapsed` s into it.

    `smoothing` is :attr:`onboard.landing.model.LandingLimits.smoothing` (s).
    """
    position, velocity, _, _ = smooth_approach(plan, elapsed - smoothing, smoothing)
    return position, velocity


class ApproachPoses(Closing):
    """Sends poses at 100 Hz on a thread of its own: the approach's start, and from :meth:`go` on its course.

    Args:
        link: the open link.
        plan: the approach.
        smoothing: see :func:`ideal_state`.
        time: clock and pauses.
        on_pose: told of every position that was sent (m).
    """

    def __init__(
        self,
        link: "DroneLink",
        plan: ApproachPlan,
        smoothing: float,
        time: Timebase,
        on_pose: Callable[[Vector], None] | None = None,
    ) -> None:
        self._on_pose = on_pose
        self._link = link
        self._plan = plan
        self._smoothing = smoothing
        self._time = time
        self._began: float | None = None
        self._ended = time.event()

    def go(self) -> None:
        """The approach begins now."""
        self._began = self._time()

    def __enter__(self) -> Self:
        self._time.thread(self._run, "RehearsalPoses")
        return self

    def close(self) -> None:
        """No pose any more; idempotent."""
        self._ended.set()

    def _run(self) -> None:
        due = self._time()
        while not self._ended.wait(max(0.0, due - self._time())):
            try:
                position = self._position()
                self._link.send_pose(position, LEVEL)
            except LinkLost:
                return  # who waits for the drone's answers hears why
            if self._on_pose is not None:
                self._on_pose(position)
            due += PERIOD_S

    def _position(self) -> Vector:
        elapsed = 0.0 if self._began is None else self._time() - self._began
        (x, y, z), _ = ideal_state(self._plan, self._smoothing, elapsed)
        return x, y, min(z, self._plan.ceiling_z - NEAREST)
