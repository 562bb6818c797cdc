"""The pose stream contract: what every mocap source delivers, and how one is opened by its URI."""

from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from mocap_bridge.errors import MocapUriError
from mocap_bridge.uri import SCHEMES, MocapUri, parse_mocap_uri, scheme_of
from mocap_bridge.whose_bug import blamed_on_the_source
from onboard.arrays import Quaternion, Vector
from onboard.by_name import imported
from onboard.timebase import WALL, Timebase


@dataclass(frozen=True, slots=True)
class PoseSample:
    """One frame of one subject. Without a usable pose `position` and `quaternion` are None together.

    Attributes:
        subject: name of the body in the mocap system.
        frame: the source's frame number.
        capture_time: when the cameras exposed, by the local monotonic clock (s); the best estimate the source
            allows, at worst the receipt time.
        receipt_time: local monotonic time right after the socket read (s).
        position: world position (x, y, z) in m, z up, or None.
        quaternion: (x, y, z, w), body to world, unit, sign continuous with the last sample; or None.
        occluded: True when the source has no pose of the subject in this frame (absent, zeros, NaN,
            or not a rotation).
        quality: the source's quality of the fit, 0..1, or None when it reports none.
        latency: reported delay from exposure to sending (s), or None when it reports none that is credible.
        source_time: frame number times frame period (s), or None when the source does not tell its period.
    """

    subject: str
    frame: int
    capture_time: float
    receipt_time: float
    position: Vector | None
    quaternion: Quaternion | None
    occluded: bool
    quality: float | None = None
    latency: float | None = None
    source_time: float | None = None


@dataclass(frozen=True, slots=True)
class SourceStatistics:
    """What a source knows about its own connection.

    Attributes:
        frames: frames received.
        subjects: names that the source offers, as far as known.
        period: frame period that the source reports (s), or None.
        round_trip: newest measured round trip of a ping (s), or None.
        ignored_latencies: frames whose reported latency was outside 0..100 ms and was not used.
        refused: datagrams that were not of the protocol and were left out.
    """

    frames: int
    subjects: tuple[str, ...] = ()
    period: float | None = None
    round_trip: float | None = None
    ignored_latencies: int = 0
    refused: int = 0


class PoseStream(Protocol):
    """An open source of poses of one subject. Not safe for use from several threads."""

    def read(self, timeout_s: float) -> PoseSample:
        """The next frame, in order; a frame without the subject is a sample with ``occluded``.

        Raises:
            PoseTimeout: no frame within `timeout_s`; the stream stays open.
            SourceLost: the source is gone; close and open again.
            SourceUnusable: the source is alive but not as it must be set up.
        """

    def statistics(self) -> SourceStatistics:
        """What is known about the connection so far."""

    def close(self) -> None:
        """Close the socket; further calls do nothing."""

    def __enter__(self) -> Self:
        """The stream itself."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""


@blamed_on_the_source()
def open_pose_stream(uri: str | MocapUri, clock: Timebase = WALL) -> PoseStream:
    """Open the source that `uri` names, and check that it delivers the subject as far as can be told.

    Raises:
        MocapUriError: the URI cannot be used.
        SourceLost, PoseTimeout: nothing answers as it should within 0.5 s.
        UnknownSubject: the source is alive and does not have the subject; the message lists those it has.
        SourceBroken: its code cannot be imported, or fails.
    """
    parsed = uri if isinstance(uri, MocapUri) else parse_mocap_uri(uri)
    scheme = scheme_of(parsed.scheme)
    if scheme is None:
        raise MocapUriError(f"no source for scheme {parsed.scheme!r}; known: {', '.join(SCHEMES)}")
    opener: Callable[[MocapUri, Timebase], PoseStream] = imported(scheme.opener)
    return opener(parsed, clock)
