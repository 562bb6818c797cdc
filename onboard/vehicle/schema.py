"""How a vehicle file is checked: which keys, units and ranges are allowed, and what to say when they are not.

A section of a vehicle file is a frozen dataclass whose fields are annotated with their SI unit and range
(:class:`Measured`). :func:`parse_section` turns a TOML table into such a dataclass and writes every problem
that it meets into a :class:`Problems` list, so that a check reports all of them at once.
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from enum import Enum
from typing import Any, ClassVar, Protocol, TypeVar, get_type_hints

from onboard.errors import InputError, OnboardError
from onboard.quantity import Quantity, UnitError, convert, si_unit

QUANTITY_KEYS = ("value", "unit", "sigma", "source")


class VehicleFileError(OnboardError, InputError):
    """A vehicle file that cannot be used. The message names file and key, and says what to do."""


class Range(Enum):
    """Range that a value must lie in."""

    ANY = "a number"
    NON_NEGATIVE = "zero or more"
    POSITIVE = "more than zero"
    FRACTION = "between 0 and 1"
    PWM_BITS = "a whole number from 1 to 16"

    def contains(self, value: float) -> bool:
        """Whether `value` lies in the range."""
        match self:
            case Range.NON_NEGATIVE:
                return value >= 0.0
            case Range.POSITIVE:
                return value > 0.0
            case Range.FRACTION:
                return 0.0 <= value <= 1.0
            case Range.PWM_BITS:
                return value == int(value) and 1 <= value <= 16
            case Range.ANY:
                return True


@dataclass(frozen=True)
class Measured:
    """What a quantity of a section must be: written as ``mass: Annotated[Quantity, Measured("kg", ...)]``."""

    unit: str
    allowed: Range


class Problems:
    """What is wrong with one file, as sentences that name file and key."""

    def __init__(self, file: str, error: type[InputError] = VehicleFileError) -> None:
        self.file = file
        self._error = error
        self.messages: list[str] = []

    def add(self, key: str, message: str) -> None:
        """Note one problem at `key` (dotted path; empty for the file as a whole)."""
        place = f"{self.file}: {key}" if key else self.file
        self.messages.append(f"{place}: {message}")

    def raise_any(self) -> None:
        """Raise the kind of error that this file has, with everything noted, if anything was."""
        if self.messages:
            raise self._error("\n".join(self.messages))


class _Section(Protocol):
    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]


SectionT = TypeVar("SectionT", bound=_Section)


def quantity_rules(section: type[_Section]) -> dict[str, Measured]:
    """The quantity keys of a section with their rules, in file order."""
    rules: dict[str, Measured] = {}
    for name, hint in get_type_hints(section, include_extras=True).items():
        for note in getattr(hint, "__metadata__", ()):
            if isinstance(note, Measured):
                rules[name] = note
    return rules


def as_table(raw: object, key: str, problems: Problems) -> Mapping[str, object] | None:
    """`raw` if it is a TOML table; otherwise a problem is noted and None returned."""
    if isinstance(raw, Mapping):
        return raw
    problems.add(key, f"must be a table, not {type(raw).__name__}")
    return None


def as_text(raw: object, key: str, problems: Problems, required: bool = True) -> str | None:
    """`raw` if it is a text that is not empty, else None with the problem noted."""
    if raw is None:
        if required:
            problems.add(key, f'is missing; add {key.rpartition(".")[2]} = "..."')
        return None
    if isinstance(raw, str) and raw.strip():
        return raw
    problems.add(key, f"must be text that is not empty, not {raw!r}")
    return None


def check_keys(table: Mapping[str, object], key: str, known: Iterable[str], problems: Problems) -> None:
    """Note every key of `table` that is not in `known`, with the nearest known one as a hint."""
    names = list(known)
    for name in table:
        if name not in names:
            near = get_close_matches(name, names, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known keys: {', '.join(names)}"
            problems.add(f"{key}.{name}" if key else name, f"unknown key; {hint}")


def parse_quantity(raw: object, key: str, rule: Measured | None, problems: Problems) -> Quantity | None:
    """A quantity table in SI units, or None with the problems noted.

    Without a `rule` any unit and value are allowed; the unit is still converted to SI.
    """
    if not isinstance(raw, Mapping):
        form = f'{{ value, unit = "{rule.unit if rule else "..."}", sigma, source }}'
        problems.add(key, f"must be a table {form}, not {raw!r}")
        return None
    before = len(problems.messages)
    check_keys(raw, key, QUANTITY_KEYS, problems)
    for name in QUANTITY_KEYS:
        if name not in raw:
            problems.add(f"{key}.{name}", "is missing; every quantity needs value, unit, sigma and source")
    if len(problems.messages) > before:
        return None
    value = finite(raw["value"], f"{key}.value", problems)
    sigma = finite(raw["sigma"], f"{key}.sigma", problems)
    unit, source = raw["unit"], raw["source"]
    if not isinstance(unit, str):
        problems.add(f"{key}.unit", f"must be text, not {unit!r}")
        return None
    if not isinstance(source, str) or not source.strip():
        problems.add(f"{key}.source", 'must say where the number comes from (or "engineering estimate")')
        return None
    if value is None or sigma is None:
        return None
    if sigma < 0.0:
        problems.add(f"{key}.sigma", f"is {sigma}; a standard uncertainty is zero or more")
        return None
    return _in_si(Quantity(value, unit, sigma, source), key, rule, problems)


def _in_si(quantity: Quantity, key: str, rule: Measured | None, problems: Problems) -> Quantity | None:
    try:
        target = rule.unit if rule else si_unit(quantity.unit)[0]
        value = convert(quantity.value, quantity.unit, target)
        sigma = convert(quantity.sigma, quantity.unit, target)
    except UnitError as error:
        problems.add(f"{key}.unit", str(error))
        return None
    if rule is not None and not rule.allowed.contains(value):
        problems.add(f"{key}.value", f"is {quantity.value} {quantity.unit}; it must be {rule.allowed.value}")
        return None
    return Quantity(value, target, sigma, quantity.source)


def finite(raw: object, key: str, problems: Problems) -> float | None:
    """`raw` if it is a finite number, else None with the problem noted."""
    if isinstance(raw, bool) or not isinstance(raw, int | float):
        problems.add(key, f"must be a number, not {raw!r}")
        return None
    try:
        number = float(raw)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        problems.add(key, f"is {raw!r}; give a finite number")
        return None
    return number


def parse_quantities(
    table: Mapping[str, object],
    key: str,
    rules: Mapping[str, Measured],
    optional: Iterable[str],
    problems: Problems,
) -> dict[str, Quantity]:
    """The quantities of `table` named in `rules`; missing ones are noted unless they are `optional`."""
    found: dict[str, Quantity] = {}
    may_miss = set(optional)
    for name, rule in rules.items():
        if name in table:
            quantity = parse_quantity(table[name], f"{key}.{name}", rule, problems)
            if quantity is not None:
                found[name] = quantity
        elif name not in may_miss:
            form = f'{name} = {{ value, unit = "{rule.unit}", sigma, source }}'
            problems.add(f"{key}.{name}", f"is missing; add {form}")
    return found


def parse_section(
    section: type[SectionT],
    raw: object,
    key: str,
    problems: Problems,
    others: Mapping[str, object] | None = None,
) -> SectionT | None:
    """A section's dataclass from its TOML table, or None with the problems noted.

    Args:
        section: the dataclass, quantities annotated with :class:`Measured`.
        raw: what the file holds at `key`.
        key: dotted path of the section.
        problems: where problems are noted.
        others: fields that are not quantities, already parsed (their keys in the table are accepted).
    """
    table = as_table(raw, key, problems)
    if table is None:
        return None
    extra = dict(others or {})
    rules = quantity_rules(section)
    before = len(problems.messages)
    check_keys(table, key, [*extra, *rules], problems)
    optional = [item.name for item in dataclasses.fields(section) if item.default is None]
    quantities = parse_quantities(table, key, rules, optional, problems)
    if len(problems.messages) > before or any(value is None for value in extra.values()):
        return None
    return section(**extra, **quantities)
