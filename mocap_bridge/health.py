"""Is a pose fit to be believed? Verdicts, not repairs; what is not known is never good.

The drone cannot defend itself: an external pose reaches its estimator without time, covariance or gate, and
an attitude error of 180 deg is infinite to it (the update works with 2 tan(angle / 2)). So every sample is
judged here.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from mocap_bridge.pose import PoseSample
from mocap_bridge.rotation import angle_between
from onboard.arrays import Vector
from onboard.clock import Clock


class PoseVerdict(Enum):
    """What is said of a sample, or of the source now. Only OK may be forwarded."""

    UNKNOWN = "unknown"  # not yet ten good samples in a row
    OK = "ok"
    COASTING = "coasting"  # no new good sample for longer than a frame or two
    OCCLUDED = "occluded"  # the source has no pose in this frame
    FROZEN = "frozen"  # the same position to the last bit while frames go on
    JUMPED = "jumped"  # farther than the body can have moved
    FLIPPED = "flipped"  # turned further than the body can have turned
    LATE = "late"  # captured too long ago
    STALE = "stale"  # no good sample for 100 ms; stays until re-locked
    LOST = "lost"  # no good sample for 500 ms, or another pose persists in flight; stays until re-locked


@dataclass(frozen=True, slots=True)
class HealthLimits:
    """Limits of :class:`PoseHealth`.

    The reference is 100 real Vicon flights of Crazyflies, 62.8 min at 100 Hz (NanoBench, arXiv 2603.09908):
    step per frame at most 32.4 mm, rotation per frame at most 9.9 deg, bit-identical consecutive positions 3
    in 376,728. Recorded inverted landings (the authors' flights) turn at up to 35 rad/s, 20 deg a frame.

    Attributes:
        frame_period: nominal time between frames (s); the shortest time the gates assume between samples.
        frozen_repeats: identical positions in a row that are a freeze (30 ms at 100 Hz).
        coasting_age: time without a good sample until COASTING (s).
        stale_age: until STALE (s): forwarding ends for good until re-locked.
        lost_age: until LOST (s): land or stop; the firmware levels at 500 ms without setpoints.
        relock_samples: good samples in a row that end UNKNOWN, STALE and LOST.
        speed: fastest motion believed (m/s); 3 times the worst real step, 0.1 m a frame of 10 ms.
        position_gate_limit: widest position gate after a time without poses (m).
        rotation_rate: fastest rotation believed (rad/s): 30 deg a frame of 10 ms.
        rotation_gate_limit: widest rotation gate (rad); below 180 deg, so that a marker swap is never taken.
        late_warning: age at receipt that is counted (s).
        late_age: age at receipt beyond which a sample is refused (s).
        norm_tolerance: how far a quaternion may be from unit length.
    """

    frame_period: float = 0.01
    frozen_repeats: int = 3
    coasting_age: float = 0.03
    stale_age: float = 0.1
    lost_age: float = 0.5
    relock_samples: int = 10
    speed: float = 10.0
    position_gate_limit: float = 1.0
    rotation_rate: float = math.radians(3000.0)
    rotation_gate_limit: float = math.radians(120.0)
    late_warning: float = 0.035
    late_age: float = 0.1
    norm_tolerance: float = 1e-3


@dataclass(frozen=True, slots=True)
class HealthStatistics:
    """Counts since the start.

    Attributes:
        samples: samples observed.
        good: samples judged OK and past the lock: those that may be forwarded.
        rejects: refused samples by verdict.
        missing_frames: frame numbers that never came.
        duplicates: samples with the frame number of the one before.
        restarts: times the frame number ran backwards.
        relocks: times a persistent new pose was accepted on the ground.
        late_warnings: samples older than the warning age at receipt.
    """

    samples: int
    good: int
    rejects: Mapping[PoseVerdict, int]
    missing_frames: int
    duplicates: int
    restarts: int
    relocks: int
    late_warnings: int


@dataclass(slots=True)
class _Track:
    """A hypothesis of where the body is: the last sample that fits it, its velocity, how many in a row."""

    sample: PoseSample
    velocity: Vector = (0.0, 0.0, 0.0)
    count: int = 1


class PoseHealth:
    """Judges the samples of one subject in order.

    Two hypotheses are kept: the body where the good samples say it is, and, while samples are refused by a
    gate, the other place where those say it is. A sample belongs to the nearer. When the other place
    persists, it is accepted on the ground (somebody moved the drone); in flight the source is LOST, because
    a jump would crash the drone.
    """

    def __init__(self, limits: HealthLimits, clock: Clock) -> None:
        self.in_flight = False
        self._limits = limits
        self._clock = clock
        self._state = PoseVerdict.UNKNOWN
        self._good_run = 0
        self._track: _Track | None = None
        self._rival: _Track | None = None
        self._last_good_time: float | None = None
        self._last_reject: PoseVerdict | None = None
        self._last_frame: int | None = None
        self._last_position: Vector | None = None
        self._repeats = 0
        self._counts: Counter[str] = Counter()
        self._rejects: Counter[PoseVerdict] = Counter()

    def observe(self, sample: PoseSample) -> PoseVerdict:
        """Judge `sample`; OK is the only answer with which it may be forwarded.

        A good sample before the lock gets the state that still holds: UNKNOWN, STALE or LOST.
        """
        self._age(sample.receipt_time)
        self._counts["samples"] += 1
        if sample.receipt_time - sample.capture_time > self._limits.late_warning:
            self._counts["late_warnings"] += 1
        reason = self._count_frame(sample) or self._without_motion(sample) or self._gate(sample)
        if reason is not None:
            self._good_run = 0
            self._last_reject = reason
            self._rejects[reason] += 1
            return reason
        self._good_run += 1
        self._last_good_time = sample.receipt_time
        if self._state is not PoseVerdict.OK:
            if self._good_run < self._limits.relock_samples:
                self._rejects[self._state] += 1
                return self._state
            self._state = PoseVerdict.OK
        self._last_reject = None
        self._counts["good"] += 1
        return PoseVerdict.OK

    def verdict(self, now: float | None = None) -> PoseVerdict:
        """The state of the source at `now` (s; by default by the clock)."""
        now = self._clock() if now is None else now
        self._age(now)
        if self._state is not PoseVerdict.OK or self._last_good_time is None:
            return self._state
        if now - self._last_good_time <= self._limits.coasting_age:
            return PoseVerdict.OK
        return self._last_reject or PoseVerdict.COASTING

    def statistics(self) -> HealthStatistics:
        """Counts since the start."""
        counts = self._counts
        return HealthStatistics(
            samples=counts["samples"],
            good=counts["good"],
            rejects=dict(self._rejects),
            missing_frames=counts["missing_frames"],
            duplicates=counts["duplicates"],
            restarts=counts["restarts"],
            relocks=counts["relocks"],
            late_warnings=counts["late_warnings"],
        )

    def _age(self, now: float) -> None:
        """Latch STALE and LOST when the last good sample is too old."""
        if self._last_good_time is None:
            return
        age = now - self._last_good_time
        if age > self._limits.stale_age:
            self._good_run = 0
            if self._state is PoseVerdict.OK:
                self._state = PoseVerdict.STALE
        if age > self._limits.lost_age and self._state is not PoseVerdict.UNKNOWN:
            self._state = PoseVerdict.LOST

    def _count_frame(self, sample: PoseSample) -> PoseVerdict | None:
        """Keep account of the frame number; a frame seen before brings nothing new."""
        last, self._last_frame = self._last_frame, sample.frame
        if last is None:
            return None
        if sample.frame == last:
            self._counts["duplicates"] += 1
            return PoseVerdict.COASTING
        if sample.frame < last:
            self._counts["restarts"] += 1
        else:
            self._counts["missing_frames"] += sample.frame - last - 1
        return None

    def _without_motion(self, sample: PoseSample) -> PoseVerdict | None:
        """What can be said of a sample without knowing how the body moves."""
        if not has_pose(sample, self._limits.norm_tolerance):
            return PoseVerdict.OCCLUDED
        self._repeats = self._repeats + 1 if sample.position == self._last_position else 1
        self._last_position = sample.position
        if self._repeats >= self._limits.frozen_repeats:
            return PoseVerdict.FROZEN
        if sample.receipt_time - sample.capture_time > self._limits.late_age:
            return PoseVerdict.LATE
        return None

    def _gate(self, sample: PoseSample) -> PoseVerdict | None:
        """Assign the sample to the track or to its rival; the verdict when it is not the track."""
        if self._track is None:
            self._track = _Track(sample)
            return None
        jump, turn = self._distance(self._track, sample)
        distance = max(jump, turn)
        to_rival = max(self._distance(self._rival, sample)) if self._rival is not None else math.inf
        if distance <= 1.0 and distance <= to_rival:
            self._track = self._extended(self._track, sample)
            self._rival = None
            return None
        self._rival = (
            self._extended(self._rival, sample) if self._rival and to_rival <= 1.0 else _Track(sample)
        )
        if self._rival.count >= self._limits.relock_samples:
            if self.in_flight:
                self._state = PoseVerdict.LOST
                return PoseVerdict.LOST
            self._accept_rival(self._rival)
            return None
        return PoseVerdict.FLIPPED if turn > jump else PoseVerdict.JUMPED

    def _accept_rival(self, rival: _Track) -> None:
        self._counts["relocks"] += 1
        self._track, self._rival = rival, None
        self._good_run = rival.count

    def _distance(self, track: _Track, sample: PoseSample) -> tuple[float, float]:
        """Position and rotation from `track` to `sample`, as shares of their gates; over 1 is outside.

        The gates widen with the time since the track's last sample: for as long the body could move unseen.
        """
        limits, last = self._limits, track.sample
        if (
            last.position is None
            or last.quaternion is None
            or sample.position is None
            or sample.quaternion is None
        ):
            return math.inf, math.inf
        elapsed = self._elapsed(last, sample)
        expected = [p + v * elapsed for p, v in zip(last.position, track.velocity, strict=True)]
        step = max(math.dist(sample.position, expected), math.dist(sample.position, last.position))
        angle = angle_between(last.quaternion, sample.quaternion)
        return (
            step / min(limits.speed * elapsed, limits.position_gate_limit),
            angle / min(limits.rotation_rate * elapsed, limits.rotation_gate_limit),
        )

    def _elapsed(self, last: PoseSample, sample: PoseSample) -> float:
        """Time between two samples (s), by the longer of clock and frame count: receipt times bunch."""
        frames = max(1, sample.frame - last.frame)
        by_clock = sample.capture_time - last.capture_time
        # A counter that leaps (a restarted source) says nothing about time.
        by_frames = frames * self._limits.frame_period
        if by_frames > by_clock + self._limits.late_age:
            by_frames = self._limits.frame_period
        return max(by_clock, by_frames)

    def _extended(self, track: _Track, sample: PoseSample) -> _Track:
        if track.sample.position is None or sample.position is None:
            return _Track(sample)
        elapsed = self._elapsed(track.sample, sample)
        vx, vy, vz = ((b - a) / elapsed for a, b in zip(track.sample.position, sample.position, strict=True))
        return _Track(sample, (vx, vy, vz), track.count + 1)


def has_pose(sample: PoseSample, norm_tolerance: float) -> bool:
    """Whether `sample` carries a pose: finite, not all zero, its quaternion of unit length."""
    if sample.occluded or sample.position is None or sample.quaternion is None:
        return False
    if not any(sample.position):
        return False
    if not all(math.isfinite(value) for value in (*sample.position, *sample.quaternion)):
        return False
    return abs(math.hypot(*sample.quaternion) - 1.0) <= norm_tolerance
