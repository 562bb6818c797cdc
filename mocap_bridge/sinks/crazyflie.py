"""Poses to a Crazyflie, as its external pose."""

from typing import Protocol

from onboard.arrays import Quaternion, Vector


class PoseLink(Protocol):
    """The part of a drone link that the sink needs."""

    def send_pose(self, position: Vector, quaternion: Quaternion) -> None:
        """Send one external pose: world position (m), quaternion (x, y, z, w)."""


class CrazyfliePoseSink:
    """Sends each pose over the drone's link. The firmware's message has neither time nor uncertainty."""

    def __init__(self, link: PoseLink) -> None:
        self._link = link

    def send_pose(self, position: Vector, quaternion: Quaternion) -> None:
        """Send one pose; errors are those of the link."""
        self._link.send_pose(position, quaternion)
