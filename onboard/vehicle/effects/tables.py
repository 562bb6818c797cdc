"""Reading the files of effects, one table an effect: what is wrong is said by file, table and key."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, get_type_hints

from onboard.errors import InputError, OnboardError
from onboard.toml_file import read_toml
from onboard.vehicle.effects.description import Domain, EffectDescription, EffectParameter, Needs
from onboard.vehicle.effects.size import Size
from onboard.vehicle.schema import Problems, as_table, check_keys


class EffectFileError(OnboardError, InputError):
    """A file of effects that cannot be used. The message names file and table."""


def read_effects(files: Iterable[Path]) -> dict[str, EffectDescription]:
    """The effects of all files, by name.

    Raises:
        EffectFileError: one line a problem of the first file that has any; or an effect is in two files.
    """
    effects: dict[str, EffectDescription] = {}
    origin: dict[str, str] = {}
    for file in files:
        for name, description in described(read_toml(file, EffectFileError), file.name).items():
            if name in effects:
                raise EffectFileError(f"{file.name}: [{name}] is in {origin[name]} already; keep one")
            effects[name], origin[name] = description, file.name
    return effects


def described(tables: Mapping[str, object], file: str) -> dict[str, EffectDescription]:
    """The effects of one file, by name; errors as for :func:`read_effects`."""
    problems = Problems(file, EffectFileError)
    effects = {}
    for name, raw in tables.items():
        told = len(problems.messages)
        if (table := as_table(raw, name, problems)) is None:
            continue
        values = _values(EffectDescription, table, f"[{name}]", problems)
        parameters = _parameters(name, table.get("parameters"), problems)
        if len(problems.messages) == told:
            effects[name] = EffectDescription(name=name, parameters=parameters, **values)
    problems.raise_any()
    return effects


def _parameters(effect: str, raw: object, problems: Problems) -> dict[str, EffectParameter]:
    """Names that share a table stand in one key, with blanks between."""
    if not isinstance(raw, Mapping) or not raw:
        problems.add(f"[{effect}]", f"needs its parameters, each in a table [{effect}.parameters.NAME]")
        return {}
    parameters: dict[str, EffectParameter] = {}
    for alike, rule in raw.items():
        told = len(problems.messages)
        where = f"[{effect}] {alike}"
        if (table := as_table(rule, where, problems)) is None:
            continue
        values = _values(EffectParameter, table, where, problems)
        for name in alike.split() if len(problems.messages) == told else ():
            if name in parameters:
                problems.add(where, f"{name} has a table already; keep one of the two")
            parameters[name] = EffectParameter(**values)
    return parameters


def _text(raw: Any) -> str:
    if not isinstance(raw, str) or not raw.strip():
        raise ValueError
    return raw


def _number(raw: Any) -> float:
    """Infinite, too: a parameter may do nothing only there."""
    if isinstance(raw, bool) or not isinstance(raw, int | float) or math.isnan(raw):
        raise ValueError
    return float(raw)


def _truth(raw: Any) -> bool:
    if not isinstance(raw, bool):
        raise ValueError
    return raw


def _list_of(kind: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, ...]]:
    def read(raw: Any) -> tuple[Any, ...]:
        if not isinstance(raw, list):
            raise ValueError
        return tuple(kind(item) for item in raw)

    return read


def _powers(raw: Any) -> dict[str, float]:
    if not isinstance(raw, Mapping) or not set(raw) <= set(Size._fields):
        raise ValueError
    return {name: _number(power) for name, power in raw.items()}


_READERS: Mapping[Any, tuple[str, Callable[[Any], Any]]] = {
    str: ("a text that is not empty", _text),
    float: ("a number", _number),
    float | None: ("a number", _number),
    bool: ("true or false", _truth),
    tuple[str, ...]: ("a list of texts", _list_of(_text)),
    Domain: (f"one of {', '.join(Domain)}", Domain),
    tuple[Needs, ...]: (f"a list out of {', '.join(Needs)}", _list_of(Needs)),
    Mapping[str, float]: (f"a table of powers of {', '.join(Size._fields)}", _powers),
}
"""What must stand in a file for a type of attribute, and how it becomes one: ValueError where it cannot."""

_APART = ("name", "parameters")
"""Attributes that are tables, or the name of one."""


def _values(
    of: type[EffectDescription | EffectParameter], table: Mapping[str, Any], where: str, problems: Problems
) -> dict[str, Any]:
    """The attributes of `of` that a table gives; those that it must and does not give are noted."""
    hints = get_type_hints(of)
    check_keys(table, where, [field.name for field in fields(of) if field.name != "name"], problems)
    values = {}
    for field in fields(of):
        key = field.name
        if key in _APART:
            continue
        if key in table:
            expected, read = _READERS[hints[key]]
            try:
                values[key] = read(table[key])
            except (ValueError, OverflowError):
                problems.add(where, f"{key} must be {expected}, not {table[key]!r}")
        elif field.default is MISSING and field.default_factory is MISSING:
            problems.add(where, f"{key} is missing")
    return values
