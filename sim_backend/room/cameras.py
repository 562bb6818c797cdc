"""What the cameras see: true poses to measured ones, with noise, occlusion and the faults of a mocap
system."""

import math
from typing import NamedTuple

import numpy as np

from mocap_bridge.rotation import multiply, normalised
from onboard.arrays import Quaternion, Vector
from sim_backend.room.feed import TruePose
from sim_backend.room.markers import markers_of, reflections
from sim_backend.room.settings import RoomSettings

_HALF_TURN_ABOUT_Z: Quaternion = (0.0, 0.0, 1.0, 0.0)


class SeenBody(NamedTuple):
    """A body in a frame; `pose` is None when it is occluded."""

    name: str
    pose: TruePose | None
    quality: float


class CameraFrame(NamedTuple):
    """One frame: counter, exposure time (local clock, s), all known bodies, markers of none (m, world)."""

    number: int
    exposure_time: float
    bodies: tuple[SeenBody, ...]
    unlabelled: tuple[Vector, ...] = ()


class Cameras:
    """Measures bodies. Pure but for the random generator `rng` and the memory that freezing needs."""

    def __init__(self, settings: RoomSettings, rng: np.random.Generator) -> None:
        self._settings = settings
        self.rng = rng
        self._last: tuple[SeenBody, ...] = ()
        self._unlabelled: tuple[Vector, ...] = ()

    def expose(
        self, number: int, exposure_time: float, bodies: dict[str, TruePose], world_time: float | None
    ) -> CameraFrame:
        """The frame `number` of `bodies`; faults go by `world_time` (None: no world yet, no faults)."""
        faults = self._settings.faults
        now = -math.inf if world_time is None else world_time
        if faults.freeze is not None and faults.freeze.covers(now) and self._last:
            return CameraFrame(number, exposure_time, self._last, self._unlabelled)
        hidden = faults.occlude is not None and faults.occlude.covers(now)
        flipped = faults.flip180 is not None and faults.flip180.covers(now)
        self._last = tuple(
            self._see(name, None if hidden else bodies.get(name), flipped) for name in self._settings.subjects
        )
        unfitted = [
            marker
            for body in self._last
            if body.pose is None and body.name in bodies and not hidden
            for marker in markers_of(bodies[body.name])
        ]
        self._unlabelled = (*unfitted, *reflections(faults.reflections))
        return CameraFrame(number, exposure_time, self._last, self._unlabelled)

    def _see(self, name: str, true_pose: TruePose | None, flipped: bool) -> SeenBody:
        if true_pose is None or (
            self._settings.occlusion > 0.0 and self.rng.random() < self._settings.occlusion
        ):
            return SeenBody(name, None, 0.0)
        noise = self.rng.normal(size=6)
        dx, dy, dz = (self._settings.position_noise * noise[:3]).tolist()
        ax, ay, az = (0.5 * self._settings.rotation_noise * noise[3:]).tolist()
        x, y, z = true_pose.position
        position: Vector = (x + dx, y + dy, z + dz)
        quaternion = normalised(multiply(true_pose.quaternion, normalised((ax, ay, az, 1.0))))
        if flipped:
            quaternion = multiply(quaternion, _HALF_TURN_ABOUT_Z)
        return SeenBody(name, TruePose(position, quaternion), 1.0)
