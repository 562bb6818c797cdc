"""What is known of a vehicle and has no name: a force or torque over one quantity of the flight's state.

The gap finder writes such curves as ``[[unnamed]]`` tables. They say what flights showed where they were
flown, and nothing of why: a curve keeps its last value beyond its outermost knots.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from onboard.quantity import Quantity, UnitError, convert
from onboard.toml_file import toml_text
from onboard.vehicle.schema import Problems, as_table, as_text, check_keys, finite

MOST_CURVES = 8
"""In one vehicle file."""

MOST_KNOTS = 12
"""Of one curve."""

REGRESSORS = {
    "x": "m",
    "y": "m",
    "z": "m",
    "ceiling_distance": "m",
    "velocity_x": "m/s",
    "velocity_y": "m/s",
    "velocity_z": "m/s",
    "airspeed": "m/s",
    "vertical_speed": "m/s",
    "rate_x": "rad/s",
    "rate_y": "rad/s",
    "rate_z": "rad/s",
}
"""Quantities of the state that a curve may go with, and their units: place in the room, distance of the
body's origin from the ceiling, velocity along the body axes, speed (through still air), climb, body rates."""

CHANNELS = {
    **{f"force_{axis}": "N" for axis in "xyz"},
    **{f"world_force_{axis}": "N" for axis in "xyz"},
    **{f"torque_{axis}": "N m" for axis in "xyz"},
}
"""Where a curve may act, and its unit: at the centre of mass along the axes of body or world, or about the
body's."""

_KEYS = ("channel", "regressor", "knots", "curve")
_KNOTS = ("values", "unit")
_CURVE = (*_KNOTS, "sigma", "source")


@dataclass(frozen=True, kw_only=True)
class UnnamedCurve:
    """A force or torque without a name, straight between knots and constant beyond them.

    Attributes:
        channel: of :data:`CHANNELS`.
        regressor: of :data:`REGRESSORS`.
        knots: of the regressor, increasing, in its SI unit.
        values: at the knots, N or N m.
        sigma: standard uncertainty of the curve where it is largest, N or N m.
        source: how it was found.
    """

    channel: str
    regressor: str
    knots: tuple[float, ...]
    values: tuple[float, ...]
    sigma: float
    source: str

    def at_knots(self) -> dict[str, Quantity]:
        """The value at each knot, by where it is in words: ``force_x at velocity_x = -2 m/s``."""
        unit = REGRESSORS[self.regressor]
        return {
            f"{self.channel} at {self.regressor} = {knot:.4g} {unit}": Quantity(
                value, CHANNELS[self.channel], self.sigma, self.source
            )
            for knot, value in zip(self.knots, self.values, strict=True)
        }


def unnamed_to_toml(curves: Iterable[UnnamedCurve]) -> list[str]:
    """The lines of the ``[[unnamed]]`` tables of a vehicle file."""
    lines: list[str] = []
    for one in curves:
        unit = CHANNELS[one.channel]
        lines += [
            "",
            "[[unnamed]]",
            f"channel = {toml_text(one.channel)}",
            f"regressor = {toml_text(one.regressor)}",
            f"knots = {{ values = {list(one.knots)!r}, unit = {toml_text(REGRESSORS[one.regressor])} }}",
            f"curve = {{ values = {list(one.values)!r}, unit = {toml_text(unit)}, "
            f"sigma = {one.sigma!r}, source = {toml_text(one.source)} }}",
        ]
    return lines


def parse_unnamed(raw: object, problems: Problems) -> tuple[UnnamedCurve, ...]:
    """The curves of a file in SI units; problems are noted by ``unnamed[i].key``."""
    if not isinstance(raw, list):
        problems.add("unnamed", "must be an array of tables; write each curve under [[unnamed]]")
        return ()
    if len(raw) > MOST_CURVES:
        problems.add("unnamed", f"holds {len(raw)} curves; at most {MOST_CURVES} can be flown")
    parsed = (_parse_curve(item, f"unnamed[{index}]", problems) for index, item in enumerate(raw))
    return tuple(one for one in parsed if one is not None)


def check_unnamed(curves: Sequence[UnnamedCurve], force: float, torque: float, problems: Problems) -> None:
    """Note curves that no vehicle of this size could fly against.

    Args:
        curves: all of them.
        force, torque: N, N m, the most that the rotors can give.
        problems: where they are noted.
    """
    for index, one in enumerate(curves):
        unit = CHANNELS[one.channel]
        most = force if unit == "N" else torque
        largest = max(abs(value) for value in one.values)
        if largest > most:
            problems.add(
                f"unnamed[{index}].curve",
                f"reaches {largest:.4g} {unit}; the rotors of this vehicle can give {most:.4g} {unit}",
            )


def _parse_curve(raw: object, key: str, problems: Problems) -> UnnamedCurve | None:
    table = as_table(raw, key, problems)
    if table is None:
        return None
    before = len(problems.messages)
    check_keys(table, key, _KEYS, problems)
    channel = _one_of(table, "channel", CHANNELS, key, problems)
    regressor = _one_of(table, "regressor", REGRESSORS, key, problems)
    if channel is None or regressor is None:
        return None
    knots = _numbers(table.get("knots"), f"{key}.knots", REGRESSORS[regressor], _KNOTS, problems)
    curve = _numbers(table.get("curve"), f"{key}.curve", CHANNELS[channel], _CURVE, problems)
    if knots is None or curve is None:
        return None
    if not 2 <= len(knots.values) <= MOST_KNOTS:
        problems.add(f"{key}.knots", f"has {len(knots.values)} values; give 2 to {MOST_KNOTS}")
    if any(later <= knot for knot, later in itertools.pairwise(knots.values)):
        problems.add(f"{key}.knots", f"must increase from each to the next, not {list(knots.values)}")
    if len(curve.values) != len(knots.values):
        problems.add(f"{key}.curve", f"has {len(curve.values)} values for {len(knots.values)} knots")
    source = as_text(curve.table.get("source"), f"{key}.curve.source", problems)
    sigma = finite(curve.table.get("sigma"), f"{key}.curve.sigma", problems)
    if sigma is not None and sigma < 0.0:
        problems.add(f"{key}.curve.sigma", f"is {sigma}; a standard uncertainty is zero or more")
    if source is None or sigma is None or len(problems.messages) > before:
        return None
    return UnnamedCurve(
        channel=channel,
        regressor=regressor,
        knots=knots.values,
        values=curve.values,
        sigma=curve.factor * sigma,
        source=source,
    )


def _one_of(
    table: Mapping[str, object], name: str, known: Mapping[str, str], key: str, problems: Problems
) -> str | None:
    value = table.get(name)
    if isinstance(value, str) and value in known:
        return value
    problems.add(f"{key}.{name}", f"is {value!r}; it must be one of {', '.join(known)}")
    return None


class _Numbers(NamedTuple):
    """Numbers of a table in SI units, the factor that made them so, and the table."""

    values: tuple[float, ...]
    factor: float
    table: Mapping[str, object]


def _numbers(raw: object, key: str, unit: str, keys: Sequence[str], problems: Problems) -> _Numbers | None:
    """What ``{ values = [...], unit = "..." }`` holds; None with the problems noted."""
    given = raw.get("values") if isinstance(raw, Mapping) else None
    if not isinstance(raw, Mapping) or not isinstance(given, list):
        form = ", ".join(("values = [...]", f'unit = "{unit}"', *keys[2:]))
        problems.add(key, f"must be a table {{ {form} }}, not {raw!r}")
        return None
    before = len(problems.messages)
    check_keys(raw, key, keys, problems)
    numbers = [finite(item, f"{key}.values[{index}]", problems) for index, item in enumerate(given)]
    try:
        factor = convert(1.0, str(raw.get("unit")), unit)
    except UnitError as error:
        problems.add(f"{key}.unit", str(error))
        return None
    if len(problems.messages) > before:
        return None
    return _Numbers(tuple(factor * number for number in numbers if number is not None), factor, raw)
