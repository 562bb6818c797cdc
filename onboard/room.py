"""The room that the vehicle flies in: ceiling height and the volume that it must not leave."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RoomGeometry:
    """Flight room in the world frame (ENU, z up, floor at z = 0), all lengths in m.

    The landing area is the paper's test cage (section IV.E: 1.5 m wide, 2.5 m long, 2.1 m high) around the
    impact point at x = y = 0; the run-up starts outside it, because reaching the speed at the authors'
    1 m/s2 (errata 9) takes longer than the cage. The volume leaves room beside it for the mocap to see
    a drone that misses.
    """

    ceiling_z: float = 2.10
    x_min: float = -6.5
    x_max: float = 2.0
    y_min: float = -1.0
    y_max: float = 1.0

    def contains(self, x: float, y: float, z: float, margin: float = 0.0) -> bool:
        """Whether the point (m) lies inside the flight volume, `margin` (m) away from its side walls."""
        return (
            self.x_min + margin <= x <= self.x_max - margin
            and self.y_min + margin <= y <= self.y_max - margin
            and -margin <= z <= self.ceiling_z + margin
        )
