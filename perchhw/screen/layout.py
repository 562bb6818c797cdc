"""A snapshot as rows of text for a width: pure, so that every width can be tried without a terminal."""

import textwrap
from collections.abc import Callable

from rich.text import Text

from perchhw.screen.snapshot import Snapshot

_CELL = 38
"""Columns that a reading needs, with its label."""
_LABEL = 16
_SHORT = {
    "checking": "check",
    "uploading": "upload",
    "arming": "arm",
    "taking off": "take-off",
    "moving to start": "to start",
    "arming approach": "arm approach",
    "approaching": "approach",
    "flipping": "flip",
    "settling": "settle",
    "landing": "land",
    "disarming": "disarm",
}
_OFF_PLAN = ("braking", "landing", "stopping", "done")
KEYS = (("space", "stop now"), ("l", "land"), ("p", "pause after attempt"), ("n", "note"))
ANSWER_KEYS = (("Enter", "done"),)
WORD_KEYS = (("Enter", "keep"), ("Esc", "leave it empty"))


def rows(snapshot: Snapshot, typed: str, width: int, height: int, plain: bool = False) -> list[Text]:
    """At most `height` rows of at most `width` columns; prompt, alert and keys are always among them.

    Args:
        snapshot: what is known.
        typed: what the operator has typed into the present question.
        width, height: of the terminal.
        plain: only ASCII.
    """
    top = [_title(snapshot, width), _phase_bar(snapshot, width, plain), _waiting(snapshot), Text()]
    measured = [] if snapshot.on_desk else _readings(snapshot, width)
    middle = [*measured, Text(), _so_far(snapshot), _left(snapshot)]
    middle += [Text(snapshot.view, "cyan")] if snapshot.view else []
    middle += [Text(part, "dim") for message in snapshot.messages for part in _wrapped(message, width)]
    bottom = [
        *_alert(snapshot, width, plain),
        _rule(width, plain),
        *_prompt(snapshot, typed, width),
        _keys(snapshot, width),
    ]
    room = max(0, height - len(top) - len(bottom))
    shown = [*top, *middle[:room], *[Text()] * (room - len(middle)), *bottom][-height:]
    return [_fitted(row, width, plain) for row in shown]


def _fitted(row: Text, width: int, plain: bool) -> Text:
    if plain:
        row = (
            Text(row.plain.encode("ascii", "replace").decode(), row.style) if not row.plain.isascii() else row
        )
    row.truncate(max(1, width), overflow="crop" if plain else "ellipsis")
    return row


def _title(s: Snapshot, width: int) -> Text:
    which = "" if s.attempt is None or not s.attempts else f"attempt {s.attempt} of {s.attempts}"
    right = ", ".join(word for word in (which, s.condition) if word)
    left = f"{s.title}  {s.drone}"
    if len(left) + len(right) + 2 > width:
        left = s.title
    return Text(left, "bold").append(f"{right:>{max(len(right) + 2, width - len(left))}}")


def _phase_bar(s: Snapshot, width: int, plain: bool) -> Text:
    """Phases done, the present one, those to come: as many of the latter two by name as fit, else signs."""
    done, now, later = ("#", ">", ".") if plain else ("●", "▶", "○")
    if not s.phases:
        return Text(f"{now} connecting" if s.flying else f"{done} no attempt under way", "cyan")
    present = s.phases[-1]
    behind = list(s.phases[:-1])
    known = [phase for phase in s.phases if phase in s.planned]
    to_plan = present in s.planned or present not in _OFF_PLAN
    ahead = list(s.planned[s.planned.index(known[-1]) + 1 :]) if known and to_plan else []
    marks = [(done, name, "green") for name in behind] + [(now, present, "bold cyan")]
    marks += [(later, name, "dim") for name in ahead]
    first, last = len(behind), len(marks)
    for begin, end in ((0, last), *((first, end) for end in range(last, first - 1, -1))):
        texts = [
            f"{mark} {_SHORT.get(name, name)}" if begin <= k < end else mark
            for k, (mark, name, _) in enumerate(marks)
        ]
        if sum(map(len, texts)) + len(texts) <= width:
            break
    bar = Text()
    for text, (_, _, style) in zip(texts, marks, strict=True):
        bar.append(text, style).append(" ")
    return bar


def _waiting(s: Snapshot) -> Text:
    if not s.phases:
        return Text()
    since = "" if s.in_phase_s is None else f", {s.in_phase_s:.1f} s"
    waits = f": waits for {s.waiting_for}" if s.waiting_for else ""
    if s.phases[-1] == "done":
        since, waits = "", ""
    row = Text(s.phases[-1], "bold").append(f"{since}{waits}", "not bold")
    return row if s.aborted_by is None else row.append(f"  ended by {s.aborted_by}", "red")


def _number(value: float | None, shown: Callable[[float], str]) -> str:
    return "-" if value is None else shown(value)


def _readings(s: Snapshot, width: int) -> list[Text]:
    """Label and value of what is measured, in as many columns as fit."""
    hz = _number(s.telemetry_hz, lambda v: f"{v:.0f} Hz")
    silent = _number(s.silence_s, lambda v: f"silent {1000.0 * v:.0f} ms")
    poses = _number(s.mocap_hz, lambda v: f"{v:.0f} Hz")
    age = _number(s.mocap_age_s, lambda v: f"age {1000.0 * v:.0f} ms")
    cells = [
        ("battery", _number(s.battery_v, lambda v: f"{v:.2f} V"), ""),
        ("link", f"{hz}, {silent}", ""),
        ("mocap", f"{poses}, {age}, {s.mocap or 'unknown'}", "" if s.mocap in (None, "OK") else "bold red"),
        ("estimate-mocap", _number(s.estimate_to_mocap_m, lambda v: f"{100.0 * v:.1f} cm"), ""),
        ("tau", _number(s.tau_s, lambda v: f"{v:.3f} s" if abs(v) < 100.0 else "far"), ""),
        ("policy CRC", "-" if s.policy_crc is None else f"{s.policy_crc:08x}", ""),
    ]
    columns = max(1, min(3, width // _CELL))
    found = []
    for first in range(0, len(cells), columns):
        row = Text()
        for label, value, style in cells[first : first + columns]:
            room = max(1, width // columns - _LABEL - 1)
            row.append(f"{label:<{_LABEL}}", "dim").append(f"{value[:room]:<{room}} ", style)
        found.append(row)
    return found


def _so_far(s: Snapshot) -> Text:
    if not s.attempts:
        return Text()
    words = ", ".join(f"{name} {count}" for name, count in s.outcomes) or "none yet"
    return Text("so far          ", "dim").append(words, "")


def _left(s: Snapshot) -> Text:
    if not s.attempts:
        return Text()
    left = s.attempts - sum(count for _, count in s.outcomes)
    words = [_counted(left, "attempt")]
    words += [] if s.time_left_s is None else [f"about {max(1, round(s.time_left_s / 60.0))} min"]
    words += [] if s.packs_left is None else [_counted(s.packs_left, "new pack")]
    return Text("left            ", "dim").append(", ".join(words), "")


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _alert(s: Snapshot, width: int, plain: bool) -> list[Text]:
    if s.alert is None:
        return []
    mark = "!" if plain else "▲"
    return [Text(part, "bold white on red") for part in _wrapped(f"{mark} {s.alert}", width)]


def _rule(width: int, plain: bool) -> Text:
    return Text(("-" if plain else "─") * width, "dim")


def _prompt(s: Snapshot, typed: str, width: int) -> list[Text]:
    """The place for questions; as high when nothing is asked, so that nothing jumps."""
    if s.question is None:
        told = ["paused after this attempt"] if s.paused else []
        told += [f"{s.marks} to be noted after this attempt"] if s.marks else []
        return [Text("; ".join(told), "yellow"), Text()]
    parts = _wrapped(s.question + (" " + typed + "_" if s.wants_words else ", then press Enter"), width)
    return [Text(part, "bold yellow") for part in parts] + [Text()] * (2 - len(parts))


def _keys(s: Snapshot, width: int) -> Text:
    answer = () if s.question is None else ANSWER_KEYS
    orders = KEYS[:1] if s.on_desk else [key for key in KEYS if s.attempts or key[0] != "p"]
    keys = WORD_KEYS if s.wants_words else (*answer, *orders)
    if sum(len(key) + len(does) + 5 for key, does in keys) > width:
        keys = tuple((key, does.split()[0]) for key, does in keys)
    row = Text()
    for key, does in keys:
        row.append(f" {key} ", "reverse").append(f" {does}  ", "")
    return row


def _wrapped(text: str, width: int) -> list[str]:
    """In lines of at most `width`, between words where that is possible."""
    return textwrap.wrap(text, max(1, width)) or [""]
