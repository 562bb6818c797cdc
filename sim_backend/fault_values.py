"""What a fault of the command line takes, ``--fault NAME=VALUE``, and how its text is read."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

from onboard.errors import InputError
from sim_backend.errors import SimulationError

NEVER = math.inf


class FaultError(SimulationError, InputError):
    """A fault that does not exist or has a value that cannot be used."""


@dataclass(frozen=True, slots=True)
class FaultWindow:
    """A span of simulated time (s); `end` is infinite when the fault stays."""

    start: float
    end: float = NEVER

    def covers(self, time: float) -> bool:
        """Whether the span includes `time`."""
        return self.start <= time < self.end


class FaultRule(NamedTuple):
    """One fault.

    Attributes:
        parse: its value from text; ValueError says what would be right.
        meaning: for help.
        field: of the dataclass that holds its value.
    """

    parse: Callable[[str], object]
    meaning: str
    field: str


NO_TIME = FaultWindow(NEVER, NEVER)

FaultRules = Mapping[str, FaultRule]


def fault(parse: Callable[[str], object], meaning: str, default: object, name: str = "") -> Any:
    """A field of a dataclass of faults; `name` is that of the command line, where it is another one."""
    return field(default=default, metadata={"parse": parse, "meaning": meaning, "name": name})


def fault_rules(faults: Any, prefix: str = "") -> FaultRules:
    """The rules of a dataclass of faults, by their names on the command line: `prefix` and the field's."""
    return {
        prefix + (one.metadata["name"] or one.name): FaultRule(
            one.metadata["parse"], one.metadata["meaning"], one.name
        )
        for one in fields(faults)
    }


def fault_values(texts: Mapping[str, str], rules: FaultRules) -> dict[str, Any]:
    """Values by field, from texts by the name of the fault.

    Raises:
        FaultError: an unknown name or a value that cannot be used.
    """
    values = {}
    for name, text in texts.items():
        if name not in rules:
            raise FaultError(f"--fault {name}={text}: no fault named {name!r}; known: {', '.join(rules)}")
        rule = rules[name]
        try:
            values[rule.field] = rule.parse(text)
        except ValueError as error:
            raise FaultError(f"--fault {name}={text}: {error} ({name}={rule.meaning})") from error
    return values


def number(low: float, high: float = math.inf, scale: float = 1.0) -> Callable[[str], float]:
    """A finite number between `low` and `high`, times `scale`."""

    def parse(text: str) -> float:
        value = float(text)
        if not (low <= value <= high and math.isfinite(value)):
            most = f" and at most {high:g}" if math.isfinite(high) else ""
            raise ValueError(f"must be at least {low:g}{most}")
        return scale * value

    return parse


def integer(*allowed: int) -> Callable[[str], int]:
    """One of some whole numbers."""

    def parse(text: str) -> int:
        value = int(text)
        if value not in allowed:
            raise ValueError(f"must be one of {', '.join(map(str, allowed))}")
        return value

    return parse


def choice(*allowed: str) -> Callable[[str], str]:
    """One of some texts."""

    def parse(text: str) -> str:
        if text not in allowed:
            raise ValueError(f"must be one of {', '.join(allowed)}")
        return text

    return parse


def flag(text: str) -> bool:
    """1 or 0."""
    return integer(0, 1)(text) == 1


TIME = number(0.0)
"""s from the start."""
CHANCE = number(0.0, 1.0)


def times(text: str) -> tuple[float, ...]:
    """``S[,S...]``."""
    return tuple(TIME(part) for part in text.split(","))


def window(duration: float = NEVER) -> Callable[[str], FaultWindow]:
    """``S[:DURATION]``; `duration` (s) where the text has none."""

    def parse(text: str) -> FaultWindow:
        start, colon, length = text.partition(":")
        begin = TIME(start)
        return FaultWindow(begin, begin + (TIME(length) if colon else duration))

    return parse


def vector(text: str) -> tuple[float, float, float]:
    """``X,Y,Z``."""
    parts = [float(part) for part in text.split(",")]
    if len(parts) != 3 or not all(math.isfinite(part) for part in parts):
        raise ValueError("must be three numbers X,Y,Z")
    return (parts[0], parts[1], parts[2])


def motor_pair(text: str) -> tuple[int, int]:
    """``A,B``: two different motors, 1 to 4."""
    parts = [integer(1, 2, 3, 4)(part) for part in text.split(",")]
    if len(parts) != 2 or parts[0] == parts[1]:
        raise ValueError("must be two different motors A,B")
    return parts[0], parts[1]
