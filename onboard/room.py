"""The room that the vehicle flies in: floor, ceiling and the walls that it must not reach."""

import math
from dataclasses import dataclass

from onboard.checked_arguments import checked_number
from onboard.errors import InputError, OnboardError

HIGHEST_CEILING = 50.0
"""m. No hall is higher: such a number is a height in other units."""


class CeilingError(OnboardError, InputError):
    """A height that no ceiling has, or not that of the flights below it; the message says which."""


@dataclass(frozen=True)
class RoomGeometry:
    """Flight room in the world frame (ENU, z up), lengths in m, angles in rad.

    The defaults are the simulated room; a real one is described by its lab file (docs/lab_file.md). Its
    landing area is the paper's test cage (section IV.E: 1.5 m wide, 2.5 m long, 2.1 m high) around the
    impact point at x = y = 0; the run-up starts outside it, because reaching the speed at the authors'
    1 m/s2 (errata 9) takes longer than the cage. The volume leaves room beside it for the mocap to see
    a drone that misses.

    Attributes:
        ceiling_z: height of the ceiling above x = y = 0; everywhere, where the ceiling is taken as level.
        x_min, x_max, y_min, y_max: the walls.
        floor_z: height of the floor.
        ceiling_tilt_x, ceiling_tilt_y: angles at which the ceiling rises along +x and along +y.
    """

    ceiling_z: float = 2.10
    x_min: float = -6.5
    x_max: float = 2.0
    y_min: float = -1.0
    y_max: float = 1.0
    floor_z: float = 0.0
    ceiling_tilt_x: float = 0.0
    ceiling_tilt_y: float = 0.0

    def ceiling_at(self, x: float, y: float) -> float:
        """Height of the ceiling above (x, y), m."""
        return self.ceiling_z + x * math.tan(self.ceiling_tilt_x) + y * math.tan(self.ceiling_tilt_y)

    def contains(self, x: float, y: float, z: float, margin: float = 0.0) -> bool:
        """Whether the point (m) lies inside the flight volume, `margin` (m) away from its side walls."""
        return (
            self.x_min + margin <= x <= self.x_max - margin
            and self.y_min + margin <= y <= self.y_max - margin
            and self.floor_z <= z <= self.ceiling_at(x, y)
        )

    @property
    def lowest_ceiling(self) -> float:
        """Height of the ceiling where it is lowest between the walls, m."""
        return min(self.ceiling_at(x, y) for x in (self.x_min, self.x_max) for y in (self.y_min, self.y_max))


def ceiling_height(given: object) -> float:
    """The height (m) of a ceiling above the floor, as somebody gave it.

    Raises:
        ArgumentError: it is no number.
        CeilingError: it is no height of a ceiling.
    """
    height = checked_number(given, "ceiling_z")
    if not 0.0 < height <= HIGHEST_CEILING:  # nor is nan
        raise CeilingError(
            f"a ceiling at {height:g} m cannot be: give its height above the floor in m, above 0 and at most "
            f"{HIGHEST_CEILING:g}"
        )
    return height
