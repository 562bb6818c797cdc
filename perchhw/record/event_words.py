"""The events of a record as a person says them: no names of classes, numbers with units."""

import re
from enum import StrEnum
from typing import Any

from onboard.record.run_record import RunRecord

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NAMES = {
    "UploadPolicy": "upload and check the policy",
    "Arm": "arm the motors",
    "TakeOff": "take off",
    "GoTo": "go to",
    "ArmApproach": "hand over the approach and arm it, then the policy",
    "StartApproach": "start the approach",
    "FlyCourse": "fly the course",
    "Brake": "brake and hold",
    "DisarmPolicy": "switch the policy off",
    "Land": "land",
    "Disarm": "disarm",
    "EmergencyStop": "cut the motors now",
}
_PLAIN = {"StopConfirmed": "the drone is locked: its motors have stopped"}


_FAILURES = ("internal_error", "StopUnconfirmed")
_WORRYING = (
    "refused",
    "CommandFailed",
    "LinkDown",
    "RecordLost",
    "OperatorAbort",
    "InternalError",
    "HostStoodStill",
)
_MAX_CHARACTERS = 400


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


class EventWords:
    """Says the events of one record, in their order: what the operator was told is said when it changes."""

    def __init__(self) -> None:
        self._alert: Any = None

    def say(self, event: dict[str, Any]) -> str | None:
        """An event as one line; None for one that says nothing new."""
        words = _words(event)
        if words is None:
            return None
        if event.get("alert") and event["alert"] != self._alert:
            words += f" — told the operator: {event['alert']}"
        self._alert = event.get("alert", self._alert)
        return words if len(words) <= _MAX_CHARACTERS else words[:_MAX_CHARACTERS] + " ..."


def time_line(run: RunRecord) -> list[tuple[float, str]]:
    """What happened in a run: seconds from its start, and a few words."""
    start = float(run.info.get("clock_at_start") or 0.0)
    teller = EventWords()
    told = ((float(event["t"]) - start, teller.say(event)) for event in run.events)
    lines = [(t, words) for t, words in told if words is not None]
    lines.sort(key=lambda line: line[0])  # the words of a note are written after the flight
    outcome = run.info.get("outcome")
    if outcome is not None and lines:
        lines.append((lines[-1][0], f"outcome: {str(outcome).replace('_', ' ')}"))
    return lines


def _words(event: dict[str, Any]) -> str | None:
    """The event in words; None for one that says nothing new."""
    name, what = str(event["event"]), str(event.get("what", ""))
    match name:
        case "phase":
            ended = event.get("aborted_by")
            return f"phase: {event.get('phase')}" + (f" (ended by {ended})" if ended else "")
        case "command":
            return f"ordered: {command_words(str(event.get('command', '')))}"
        case "CommandDone":
            value = re.search(r"value=(\d+)", what)
            return None if value is None else f"the policy is live: CRC {int(value.group(1)):08x}"
        case "labelled":
            return None
        case "CommandFailed":
            return f"failed: {command_words(_inner(what, 'command='))}: {_reason(what)}"
        case "OperatorAbort":
            return (
                "the operator's key: cut the motors" if "urgent=True" in what else "the operator's key: land"
            )
        case "note":
            text = str(event.get("text") or "")
            return f"the operator's note: {text}" if text else "the operator's key: a moment to be noted"
        case "connecting":
            return f"connecting to {event.get('drone')} and {event.get('mocap')}"
        case "refused" | "StopUnconfirmed" | "LinkDown" | "RecordLost" | "InternalError" | "HostStoodStill":
            title = re.sub(r"(?<!^)(?=[A-Z])", " ", name).lower()
            return f"{title}: {event.get('reason') or _reason(what)}"
        case "internal_error":
            return f"an error of perchhw: {event.get('error')}"
    return _PLAIN.get(name, _rest(name, event))


def command_words(text: str) -> str:
    """``GoTo(position=(-2.584, 0.0, 0.477), duration=2.0)`` as *go to x -2.58, y 0.00, z 0.48 m in 2.0 s*."""
    name, _, arguments = text.partition("(")
    words = _NAMES.get(name, re.sub(r"(?<!^)(?=[A-Z])", " ", name).lower())
    place = re.search(rf"position=\(({_NUMBER}), ({_NUMBER}), ({_NUMBER})\)", arguments)
    if place is not None:
        words += " " + ", ".join(
            f"{axis} {float(value):.2f}" for axis, value in zip("xyz", place.groups(), strict=True)
        )
        words += " m"
    height = re.search(rf"height=({_NUMBER})", arguments)
    if height is not None:
        words += f" to {float(height.group(1)):.2f} m"
    duration = re.search(rf"duration=({_NUMBER})", arguments)
    return words if duration is None else f"{words} in {float(duration.group(1)):.1f} s"


def _inner(text: str, key: str) -> str:
    """The call that follows `key`, with its brackets."""
    begin = text.find(key)
    if begin < 0:
        return text
    depth, rest = 0, text[begin + len(key) :]
    for k, letter in enumerate(rest):
        depth += (letter == "(") - (letter == ")")
        if depth == 0 and letter == ")":
            return rest[: k + 1]
    return rest


def _reason(text: str) -> str:
    found = re.search(r"reason=(['\"])(.*)\1\)?$", text)
    return found.group(2) if found is not None else text


def _rest(name: str, event: dict[str, Any]) -> str:
    """An event that has no words of its own: its name and its plain values."""
    fields = ", ".join(
        f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
        for key, value in event.items()
        if key not in ("t", "event") and value is not None and not isinstance(value, dict | list)
    )
    title = name.replace("_", " ")
    return f"{title}: {fields}" if fields else title
