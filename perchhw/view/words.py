"""What happened, in words: events, phases, the drone's supervisor, the health of the poses."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibration.flights.run_folder import RunRecord
from onboard.supervisor_info import SupervisorBits
from perchhw.view.timeline import Canvas

ENTITY = "events"
_LONG_NUMBER = re.compile(r"-?\d+\.\d{4,}(?:e[+-]?\d+)?")
_ANSWER = re.compile(r"^\w+\(order=Order\(number=\d+, command=(.*)\), \w+=(.*)\)$", re.DOTALL)
_MAX_CHARACTERS = 400


@dataclass
class Words:
    """Writes the log as the record grows; what does not change is said once."""

    canvas: Canvas
    _said: dict[str, Any] = field(default_factory=dict, init=False)

    def add(self, news: RunRecord) -> None:
        """Write what is new, in the order of its times."""
        import rerun as rr

        lines = sorted([*self._events(news), *self._changes(news)], key=lambda line: line[0])
        t = np.array([line[0] for line in lines], dtype=np.float64)
        columns = rr.TextLog.columns(text=[line[2] for line in lines], level=[line[1] for line in lines])
        self.canvas.columns(ENTITY, t, columns)

    def _events(self, news: RunRecord) -> Iterator[tuple[float, str, str]]:
        for event in news.events:
            yield float(event["t"]), level_of(event), in_words(event)

    def _changes(self, news: RunRecord) -> Iterator[tuple[float, str, str]]:
        pose, supervisor = news.series.get("pose"), news.series.get("supervisor")
        if pose is not None:
            for t, verdict in zip(pose.t, pose.texts("verdict"), strict=True):
                if verdict is not None and self._is_news("mocap", verdict.lower()):
                    level = "INFO" if verdict.lower() == "ok" else "WARN"
                    yield float(t), level, f"mocap: {verdict.lower()}"
        if supervisor is not None:
            for t, bits in zip(supervisor.t, supervisor.numbers("bits"), strict=True):
                if not np.isnan(bits) and self._is_news("bits", int(bits)):
                    yield (
                        float(t),
                        _supervisor_level(int(bits)),
                        f"drone's supervisor: {bits_in_words(int(bits))}",
                    )

    def _is_news(self, what: str, value: object) -> bool:
        changed = self._said.get(what) != value
        self._said[what] = value
        return changed


def level_of(event: dict[str, Any]) -> str:
    """INFO, WARN or ERROR, as log viewers name them."""
    if event["event"] in ("internal_error", "StopUnconfirmed"):
        return "ERROR"
    worrying = event.get("aborted_by") or event.get("alert") or event["event"] in _WORRYING
    return "WARN" if worrying else "INFO"


_WORRYING = ("refused", "CommandFailed", "LinkDown", "RecordLost", "OperatorAbort", "InternalError")


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


def bits_in_words(bits: int) -> str:
    """The bits of the drone's supervisor that are set."""
    names = [bit.name.lower().replace("_", " ") for bit in SupervisorBits if bits & bit and bit.name]
    return ", ".join(names) or "nothing set"


def _supervisor_level(bits: int) -> str:
    worrying = SupervisorBits.TUMBLED | SupervisorBits.LOCKED | SupervisorBits.CRASHED
    return "WARN" if bits & worrying else "INFO"
