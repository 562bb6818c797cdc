"""Vehicles that may explain how landings end: legs, pads and propellers on a grid, and what each predicts.

A vehicle of the grid has these effects at values of its own in place of those of the vehicle file, so that a
file that has them already is judged as it is, and the values are what its effects should be.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import norm

from calibration.gap.landings.outcomes.predict import forecast_with
from calibration.gap.landings.outcomes.prepare import Prepared
from onboard.arrays import FloatArray
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle
from sim_backend.physics.effects.registry import TERMS
from sim_backend.physics.parameters import physics_parameters


class Point(NamedTuple):
    """A vehicle of the grid: parameters of its effects; the defaults are a vehicle without them."""

    stiffness: float = 1.0
    damping: float = 1.0
    speed: float = 0.0
    spread: float = 0.0
    reach: float = 1.0


UNITS = {"stiffness": "1", "damping": "1", "speed": "m/s", "spread": "m/s", "reach": "1"}

EFFECT_OF = {
    "stiffness": ("leg_stiffness", "scale"),
    "damping": ("leg_damping", "scale"),
    "speed": ("pad_capture", "speed"),
    "spread": ("pad_capture", "spread"),
    "reach": ("propeller_reach", "scale"),
}
"""Effect and parameter of the vehicle file that each coordinate stands for."""

WITHOUT = Point()
"""None of the effects."""

HINGES = ((1.0, 1.0), (1.0, 8.0), (1.6, 8.0), (1.6, 16.0))
"""Stiffness and damping: as the legs are filed, and around what the motion after the contact shows (docs)."""

LIMITS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.2, 1.5, 2.0)
"""m/s: least speed of a foot that sticks, at which landings are simulated."""

SPEEDS = tuple(round(0.1 * count, 1) for count in range(1, 16))
"""m/s: means of the limit."""

SPREADS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""m/s: standard deviations of the limit from landing to landing."""

REACHES = (1.0, 0.64, 0.3)
"""Share of the propeller's radius that meets the ceiling: a disc, two blades at any angle, nearly none."""


def filed_point(vehicle: Vehicle) -> Point:
    """What a vehicle file says of these effects."""
    values = {effect.name: effect.values() for effect in vehicle.effects}
    found = {
        name: values[effect][parameter] for name, (effect, parameter) in EFFECT_OF.items() if effect in values
    }
    return WITHOUT._replace(**found)


def bare_parameters(vehicle: Vehicle) -> Any:
    """Physics parameters of a vehicle without these effects: what :func:`with_point` begins with."""
    searched = {effect for effect, _ in EFFECT_OF.values()}
    others = tuple(effect for effect in vehicle.effects if effect.name not in searched)
    return physics_parameters(replace(vehicle, effects=others), RoomGeometry())


def grid(filed: Point = WITHOUT) -> tuple[Point, ...]:
    """All vehicles, those of the file's own values among them."""
    pads = dict.fromkeys([(0.0, 0.0), *product(SPEEDS, SPREADS), (filed.speed, filed.spread)])
    hinges = dict.fromkeys([*HINGES, (filed.stiffness, filed.damping)])
    reaches = dict.fromkeys([*REACHES, filed.reach])
    return tuple(
        Point(stiffness, damping, speed, spread, reach)
        for (stiffness, damping), reach, (speed, spread) in product(hinges, reaches, pads)
    )


def with_point(parameters: Any, point: Point) -> Any:
    """A copy of a record of parameters without these effects that has those of a point."""
    changed = parameters.copy()
    values: dict[str, dict[str, float]] = {}
    for name, value in point._asdict().items():
        effect, parameter = EFFECT_OF[name]
        values.setdefault(effect, {})[parameter] = value
    for effect, given in values.items():
        TERMS[effect].apply(changed, given)
    return changed


def tabulate(
    prepared: Prepared,
    parameters: Any,
    points: Sequence[Point],
    progress: Callable[[float], None] | None = None,
    workers: int = 2,
) -> FloatArray:
    """Probabilities (points, flights, 3) of four legs, two, none.

    Landings are simulated with pads of one limit each (:data:`LIMITS`); a spread of limits mixes them.

    Args:
        prepared: the flights. parameters: of the vehicle without these effects (:func:`bare_parameters`).
        points: vehicles.
        progress: called with the share done, 0..1.
        workers: threads; the result does not depend on them.
    """
    bodies = list(dict.fromkeys(point._replace(speed=0.0, spread=0.0) for point in points))
    needed = [(body, limit) for body in bodies for limit in LIMITS]

    def simulated(one: tuple[Point, float]) -> FloatArray:
        body, limit = one
        return forecast_with(prepared, with_point(parameters, body._replace(speed=limit))).probability

    ladders: dict[Point, list[FloatArray]] = {body: [] for body in bodies}
    with ThreadPoolExecutor(workers) as pool:
        for index, (one, found) in enumerate(zip(needed, pool.map(simulated, needed), strict=True)):
            ladders[one[0]].append(found)
            if progress is not None:
                progress((index + 1) / len(needed))
    return np.array(
        [
            np.tensordot(
                mixture(point.speed, point.spread),
                np.array(ladders[point._replace(speed=0.0, spread=0.0)]),
                1,
            )
            for point in points
        ]
    )


def mixture(speed: float, spread: float) -> FloatArray:
    """Shares of :data:`LIMITS` in a normal distribution of limits (m/s); each stands for its surroundings."""
    limits = np.array(LIMITS)
    if spread <= 0.0:
        return np.array([np.interp(speed, limits, row) for row in np.eye(limits.size)])
    edges = np.concatenate([[-np.inf], 0.5 * (limits[1:] + limits[:-1]), [np.inf]])
    return np.asarray(np.diff(norm.cdf(edges, speed, spread)))
