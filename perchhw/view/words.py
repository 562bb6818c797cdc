"""What happened, in words: events, phases, the drone's supervisor, the health of the poses."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from onboard.record.run_record import RunRecord
from onboard.supervisor_info import SupervisorBits
from perchhw.record.event_words import EventWords, Level, level_of
from perchhw.view.timeline import Canvas

ENTITY = "events"


@dataclass
class Words:
    """Writes the log as the record grows; what does not change is said once."""

    canvas: Canvas
    _said: dict[str, Any] = field(default_factory=dict, init=False)
    _event_words: EventWords = field(default_factory=EventWords, init=False)

    def add(self, news: RunRecord) -> None:
        """Write what is new, in the order of its times."""
        import rerun as rr

        lines = sorted([*self._events(news), *self._changes(news)], key=lambda line: line[0])
        t = np.array([line[0] for line in lines], dtype=np.float64)
        columns = rr.TextLog.columns(text=[line[2] for line in lines], level=[line[1] for line in lines])
        self.canvas.columns(ENTITY, t, columns)

    def _events(self, news: RunRecord) -> Iterator[tuple[float, Level, str]]:
        for event in news.events:
            words = self._event_words.say(event)
            if words is not None:
                yield float(event["t"]), level_of(event), words

    def _changes(self, news: RunRecord) -> Iterator[tuple[float, Level, str]]:
        pose, supervisor = news.series.get("pose"), news.series.get("supervisor")
        if pose is not None:
            for t, verdict in zip(pose.t, pose.texts("verdict"), strict=True):
                if verdict is not None and self._is_news("mocap", verdict.lower()):
                    level = Level.INFO if verdict.lower() == "ok" else Level.WARN
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


def bits_in_words(bits: int) -> str:
    """The bits of the drone's supervisor that are set."""
    names = [bit.name.lower().replace("_", " ") for bit in SupervisorBits if bits & bit and bit.name]
    return ", ".join(names) or "nothing set"


def _supervisor_level(bits: int) -> Level:
    worrying = SupervisorBits.TUMBLED | SupervisorBits.LOCKED | SupervisorBits.CRASHED
    return Level.WARN if bits & worrying else Level.INFO
