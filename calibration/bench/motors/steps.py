"""Finding the steps of the command in a trace of speeds, without being told where they are."""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from calibration.bench.motors.records import IntArray, SpeedTrace
from onboard.arrays import FloatArray

GRID = 0.01
"""s: grid on which steps are sought in traces that resolve it."""
_BEFORE = 0.15
"""s before a step over which the speed must be settled."""
_AHEAD = 0.06
"""s after it over which it must have left."""
_LEAST_SHARE = 0.04
"""Of the highest speed: a smaller step is not sought."""
_LEAST_QUANTA = 3.5
"""Standard deviations of the instrument ... likewise."""
_TREND = 2.0
"""A speed that already changes this way must change this many times faster."""
SHOWN_BEFORE = 0.12
"""s of a step's data before its onset, or four stretches of a coarse trace: as long, a slope is straight."""
SHOWN_AFTER = 1.5
"""s of its data after it, if the next step does not come sooner. What a coasting rotor does later is decided
by dry friction, which the law does not have: longer data make a larger and b smaller."""
_FEWEST_FOR_SLOPE = 3
_COARSE = 0.03
"""s: windows this long cannot tell a slope from their quantum."""
_CREEP = 0.03
"""Of the highest speed: a coasting rotor below it obeys its bearings, not the law."""


class Direction(Enum):
    """Whether the rotor is driven up or coasts down."""

    UP = "up"
    DOWN = "down"


@dataclass(frozen=True, slots=True)
class SpeedStep:
    """One step of the speed.

    Attributes:
        trace: the recording's trace.
        first, last: samples of the trace that belong to it, `last` not included.
        onset: s, when the speed began to change, within some 50 ms.
        before, after: rad/s, speed before, and at the end of its data.
        standing: whether the rotor stood before it: then the speed before is zero, not fitted.
        slope: rad/s2, change of the speed before it (a rotor that still coasts).
    """

    trace: SpeedTrace
    first: int
    last: int
    onset: float
    before: float
    after: float
    standing: bool
    slope: float

    @property
    def direction(self) -> Direction:
        """Up or down."""
        return Direction.UP if self.after > self.before else Direction.DOWN


def speeds_on_grid(trace: SpeedTrace, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Mean speeds (rad/s) over cells of `spacing` (s), and the cells' ends; 0 where no mark passed."""
    at = np.concatenate([[trace.start[0]], trace.end])
    angle = np.concatenate([[0.0], np.cumsum(trace.speed * (trace.end - trace.start))])
    edges, turned = _with_gaps(trace, at, angle)
    cells = np.arange(edges[0], edges[-1], spacing)
    return np.diff(np.interp(cells, edges, turned)) / spacing, cells[1:]


def _with_gaps(trace: SpeedTrace, at: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times and angles with the begin of each stretch that does not follow the one before at once."""
    gaps = np.flatnonzero(trace.start[1:] > trace.end[:-1] + 1e-9)
    edges = np.insert(at, gaps + 2, trace.start[gaps + 1])
    return edges, np.insert(angle, gaps + 2, angle[gaps + 1])


def find_steps(trace: SpeedTrace) -> list[SpeedStep]:
    """The steps of a trace, in time order.

    A step begins where the speed was settled for 0.15 s and leaves that value, or turns round. Slower changes
    (a coasting rotor's tail, drift) are none.
    """
    if trace.speed.size < 4:
        return []
    spacing = max(GRID, trace.resolution)
    speeds, ends = speeds_on_grid(trace, spacing)
    noise = float(np.median(trace.sigma))
    least = max(_LEAST_SHARE * float(np.max(speeds)), _LEAST_QUANTA * noise)
    onsets = _onsets(speeds, ends, spacing, least)
    # A motor that stood has no sample before: what it turned up to is seen at once.
    if trace.speed.size and speeds[0] > least and not _settled_start(speeds, spacing, least):
        onsets.insert(0, float(trace.start[0]))
    return _cut(trace, onsets)


def _settled_start(speeds: FloatArray, spacing: float, least: float) -> bool:
    count = max(3, round(_BEFORE / spacing))
    head = speeds[: 2 * count]
    return bool(np.ptp(head) < 2.0 * least)


def _onsets(speeds: FloatArray, ends: FloatArray, spacing: float, least: float) -> list[float]:
    behind = max(3, round(_BEFORE / spacing))
    ahead = max(2, round(_AHEAD / spacing))
    if speeds.size < behind + ahead:
        return []
    past = sliding_window_view(speeds, behind)[:-ahead]
    departure = sliding_window_view(speeds, ahead)[behind:] - np.median(past, axis=1)[:, None]
    last = departure[:, -1]
    trend = np.maximum((past[:, -1] - past[:, 0]) * np.sign(last), 0.0)
    leaves = np.all(departure > 0.3 * least, axis=1) | np.all(departure < -0.3 * least, axis=1)
    leaves &= np.abs(last) > least + _TREND * trend
    settled = np.ptp(past, axis=1) < least
    onsets: list[float] = []
    free = True
    for index in np.flatnonzero(settled):
        if leaves[index] and free:
            onsets.append(float(ends[index + behind] - spacing))
        free = not leaves[index]
    return onsets


def _cut(trace: SpeedTrace, onsets: list[float]) -> list[SpeedStep]:
    middle = 0.5 * (trace.start + trace.end)
    slow = _CREEP * float(np.max(trace.speed))
    steps: list[SpeedStep] = []
    for index, onset in enumerate(onsets):
        following = onsets[index + 1] if index + 1 < len(onsets) else np.inf
        previous = onsets[index - 1] if index else -np.inf
        begin = max(onset - max(SHOWN_BEFORE, 4.0 * trace.resolution), previous)
        stop = min(following - trace.resolution, onset + SHOWN_AFTER)
        inside = np.flatnonzero((trace.start >= begin) & (trace.end <= stop))
        earlier = inside[trace.end[inside] <= onset]
        standing = earlier.size == 0 or float(np.median(trace.speed[earlier])) < slow
        if standing:
            inside = inside[trace.start[inside] >= onset - trace.resolution]
        if inside.size < 4:
            continue
        before = 0.0 if standing else float(np.median(trace.speed[earlier]))
        late = inside[middle[inside] > 0.5 * (onset + middle[inside[-1]])]
        after = float(np.median(trace.speed[late[-max(3, late.size // 2) :]]))
        slope = 0.0 if standing else _slope(trace, earlier)
        first, last = int(inside[0]), int(inside[-1]) + 1
        steps.append(SpeedStep(trace, first, last, onset, before, after, standing, slope))
    return steps


def _slope(trace: SpeedTrace, samples: IntArray) -> float:
    """Slope (rad/s2) of the speed over `samples`; 0 where noise hides it, or a window is too coarse."""
    t = 0.5 * (trace.start + trace.end)[samples]
    if samples.size < _FEWEST_FOR_SLOPE or trace.resolution > _COARSE:
        return 0.0
    t = t - t.mean()
    spread = float(t @ t)
    slope = float(t @ trace.speed[samples]) / spread
    return slope if abs(slope) > 3.0 * float(np.mean(trace.sigma[samples])) / spread**0.5 else 0.0
