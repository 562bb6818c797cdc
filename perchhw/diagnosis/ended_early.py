"""A flight that a rule, a person or a failure ended: which, with its value against its limit."""

import re
from typing import NamedTuple

from onboard.link.errors import BROKE_WHILE_SET_UP
from onboard.record.run_record import RunRecord
from perchhw.diagnosis.busy import REMEDY, busy_words
from perchhw.diagnosis.finding import Cause, Diagnosis, Number
from perchhw.diagnosis.gyro import blame_gyro
from perchhw.diagnosis.mocap import REMEDIES, WORDS, blame_poses, frames_share, mocap_fault
from perchhw.diagnosis.reasons import reason_in_words
from perchhw.diagnosis.rules import BROKE_OFF, FENCES, RULES, RuleWords
from perchhw.supervisor.machine import STOPPED_BY_OTHERS

_BROKEN = re.compile(r"^(?P<rule>[a-z_]+): (?P<measured>.*), need (?P<demanded>.*)$")
_POSE_RULES = ("pose", "pose_age")
_DRIFTING = (Cause.OFF_PATH, Cause.ESTIMATE_WRONG, Cause.START_NOT_REACHED)
_MISPLACED = (*_DRIFTING, Cause.LEFT_ROOM)
_MARK_RULES = ("start_mark_distance", "start_mark_heading")
_MANY_FRAMES = 0.9
_NOBODY_THERE = ("cannot receive from udp:", "cannot send to udp:")
"""What the link says where the system knows that nobody listens any more: no late computer's doing."""
_PREFLIGHT = ("checking", "uploading", "ready")
_LOOK = "look at the time line of the report (perchhw log report RUN)"
_CUT_BY_OPERATOR = RuleWords(
    Cause.OPERATOR,
    "the operator stopped it, and its motors were cut at once",
    "look the drone over, for one in the air has fallen; it is locked until it is rebooted (--put-back)",
)


class Broken(NamedTuple):
    """One rule of ``aborted_by``, taken apart; a text that names no rule has empty parts."""

    rule: str
    measured: str
    demanded: str


def broken_rules(aborted_by: str) -> list[Broken]:
    """The rules that a reason names; one that names none gives its whole text as the measured part."""
    found = []
    for part in re.split(r"; (?=[a-z_]+: )", aborted_by):
        match = _BROKEN.match(part)
        found.append(Broken(**match.groupdict()) if match else Broken("", part, ""))
    return found


def diagnose_ended(run: RunRecord, aborted_by: str) -> Diagnosis:
    """The finding of an attempt that ended for the reason `aborted_by`."""
    phase, t = where_it_ended(run)
    known = _by_word(aborted_by) or _by_pose(run, aborted_by, t)
    if known is None:
        known = _by_rules(aborted_by)
    found, numbers = known
    if found.cause is Cause.OPERATOR and _stopped(run):
        found = _CUT_BY_OPERATOR
    gone = any(words in aborted_by for words in _NOBODY_THERE)
    if not gone and (busy := busy_words(run.info, found.cause)) is not None:
        found = RuleWords(found.cause, f"{found.words}; {busy[0]}", f"{REMEDY}; else {found.next}")
        numbers = {**numbers, **busy[1]}
    place = "before take-off" if phase in _PREFLIGHT else f"while {phase}"
    sentence = f"ended {place}: {found.words}" if phase else f"ended: {found.words}"
    fell = run.info.get("fell")
    if fell:
        sentence += "; its motors were cut before it was down"
    told = Diagnosis(found.cause, sentence, found.next, {"phase": phase, **numbers})
    told = blame_gyro(run, told) if found.cause in _DRIFTING else told
    misplaced = told.cause in _MISPLACED or any(rule in numbers for rule in _MARK_RULES)
    return blame_poses(run, told) if misplaced else told


def _stopped(run: RunRecord) -> bool:
    """Whether the motors were cut, and not landed with."""
    return any(event["event"] == "phase" and event.get("phase") == "stopping" for event in run.events)


def where_it_ended(run: RunRecord) -> tuple[str | None, float]:
    """The phase in which the reason came up, and when (s)."""
    phase: str | None = None
    for event in run.events:
        if event["event"] == "phase":
            if event.get("aborted_by"):
                return phase, float(event["t"])
            phase = str(event.get("phase"))
    return phase, float(run.events[-1]["t"]) if run.events else 0.0


def _by_word(aborted_by: str) -> tuple[RuleWords, dict[str, Number]] | None:
    """Reasons that are no rule with a limit."""
    if aborted_by.endswith(STOPPED_BY_OTHERS):
        words = "somebody else stopped the drone (perchhw stop, or its own supervisor)"
        return RuleWords(
            Cause.STOPPED_BY_OTHERS, words, "ask who stopped it and why, then reboot the drone"
        ), {}
    if (found := reason_in_words(aborted_by)) is not None:
        return found, {}
    if " failed: " in aborted_by:
        command, _, why = aborted_by.partition(" failed: ")
        return RuleWords(Cause.COMMAND_FAILED, f"the order {command} failed ({why})", "perchhw doctor"), {}
    if BROKE_WHILE_SET_UP in aborted_by:
        return RuleWords(Cause.LINK_LOST, aborted_by, RULES["link_lost"].next), {}
    return None


def _by_pose(run: RunRecord, aborted_by: str, t: float) -> tuple[RuleWords, dict[str, Number]] | None:
    """Poses that were refused or stayed away, told apart by their verdicts in the record."""
    broken, *others = broken_rules(aborted_by)
    lost = aborted_by.startswith("drone_broke_off: pose_lost")
    if broken.rule not in _POSE_RULES and not lost:
        return None
    cause, counts = mocap_fault(run, t)
    words = WORDS[cause]
    if cause is Cause.MOCAP_SILENT and (share := frames_share(run)) is not None and share < _MANY_FRAMES:
        words = f"only {share:.0%} of the frames of motion capture came"
    elif "age_ms" in counts:
        words += f", {counts['age_ms']} ms after their capture"
    elif counts and cause is not Cause.MOCAP_SILENT:
        words += f" ({', '.join(f'{count} frames {name}' for name, count in counts.items())})"
    if broken.rule == "pose_age":
        words += f"; its last good pose was {broken.measured} old, {_limit(broken.demanded)}"
    if lost:
        words = f"the drone broke off because it had no poses: {words}"
    words = "; ".join((words, *_in_words(_apart(others))))
    return RuleWords(cause, words, REMEDIES[cause]), dict(counts)


def _by_rules(aborted_by: str) -> tuple[RuleWords, dict[str, Number]]:
    """Every rule that the reason names, in words; the cause is that of the first."""
    if aborted_by.startswith("drone_broke_off: "):
        reason = re.split(r"[ (]", aborted_by.partition(": ")[2])[0]
        unknown = RuleWords(Cause.DRONE_ENDED_IT, f"the drone broke off its approach ({reason})", _LOOK)
        return BROKE_OFF.get(reason, unknown), {}
    first, *others = broken_rules(aborted_by)
    broken = [first, *(_apart(others) if _meaning(first).cause is Cause.LINK_LOST else others)]
    meanings = [_meaning(one) for one in broken]
    words = "; ".join(_in_words(broken))
    numbers: dict[str, Number] = {one.rule: one.measured for one in broken if one.rule}
    nexts = list(dict.fromkeys(meaning.next for meaning in meanings))
    return RuleWords(meanings[0].cause, words, "; ".join(nexts)), numbers


def _apart(others: list[Broken]) -> list[Broken]:
    """Broken rules that are more than a consequence of poses or values that stay away."""
    return [one for one in others if one.measured != "unknown" and one.rule not in _POSE_RULES]


def _in_words(broken: list[Broken]) -> list[str]:
    return [_with_limit(_meaning(one).words, one) for one in broken]


def _meaning(broken: Broken) -> RuleWords:
    if broken.rule in RULES:
        return RULES[broken.rule]
    if broken.rule.startswith("fence_"):
        return FENCES
    words = broken.rule.replace("_", " ") if broken.rule else broken.measured
    return RuleWords(Cause.RULE if broken.rule else Cause.NOT_BEGUN, words, _LOOK)


def _with_limit(words: str, broken: Broken) -> str:
    return f"{words}: {broken.measured}, {_limit(broken.demanded)}" if broken.rule else words


def _limit(demanded: str) -> str:
    """``at most 35 deg`` as a limit in words."""
    if demanded.startswith(("at most", "at least")):
        return f"{demanded} allowed" if demanded.startswith("at most") else f"{demanded} needed"
    return f"{demanded} needed"
