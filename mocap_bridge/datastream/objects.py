"""The objects of the DataStream protocol that matter to us: names, fields, object ids, wire layout.

Facts from Vicon's DataStream SDK 1.12.0 (MIT; whoenig/vicon-datastream-sdk@8a1f24c), checked against the
bytes of its own serializers (tests/mocap). Lengths are mm, rotations row-major body to world, times s,
angles rad. Segment ids start at 1; 0 means "no parent".
"""

from typing import NamedTuple

from mocap_bridge.datastream.fields import Many, Numbers, Record, Scalar, Text, WireField
from mocap_bridge.rotation import Matrix
from onboard.arrays import Vector

# Ticks per second of the clock in which StreamInfo counts.
STREAM_CLOCK_HZ = 135_000_000
# FrameInfo's id for "the server has no data yet".
NO_FRAME = 0xFFFFFFFF
Z_UP = 0
Y_UP = 1
# Timecode's standard of 25 frames a second.
TIMECODE_PAL, TIMECODE_PAL_HZ = 0, 25


class ObjectEnums(NamedTuple):
    """The object ids that a side supports or asks for: the whole negotiation."""

    ids: tuple[int, ...]


class RequestFrame(NamedTuple):
    """Client: 1 = push a packet per frame from now on, 0 = send one frame."""

    streaming: int


class RequestNextFrame(NamedTuple):
    """Client: send the next `frames` new frames."""

    frames: int


class PacketContents(NamedTuple):
    """What the packet holds (id, how many) and which static objects are valid though not sent again."""

    counts: tuple[tuple[int, int], ...]
    unchanged: tuple[int, ...]


class StreamInfo(NamedTuple):
    """Frame period in ticks of STREAM_CLOCK_HZ."""

    period_ticks: int


class Segment(NamedTuple):
    """One rigid segment of a subject; `parent` 0 is the root."""

    parent: int
    segment: int
    bounds: tuple[float, float, float, float, float, float]
    name: str


class SubjectInfo(NamedTuple):
    """A subject, its segments and markers."""

    subject: int
    name: str
    segments: tuple[Segment, ...]
    markers: tuple[tuple[int, str], ...]
    attachments: tuple[tuple[int, int], ...]


class FrameInfo(NamedTuple):
    """Frame counter; the SDK's frame number is this plus one."""

    frame_id: int


class SegmentPose(NamedTuple):
    """Position (mm) and rotation (row-major, body to world) of a segment."""

    segment: int
    position: Vector
    rotation: Matrix


class GlobalSegments(NamedTuple):
    """Poses of a subject's segments in the world; an occluded segment is absent."""

    subject: int
    segments: tuple[SegmentPose, ...]


class LocalSegments(NamedTuple):
    """Poses of a subject's segments relative to their parents; an occluded segment is absent."""

    subject: int
    segments: tuple[SegmentPose, ...]


class LightweightSegment(NamedTuple):
    """Local position (mm) and angle-axis vector (rad) of a segment, in single precision."""

    segment: int
    position: Vector
    angle_axis: Vector


class LightweightSegments(NamedTuple):
    """The small form of LocalSegments."""

    subject: int
    segments: tuple[LightweightSegment, ...]


class LatencyInfo(NamedTuple):
    """Delays (s), each since the stage before; their sum is the latency of the frame."""

    stages: tuple[tuple[str, float], ...]


class FrameRateInfo(NamedTuple):
    """Frame rates by name (Hz)."""

    rates: tuple[tuple[str, float], ...]


class Timecode(NamedTuple):
    """Time code of the frame; `standard` -1 is none."""

    hours: int
    minutes: int
    seconds: int
    frames: int
    subframe: int
    subframes_per_frame: int
    standard: int
    user_bits: int
    field: int


class ApplicationInfo(NamedTuple):
    """The world's up axis: Z_UP or Y_UP."""

    up_axis: int


class ObjectQuality(NamedTuple):
    """Quality of a subject's fit in this frame, 0..1."""

    subject: int
    quality: float


class SubjectHealth(NamedTuple):
    """Marker error (mm) and health 0..1 of a subject."""

    subject: int
    marker_error: float
    health: float


class SubjectTopology(NamedTuple):
    """Rest poses of a subject's segments."""

    subject: int
    segments: tuple[SegmentPose, ...]


class SubjectScale(NamedTuple):
    """Scale of each segment along its axes: (segment, (x, y, z))."""

    subject: int
    segments: tuple[tuple[int, Vector], ...]


class Reconstruction(NamedTuple):
    """A marker that belongs to no subject: radius (mm), position (mm), covariance, trajectory id."""

    radius: float
    position: Vector
    covariance: Matrix
    trajectory: int


class LabeledReconstruction(NamedTuple):
    """A marker of a subject, by its number there: radius (mm), position (mm), covariance, trajectory id."""

    subject: int
    marker: int
    radius: float
    position: Vector
    covariance: Matrix
    trajectory: int


class LabeledReconstructions(NamedTuple):
    """All markers that belong to subjects; a hidden one is absent."""

    markers: tuple[LabeledReconstruction, ...]


class UnlabeledReconstructions(NamedTuple):
    """All markers that belong to no subject."""

    markers: tuple[Reconstruction, ...]


class CameraInfo(NamedTuple):
    """A camera: frame period in ticks of STREAM_CLOCK_HZ, type, name, resolution (pixels), its number for
    users."""

    camera: int
    period_ticks: int
    type: str
    display_type: str
    name: str
    resolution_x: int
    resolution_y: int
    aspect_ratio: float
    circularity_threshold: float
    tracks_centroids: int
    is_video: int
    user_id: int
    marker_velocity: float


class HardwareFrameInfo(NamedTuple):
    """Frame counter of the camera hardware."""

    frame: int


class Ping(NamedTuple):
    """Sent by the client, echoed by the server."""

    id: int


StreamObject = (
    ObjectEnums | RequestFrame | RequestNextFrame | PacketContents | StreamInfo | SubjectInfo | FrameInfo |
    GlobalSegments | LocalSegments | LightweightSegments | LatencyInfo | FrameRateInfo | Timecode |
    ApplicationInfo | ObjectQuality | SubjectHealth | SubjectTopology | SubjectScale |
    LabeledReconstructions | UnlabeledReconstructions | CameraInfo | HardwareFrameInfo | Ping
)  # fmt: skip


def _pair(first: WireField, second: WireField) -> Record:
    return Record(lambda *values: values, first, second)


_U8, _U16, _U32, _U64 = Scalar("B"), Scalar("H"), Scalar("I"), Scalar("Q")
_I32, _I64, _F64 = Scalar("i"), Scalar("q"), Scalar("d")
_VECTOR, _MATRIX, _VECTOR_F32 = Numbers(3, "d"), Numbers(9, "d"), Numbers(3, "f")
_NAME = Text()
_SEGMENT = Record(Segment, _U32, _U32, Numbers(6, "f"), _NAME)
_POSES = Many(Record(SegmentPose, _U32, _VECTOR, _MATRIX))
_LIGHT = Many(Record(LightweightSegment, _U32, _VECTOR_F32, _VECTOR_F32))
_RECONSTRUCTIONS = Many(Record(Reconstruction, _F64, _VECTOR, _MATRIX, _U32))
_LABELED = Many(Record(LabeledReconstruction, _U32, _U32, _F64, _VECTOR, _MATRIX, _U32))

LAYOUTS: dict[int, Record] = {
    1: Record(StreamInfo, _I64),
    2: Record(SubjectInfo, _U32, _NAME, Many(_SEGMENT), Many(_pair(_U32, _NAME)), Many(_pair(_U32, _U32))),
    5: Record(FrameInfo, _U32),
    6: Record(LabeledReconstructions, _LABELED),
    7: Record(UnlabeledReconstructions, _RECONSTRUCTIONS),
    8: Record(LocalSegments, _U32, _POSES),
    9: Record(GlobalSegments, _U32, _POSES),
    14: Record(CameraInfo, _U32, _U64, _NAME, _NAME, _NAME, _U32, _U32, _F64, _F64, _U8, _U8, _U32, _F64),
    23: Record(Timecode, _U8, _U8, _U8, _U8, _U16, _U16, _I32, _U32, _U8),
    26: Record(LatencyInfo, Many(_pair(_NAME, _F64))),
    28: Record(SubjectTopology, _U32, _POSES),
    29: Record(SubjectHealth, _U32, _F64, _F64),
    36: Record(HardwareFrameInfo, _U32),
    37: Record(ApplicationInfo, _U8),
    39: Record(FrameRateInfo, Many(_pair(_NAME, _F64))),
    40: Record(ObjectQuality, _U32, _F64),
    42: Record(Ping, _U64),
    901: Record(LightweightSegments, _U32, _LIGHT),
    28001: Record(SubjectScale, _U32, Many(_pair(_U32, _VECTOR))),
    100001: Record(ObjectEnums, Many(_U32)),
    100002: Record(RequestFrame, _U8),
    100004: Record(PacketContents, Many(_pair(_U32, _U32)), Many(_U32)),
    100008: Record(RequestNextFrame, _U32),
}
OBJECT_IDS: dict[type, int] = {
    layout.make: object_id for object_id, layout in LAYOUTS.items() if isinstance(layout.make, type)
}
