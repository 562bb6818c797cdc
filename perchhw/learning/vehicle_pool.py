"""A pool of vehicles whose quantities are drawn by their sigma, for domain randomisation.

Any quantity of the vehicle file may be drawn. The draw happens in the vehicle description, not in the
physics parameters: what the physics derives from a quantity (the direction of a leg, say) follows exactly,
and a drawn vehicle passes the same checks as a vehicle file. A draw that fails them is made anew.
"""

import copy
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from onboard.room import RoomGeometry
from onboard.vehicle import Air, Battery, Body, Legs, Motors, Sensing, VehicleFileError
from onboard.vehicle.effects import EFFECTS
from onboard.vehicle.file_format import parse_vehicle
from onboard.vehicle.schema import Range, quantity_rules
from perchhw.learning.domain_randomisation import LEAST
from perchhw.learning.errors import LearningInputError
from sim_backend.physics.parameters import PARAMETERS, physics_parameters

POOL = 256
"""Vehicles in a pool: a mean over them is within sigma/16 of the nominal value, as of 256 attempts."""

LEAST_POSSIBLE = 0.05
"""Share of the draws that must be possible vehicles: with less, the pool is far from what was asked for."""

_SECTIONS: dict[str, Any] = {
    "body": Body,
    "motors": Motors,
    "battery": Battery,
    "legs": Legs,
    "air": Air,
    "sensing": Sensing,
}


class Draw(NamedTuple):
    """One quantity to draw: dotted name as in the vehicle file, standard deviation in its SI unit."""

    name: str
    sigma: float


def parse_draws(options: Sequence[str], content: dict[str, Any]) -> tuple[Draw, ...]:
    """The draws that ``NAME`` (with the sigma of the vehicle file) and ``NAME=SIGMA`` ask for.

    Args:
        options: as on the command line.
        content: of the vehicle file, in SI.

    Raises:
        LearningInputError: no such quantity, it is named twice, or there is no sigma above zero.
    """
    known = quantities(content)
    draws: dict[str, Draw] = {}
    for option in options:
        name, given, text = option.partition("=")
        if name not in known:
            raise LearningInputError(
                f"--randomise {option}: the vehicle has no quantity {name!r}; it has {', '.join(known)}"
            )
        if name in draws:
            raise LearningInputError(f"--randomise {name} is given twice: name every quantity once")
        try:
            sigma = float(text) if given else float(known[name]["sigma"])
        except ValueError as error:
            raise LearningInputError(f"--randomise {option}: {text!r} is not a number") from error
        if not (math.isfinite(sigma) and sigma > 0.0):
            raise LearningInputError(
                f"--randomise {option}: the standard deviation is {sigma:g}; write {name}=SIGMA with "
                f"SIGMA > 0 in {known[name]['unit']}"
            )
        draws[name] = Draw(name, sigma)
    return tuple(draws[name] for name in known if name in draws)


def all_draws(content: dict[str, Any]) -> tuple[Draw, ...]:
    """Every quantity of a vehicle with a sigma above zero."""
    return tuple(Draw(name, table["sigma"]) for name, table in quantities(content).items() if table["sigma"])


def quantities(content: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The quantity tables of a vehicle file by dotted name, in the order of the file; changes go through.

    Curves without a name stay as they are: nobody knows how their values vary together.
    """
    return dict(_quantities({key: table for key, table in content.items() if key != "unnamed"}, ""))


def _quantities(table: dict[str, Any], prefix: str) -> Iterator[tuple[str, dict[str, Any]]]:
    for key, value in table.items():
        if isinstance(value, list):
            for item in value:
                yield from _quantities(item, f"{prefix}{key}.{item['name']}.")
        elif isinstance(value, dict) and "value" in value:
            yield prefix + key, value
        elif isinstance(value, dict):
            yield from _quantities(value, f"{prefix}{key}.")


def acting(draws: Sequence[Draw], content: dict[str, Any], room: RoomGeometry) -> tuple[Draw, ...]:
    """Those of the draws that change the parameters of the physics."""
    nominal = _record(content, room).tobytes()
    return tuple(draw for draw in draws if _acts(draw, content, room, nominal))


def _acts(draw: Draw, content: dict[str, Any], room: RoomGeometry, nominal: bytes) -> bool:
    changed = copy.deepcopy(content)
    table = quantities(changed)[draw.name]
    value = float(table["value"])
    for table["value"] in (value + 1e-3 * draw.sigma, value - 1e-3 * draw.sigma):
        try:
            return bool(_record(changed, room).tobytes() != nominal)
        except VehicleFileError:  # the nominal value lies on a bound: look on its other side
            continue
    return True


def vehicle_pool(
    rng: np.random.Generator, draws: Sequence[Draw], content: dict[str, Any], room: RoomGeometry
) -> Any:
    """(POOL,) parameter records of vehicles with the quantities drawn independently, normally distributed.

    A quantity that cannot be negative is never below half its nominal value; one whose nominal value is zero
    comes from the positive half. A vehicle whose numbers contradict each other is drawn anew.

    Raises:
        LearningInputError: hardly any draw is a possible vehicle.
    """
    if not draws:
        return np.empty(0, PARAMETERS)
    nominal = {name: float(table["value"]) for name, table in quantities(content).items()}
    lowest = {draw.name: _lowest(draw.name, nominal[draw.name]) for draw in draws}
    pool = np.empty(POOL, PARAMETERS)
    drawn = copy.deepcopy(content)
    tables = quantities(drawn)
    tried = found = 0
    while found < POOL:
        if tried >= POOL and found < LEAST_POSSIBLE * tried:
            raise LearningInputError(
                f"of {tried} vehicles drawn with {', '.join(f'{d.name}={d.sigma:g}' for d in draws)} only "
                f"{found} are possible: give smaller standard deviations"
            )
        tried += 1
        for draw in draws:
            value = _normal_above(rng, nominal[draw.name], draw.sigma, lowest[draw.name])
            tables[draw.name]["value"] = value
        try:
            pool[found] = _record(drawn, room)
        except VehicleFileError:
            continue
        found += 1
    return pool


def _normal_above(rng: np.random.Generator, mean: float, sigma: float, lowest: float) -> float:
    """A sample of a normal distribution that is not below `lowest`, which must not be above the mean."""
    while True:
        value = float(rng.normal(mean, sigma))
        if value >= lowest:
            return value


def _lowest(name: str, nominal: float) -> float:
    return LEAST * nominal if _cannot_be_negative(name) else -math.inf


def _cannot_be_negative(name: str) -> bool:
    section, *between, key = name.split(".")
    if section == "effects":
        return EFFECTS[between[0]].parameters[key].low >= 0.0
    rules = quantity_rules(_SECTIONS[section]) if not between else {}
    return key in rules and rules[key].allowed is not Range.ANY


def _record(content: dict[str, Any], room: RoomGeometry) -> Any:
    return physics_parameters(parse_vehicle(content, "drawn vehicle"), room)
