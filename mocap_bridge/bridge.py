"""The bridge: poses from a room, judged, to a drone.

Two threads, so that a slow radio never delays the judging: one reads, judges and puts good samples into a
mailbox that holds one; the other sends what is in the mailbox. A newer pose replaces one that has not been
sent yet.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from mocap_bridge.correction import AS_TRACKED, PoseCorrection
from mocap_bridge.errors import ListenerBroken, MocapError, PoseTimeout, SourceBroken
from mocap_bridge.health import HealthLimits, HealthStatistics, PoseHealth, PoseVerdict
from mocap_bridge.pose import PoseSample, PoseStream, SourceStatistics, open_pose_stream
from mocap_bridge.rotation import continuous, normalised
from mocap_bridge.uri import MocapUri, parse_mocap_uri
from mocap_bridge.whose_bug import blamed_on_the_listener, blamed_on_the_source
from onboard.arrays import Quaternion, Vector
from onboard.errors import PerchhwError
from onboard.timebase import WALL, Timebase

# A source without frames for this long is opened anew: a pulled cable leaves the connection open and silent.
SILENCE_LIMIT_S = 0.5
STOP_TIMEOUT_S = 0.5
BACK_OFF_S = (0.05, 1.0)
_READ_SLICE_S = 0.1
_RATE_WINDOW_S = 1.0
_RESIDENCES_KEPT = 1000


class PoseSink(Protocol):
    """Takes poses: world position (m), quaternion (x, y, z, w) of unit length and continuous sign."""

    def send_pose(self, position: Vector, quaternion: Quaternion) -> None:
        """Send one pose. May block; errors of the project's tree are reported in the bridge's status."""


@dataclass(frozen=True, slots=True)
class BridgeStatus:
    """How the bridge does.

    Attributes:
        verdict: state of the source now.
        connected: whether a source is open.
        error: why the source is not open, or None.
        age: time since the capture of the newest good sample (s), or None before the first.
        rate_hz: frames received in the last second.
        last_sample: newest sample, good or not.
        last_good: newest good sample.
        reconnects: times the source was lost after it had been open.
        sent: poses that the sink took.
        superseded: good poses replaced by newer ones before they were sent.
        sink_errors: times the sink failed; `sink_error` says how the last time.
        residence_p50, residence_p99: from socket read to the sink's return (s), of the last 1000; None
        before.
        health: counts of the judging.
        source: what the open source knows of its connection, or None.
    """

    verdict: PoseVerdict
    connected: bool
    error: str | None
    age: float | None
    rate_hz: float
    last_sample: PoseSample | None
    last_good: PoseSample | None
    reconnects: int
    sent: int
    superseded: int
    sink_errors: int
    sink_error: str | None
    residence_p50: float | None
    residence_p99: float | None
    health: HealthStatistics
    source: SourceStatistics | None


class PoseBridge:
    """Carries the poses of one subject from `uri` to `sink`; opens a lost source again by itself.

    Args:
        uri: mocap URI; MocapUriError when it cannot be used.
        sink: where good poses go; None only watches.
        limits: limits of the judging.
        clock: the time that poses are judged by and waited for.
        on_sample: called from the reading thread with every sample and its verdict; must return at once.
            One that fails ends the bridge: nothing is known of the drone any more, and the status says why.
        correction: applied to every sample before anything else sees it.
    """

    def __init__(
        self,
        uri: str | MocapUri,
        sink: PoseSink | None,
        limits: HealthLimits | None = None,
        clock: Timebase = WALL,
        on_sample: Callable[[PoseSample, PoseVerdict], None] | None = None,
        correction: PoseCorrection = AS_TRACKED,
    ) -> None:
        self._uri = uri if isinstance(uri, MocapUri) else parse_mocap_uri(uri)
        self._sink = sink
        self._limits = limits or HealthLimits()
        self._clock = clock
        self._on_sample = on_sample
        self._correction = correction
        self._health = PoseHealth(self._limits, clock)
        self._lock = threading.RLock()
        self._looked_at, self._mailed, self._stopping = clock.event(), clock.event(), clock.event()
        self._threads: list[threading.Thread] = []
        self._mail: PoseSample | None = None
        self._last_sample: PoseSample | None = None
        self._last_good: PoseSample | None = None
        self._receipts: deque[float] = deque()
        self._residences: deque[float] = deque(maxlen=_RESIDENCES_KEPT)
        self._source: SourceStatistics | None = None
        self._error: str | None = "not started"
        self._sink_error: str | None = None
        self._reconnects = 0
        self._sent = 0
        self._superseded = 0
        self._sink_errors = 0

    def start(self) -> None:
        """Start the threads; returns at once. Whether poses come is said by :meth:`status`."""
        if self._threads:
            raise MocapError("the pose bridge was already started; make a new one to start again")
        self._error = "connecting"
        self._threads = [self._clock.thread(self._read_forever, "pose-reader")]
        if self._sink is not None:
            self._threads.append(self._clock.thread(self._send_forever, "pose-sender", self._sink))

    def stop(self) -> bool:
        """Stop within 0.5 s; False when the sink holds its thread longer than that (it ends by itself)."""
        self._stopping.set()
        self._mailed.set()
        deadline = time.monotonic() + STOP_TIMEOUT_S
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        return not any(thread.is_alive() for thread in self._threads)

    def set_in_flight(self, in_flight: bool) -> None:
        """In flight a persistent new pose is LOST; on the ground it is accepted."""
        with self._lock:
            self._health.in_flight = in_flight

    def status(self) -> BridgeStatus:
        """A consistent picture of now."""
        with self._lock:
            now = self._clock()
            while self._receipts and self._receipts[0] < now - _RATE_WINDOW_S:
                self._receipts.popleft()
            ordered = sorted(self._residences)
            return BridgeStatus(
                verdict=self._health.verdict(now),
                connected=self._source is not None,
                error=self._error,
                age=now - self._last_good.capture_time if self._last_good is not None else None,
                rate_hz=self._rate(now),
                last_sample=self._last_sample,
                last_good=self._last_good,
                reconnects=self._reconnects,
                sent=self._sent,
                superseded=self._superseded,
                sink_errors=self._sink_errors,
                sink_error=self._sink_error,
                residence_p50=ordered[len(ordered) // 2] if ordered else None,
                residence_p99=ordered[int(0.99 * (len(ordered) - 1))] if ordered else None,
                health=self._health.statistics(),
                source=self._source,
            )

    def _rate(self, now: float) -> float:
        """Frames a second over the last second, or over the time since the first frame when that is less."""
        if len(self._receipts) < 2 or now <= self._receipts[0]:
            return 0.0
        return (len(self._receipts) - 1) / (now - self._receipts[0])

    def wait_for(self, condition: Callable[[BridgeStatus], bool], timeout_s: float) -> bool:
        """Wait until `condition` holds of the status, looked at after every sample; False at the timeout."""
        deadline = self._clock() + timeout_s
        while not condition(self.status()):
            remaining = deadline - self._clock()
            if remaining <= 0.0:
                return False
            self._looked_at.wait(remaining)
            self._looked_at.clear()
        return True

    def _read_forever(self) -> None:
        pause, longest = BACK_OFF_S
        ended = "stopped"
        try:
            while not self._stopping.is_set():
                frames = 0
                try:
                    with blamed_on_the_source(), open_pose_stream(self._uri, self._clock) as stream:
                        frames = self._pump(stream)
                except (SourceBroken, ListenerBroken) as error:
                    ended = str(error)
                    break
                except MocapError as error:
                    self._set_source(None, str(error))
                pause = BACK_OFF_S[0] if frames else min(longest, 2.0 * pause)
                self._stopping.wait(pause)
        finally:
            self._set_source(None, ended)

    def _pump(self, stream: PoseStream) -> int:
        """Read and judge until stopped or the source is gone; gives the number of frames."""
        frames = 0
        last_time = self._clock()
        self._set_source(stream.statistics(), None)
        try:
            while not self._stopping.is_set():
                try:
                    sample = self._correction.apply(stream.read(_READ_SLICE_S))
                except PoseTimeout:
                    if self._clock() - last_time > SILENCE_LIMIT_S:
                        raise
                    self._set_source(stream.statistics(), None)
                    continue
                frames += 1
                last_time = sample.receipt_time
                self._judge(sample, stream)
        except ListenerBroken:
            raise
        except MocapError as error:
            with self._lock:
                self._reconnects += 1
            self._set_source(None, str(error))
        return frames

    def _judge(self, sample: PoseSample, stream: PoseStream) -> None:
        source = stream.statistics()  # of others' code, perhaps: not under a lock that the flight needs
        with self._lock:
            verdict = self._health.observe(sample)
            self._last_sample = sample
            self._source = source
            self._receipts.append(sample.receipt_time)
            while self._receipts[0] < sample.receipt_time - _RATE_WINDOW_S:
                self._receipts.popleft()
            if verdict is PoseVerdict.OK:
                self._last_good = sample
                self._superseded += self._mail is not None
                self._mail = sample if self._sink is not None else None
                self._mailed.set()
        self._looked_at.set()
        if self._on_sample is not None:
            with blamed_on_the_listener():
                self._on_sample(sample, verdict)

    def _set_source(self, source: SourceStatistics | None, error: str | None) -> None:
        with self._lock:
            self._source = source
            self._error = error
        self._looked_at.set()

    def _send_forever(self, sink: PoseSink) -> None:
        last: Quaternion | None = None
        while (sample := self._next_mail()) is not None:
            if sample.position is None or sample.quaternion is None:
                continue
            if self._clock() - sample.receipt_time > self._limits.stale_age:
                continue
            last = continuous(normalised(sample.quaternion), last)
            try:
                sink.send_pose(sample.position, last)
            except Exception as error:  # noqa: BLE001 -- one pose that cannot be sent; the next one may be
                with self._lock:
                    self._sink_errors += 1
                    self._sink_error = str(error) if isinstance(error, PerchhwError) else repr(error)
                continue
            with self._lock:
                self._sent += 1
                self._residences.append(self._clock() - sample.receipt_time)

    def _next_mail(self) -> PoseSample | None:
        """The newest good sample as soon as there is one; None when stopping."""
        while not self._stopping.is_set():
            with self._lock:
                mail, self._mail = self._mail, None
                if mail is not None:
                    return mail
                self._mailed.clear()
            if not self._stopping.is_set():
                self._mailed.wait()
        return None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
