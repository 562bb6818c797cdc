"""What the numbers of a lab file may be, but for its limits: those belong to the supervisor."""

from typing import Any, get_type_hints

from onboard.bounds import Bounds
from onboard.quantity import Quantity
from onboard.room import RoomGeometry

_BELIEVED = "positions farther than 50 m from the origin are not believed in flight"

WALL = Bounds("m", -50.0, 50.0, _BELIEVED, sigma=0.1)
PLACE = Bounds("m", -50.0, 50.0, _BELIEVED, sigma=0.1)
HEADING = Bounds("deg", -360.0, 360.0, "a heading is at most one turn")
FLOOR = Bounds(
    "m",
    -0.1,
    0.1,
    "hovers and landings reckon from z = 0: put the origin of the motion capture on the floor",
    sigma=0.02,
)
CEILING_HEIGHT = Bounds(
    "m",
    1.0,
    4.0,
    "the first hover is at 0.5 m, and an approach needs room above it",
    "a landing on the floor takes 3.5 s from anywhere, and from 4 m that is 2.5 m/s; for test flights in a "
    "higher hall give the height to stay below",
    sigma=0.02,
)
"""m. Its sigma, doubled, is what `hang_distance` of the supervisor's limits allows ceiling and markers."""
CEILING_TILT = Bounds(
    "deg",
    -4.0,
    4.0,
    "drone, simulation and learning know level ceilings only; 0.6 m off the plan, where its corridor ends, "
    "4 deg are 0.04 m of height, and a body that leans by 10 deg in all is taken for half attached",
    sigma=1.0,
)
"""deg, along each axis and, as both together, of the plane."""
LATENCY = Bounds(
    "s",
    0.0,
    0.035,
    "so much of the drone's stopping distance is reckoned for motion capture",
    sigma=0.035,
)
OFFSET = Bounds(
    "m", -0.15, 0.15, "the drone is 0.1 m large, so its body is not farther from its markers", sigma=0.01
)

NARROWEST = 0.5
"""m. Least distance of two walls: starts keep 0.25 m from each."""


def bounds_of(section: type[Any]) -> dict[str, Bounds]:
    """The quantities of a section of the lab file with their bounds, in file order."""
    return {
        name: note
        for name, hint in get_type_hints(section, include_extras=True).items()
        for note in getattr(hint, "__metadata__", ())
        if isinstance(note, Bounds)
    }


def room_problem(room: RoomGeometry) -> str | None:
    """What is wrong with a room that was not read from a lab file, or not all of it; else ``None``."""
    rules = dict.fromkeys(("x_min", "x_max", "y_min", "y_max"), WALL)
    for name, bounds in (rules | {"floor_z": FLOOR, "ceiling_z": CEILING_HEIGHT}).items():
        value = getattr(room, name)
        problem = bounds.problem(value, Quantity(value, bounds.unit, 0.0, name))
        if problem is not None:
            return f"{name} {problem}"
    return None
