"""What a source cannot know of its subject: where the drone's body sits in it, and how late its poses are."""

from dataclasses import dataclass, replace

from mocap_bridge.health import has_pose
from mocap_bridge.pose import PoseSample
from mocap_bridge.rotation import multiply, normalised, rotate
from onboard.arrays import Quaternion, Vector

# Only what cannot be turned is left alone: a wrong length must still be there for the health to refuse.
_NORM_TOLERANCE = 0.5


@dataclass(frozen=True, slots=True)
class PoseCorrection:
    """Turns poses of the tracked subject into poses of the drone's body; by default they are the same.

    Attributes:
        position: origin of the body in the axes of the subject, m.
        quaternion: (x, y, z, w), from the axes of the body to those of the subject.
        latency: from exposure to arrival (s), of sources that do not tell it with each pose.
    """

    position: Vector = (0.0, 0.0, 0.0)
    quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)
    latency: float = 0.0

    def apply(self, sample: PoseSample) -> PoseSample:
        """The sample of the body.

        What is no pose stays as it is, and the length of the quaternion too: the health judges them.
        """
        if self.latency > 0.0 and sample.latency is None:
            sample = replace(sample, capture_time=sample.capture_time - self.latency)
        if self._is_identity or not has_pose(sample, _NORM_TOLERANCE):
            return sample
        if sample.position is None or sample.quaternion is None:
            return sample
        arm = rotate(normalised(sample.quaternion), self.position)
        x, y, z = (origin + part for origin, part in zip(sample.position, arm, strict=True))
        quaternion = multiply(sample.quaternion, normalised(self.quaternion))
        return replace(sample, position=(x, y, z), quaternion=quaternion)

    @property
    def _is_identity(self) -> bool:
        return self.position == (0.0, 0.0, 0.0) and self.quaternion == (0.0, 0.0, 0.0, 1.0)


AS_TRACKED = PoseCorrection()
"""The subject is the body."""
