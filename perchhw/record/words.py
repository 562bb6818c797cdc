"""The events of a record in words for a person, whatever shows them."""

import re
from enum import StrEnum
from typing import Any

_LONG_NUMBER = re.compile(r"-?\d+\.\d{4,}(?:e[+-]?\d+)?")
_ANSWER = re.compile(r"^\w+\(order=Order\(number=\d+, command=(.*)\), \w+=(.*)\)$", re.DOTALL)
_MAX_CHARACTERS = 400
_FAILURES = ("internal_error", "StopUnconfirmed")
_WORRYING = ("refused", "CommandFailed", "LinkDown", "RecordLost", "OperatorAbort", "InternalError")


class Level(StrEnum):
    """How much an event matters, as viewers of logs name it."""

    INFO = "INFO"
    WARN = "WARN"
    ERROR = "ERROR"


def level_of(event: dict[str, Any]) -> Level:
    """How much an event of a record matters."""
    if event["event"] in _FAILURES:
        return Level.ERROR
    worrying = event.get("aborted_by") or event.get("alert") or event["event"] in _WORRYING
    return Level.WARN if worrying else Level.INFO


def in_words(event: dict[str, Any]) -> str:
    """An event of a record as one line for a person."""
    name = str(event["event"])
    if name == "phase":
        words = f"phase: {event.get('phase')}"
        words += f" (aborted: {event['aborted_by']})" if event.get("aborted_by") else ""
        return _short(words + (f"; {event['alert']}" if event.get("alert") else ""))
    if name == "command":
        return _short(f"order {event.get('number')}: {event.get('command')}")
    if "what" in event:
        answer = _ANSWER.match(str(event["what"]))
        if answer is None:
            return _short(f"{name}: {event['what']}")
        return _short(f"{name}: {answer[1]}" + ("" if answer[2] == "None" else f" ({answer[2]})"))
    fields = ", ".join(f"{key} {value}" for key, value in event.items() if key not in ("t", "event"))
    return _short(f"{name}: {fields}" if fields else name)


def _short(words: str) -> str:
    """Numbers to four digits, and not longer than a line can hold."""
    rounded = _LONG_NUMBER.sub(lambda number: f"{float(number[0]):.4g}", words)
    return rounded if len(rounded) <= _MAX_CHARACTERS else rounded[:_MAX_CHARACTERS] + " ..."
