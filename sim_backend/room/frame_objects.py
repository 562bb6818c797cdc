"""A frame of the simulated room as the objects of the DataStream protocol."""

import math
from collections.abc import Collection
from fractions import Fraction
from functools import lru_cache

from mocap_bridge.datastream.objects import (
    STREAM_CLOCK_HZ,
    TIMECODE_PAL,
    TIMECODE_PAL_HZ,
    Z_UP,
    ApplicationInfo,
    CameraInfo,
    FrameInfo,
    FrameRateInfo,
    GlobalSegments,
    HardwareFrameInfo,
    LabeledReconstruction,
    LabeledReconstructions,
    LatencyInfo,
    LocalSegments,
    ObjectQuality,
    Reconstruction,
    Segment,
    SegmentPose,
    StreamInfo,
    StreamObject,
    SubjectHealth,
    SubjectInfo,
    SubjectScale,
    SubjectTopology,
    Timecode,
    UnlabeledReconstructions,
)
from mocap_bridge.rotation import matrix_from_quaternion
from onboard.arrays import Vector
from sim_backend.room.cameras import CameraFrame, SeenBody
from sim_backend.room.markers import LAYOUT, MARKER_RADIUS, markers_of

SEGMENT = 1
CAMERAS = ("north west", "north", "north east", "east", "south east", "south", "south west", "west")
"""The cameras that hang in the room, as their clients know them."""
FRAME_OBJECTS = (
    StreamInfo, ApplicationInfo, CameraInfo, SubjectInfo, SubjectTopology, SubjectScale, SubjectHealth,
    ObjectQuality, FrameInfo, HardwareFrameInfo, Timecode, LatencyInfo, FrameRateInfo, LocalSegments,
    GlobalSegments, LabeledReconstructions, UnlabeledReconstructions,
)  # fmt: skip
"""All kinds of objects that a frame has."""
_IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_COVARIANCE = (0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.01)
"""Of a marker's place, mm2: 0.1 mm an axis."""


STANDING = frozenset(
    {StreamInfo, ApplicationInfo, CameraInfo, SubjectInfo, SubjectTopology, SubjectScale, SubjectHealth}
)
"""Those of them that are the same in every frame of a room."""


def frame_objects(
    frame: CameraFrame, rate_hz: float, latency: float, kinds: Collection[type] = FRAME_OBJECTS
) -> list[StreamObject]:
    """The objects of a frame of these `kinds`; subjects are numbered from 0 in the order of the bodies."""
    number = frame.number & 0xFFFFFFFF
    room, subjects = _standing(rate_hz, tuple(body.name for body in frame.bodies))
    objects: list[StreamObject] = list(room)
    for subject, body in enumerate(frame.bodies):
        objects += (*subjects[subject], ObjectQuality(subject, body.quality))
    objects += [FrameInfo(number), HardwareFrameInfo(number)]
    if Timecode in kinds:
        objects.append(_timecode(frame.number, rate_hz))
    objects += [LatencyInfo((("Data Processed", latency),)), FrameRateInfo((("Hardware", rate_hz),))]
    if LabeledReconstructions in kinds:
        objects.append(_labelled(frame.bodies))
    if UnlabeledReconstructions in kinds:
        objects.append(_unlabelled(frame.unlabelled))
    for subject, body in enumerate(frame.bodies):
        segments = _segments(body)
        objects += [LocalSegments(subject, segments), GlobalSegments(subject, segments)]
    return [item for item in objects if type(item) in kinds]


@lru_cache(maxsize=8)
def _standing(rate_hz: float, names: tuple[str, ...]) -> tuple[list[StreamObject], list[list[StreamObject]]]:
    """What every frame says of the room, and of each subject by its name."""
    period_ticks = round(STREAM_CLOCK_HZ / rate_hz)
    room: list[StreamObject] = [StreamInfo(period_ticks), ApplicationInfo(Z_UP)]
    room += [_camera(i, name, period_ticks) for i, name in enumerate(CAMERAS)]
    return room, [_description(subject, name) for subject, name in enumerate(names)]


def _description(subject: int, name: str) -> list[StreamObject]:
    names = tuple((marker, f"{name}_{marker}") for marker in range(1, len(LAYOUT) + 1))
    carried = tuple((marker, SEGMENT) for marker, _ in names)
    return [
        SubjectInfo(subject, name, (Segment(0, SEGMENT, (0.0,) * 6, name),), names, carried),
        SubjectTopology(subject, (SegmentPose(SEGMENT, (0.0, 0.0, 0.0), _IDENTITY),)),
        SubjectScale(subject, ((SEGMENT, (1.0, 1.0, 1.0)),)),
        SubjectHealth(subject, 0.2, 1.0),
    ]


def _unlabelled(places: tuple[Vector, ...]) -> UnlabeledReconstructions:
    return UnlabeledReconstructions(
        tuple(
            Reconstruction(1000.0 * MARKER_RADIUS, _mm(place), _COVARIANCE, 100_000 + i)
            for i, place in enumerate(places)
        )
    )


def _camera(index: int, name: str, period_ticks: int) -> CameraInfo:
    return CameraInfo(
        index + 1, period_ticks, "simulated", "simulated", name, 2048, 1088, 1.0, 0.4, 1, 0, index + 1, 0.0
    )


def _timecode(number: int, rate_hz: float) -> Timecode:
    """Since frame 0, at 25 frames a second; the camera's frames between two of these are its subframes."""
    per_tick = Fraction(rate_hz) / TIMECODE_PAL_HZ  # exact: floor and ceiling must agree
    ticks = number // per_tick
    subframe, subframes = number - math.ceil(ticks * per_tick), math.ceil(per_tick)
    seconds, frames = divmod(ticks, TIMECODE_PAL_HZ)
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return Timecode(hours % 24, minutes, seconds, frames, subframe, subframes, TIMECODE_PAL, 0, 0)


def _labelled(bodies: tuple[SeenBody, ...]) -> LabeledReconstructions:
    """The markers of the bodies that were seen, where their fit has them."""
    return LabeledReconstructions(
        tuple(
            LabeledReconstruction(
                subject,
                marker,
                1000.0 * MARKER_RADIUS,
                _mm(place),
                _COVARIANCE,
                len(LAYOUT) * subject + marker,
            )
            for subject, body in enumerate(bodies)
            if body.pose is not None
            for marker, place in enumerate(markers_of(body.pose), 1)
            for trajectory in [len(LAYOUT) * subject + marker]
        )
    )


def _segments(body: SeenBody) -> tuple[SegmentPose, ...]:
    if body.pose is None:
        return ()
    return (SegmentPose(SEGMENT, _mm(body.pose.position), matrix_from_quaternion(body.pose.quaternion)),)


def _mm(place: Vector) -> Vector:
    x, y, z = place
    return (1000.0 * x, 1000.0 * y, 1000.0 * z)
