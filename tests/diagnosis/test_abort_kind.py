"""Every reason for the end of a flight is of a kind, by which campaigns limit them."""

import ast
from collections.abc import Iterator

import pytest

from mocap_bridge.errors import MocapError
from onboard.link.errors import LinkTimeout
from perchhw.diagnosis.reasons import abort_kind
from perchhw.diagnosis.rules import RULES, AbortKind
from tests.conftest import REPOSITORY

WORDED_ELSEWHERE = {"pose", "pose_age"}
"""Their words are those of the verdicts on the poses."""
RULE_MAKERS = ("Violation", "at_most", "at_least", "_battery")


@pytest.mark.parametrize(
    ("reason", "kind"),
    [
        ("link_silence: 0.62 s, need at most 0.5 s", AbortKind.LINK),
        ("link_lost: no packet for 1.04 s", AbortKind.LINK),
        ("pose: LOST (occluded), need OK", AbortKind.MOCAP),
        ("pose_age: 0.31 s, need at most 0.3 s", AbortKind.MOCAP),
        ("drone_broke_off: pose_lost (pose: LOST, need OK)", AbortKind.MOCAP),
        ("estimate_to_mocap: 0.3 m, need at most 0.25 m", AbortKind.MOCAP),
        ("battery_at_rest: 3.7 V, need at least 3.8 V; pose: LOST, need OK", AbortKind.BATTERY),
        ("drone_state: tumbled, need upright and unlocked", AbortKind.DRONE),
        ("drone_state: locked, need upright and unlocked (reboot)", AbortKind.DRONE),
        ("drone_broke_off: tilt", AbortKind.DRONE),
        ("the drone did not reach the floor", AbortKind.DRONE),
        ("policy upload took longer than 10 s", AbortKind.DRONE),
        ("corridor_distance: 0.7 m, need at most 0.6 m", AbortKind.PATH),
        ("fence_x_max: -0.2 m to stop in, need at least 0 m to stop in", AbortKind.PATH),
        ("no steady hover at 0.4 m after take-off", AbortKind.PATH),
        ("the course did not come to its end", AbortKind.PATH),
        ("operator", AbortKind.OTHER),
        ("record_lost: no space left", AbortKind.OTHER),
        ("UploadPolicy failed: refused", AbortKind.OTHER),
    ],
)
def test_the_kind_of_an_abort_is_that_of_its_first_rule(reason: str, kind: AbortKind) -> None:
    assert abort_kind(reason) is kind


def test_errors_of_link_and_mocap_are_of_their_kind_whatever_they_say() -> None:
    for error, kind in (
        (LinkTimeout("udp://127.0.0.1:19850 does not answer"), AbortKind.LINK),
        (MocapError("nobody sends"), AbortKind.MOCAP),
    ):
        assert abort_kind(str(error), error) is kind


def rules_of_the_supervisor() -> Iterator[str]:
    """The name of every rule, as its source gives it to what makes a violation; of a pattern its start."""
    for file in sorted((REPOSITORY / "perchhw" / "supervisor").glob("*.py")):
        for call in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and ast.unparse(call.func) in RULE_MAKERS:
                name = call.args[0]
                if isinstance(name, ast.JoinedStr):
                    name = name.values[0]
                if isinstance(name, ast.Constant):
                    yield name.value
                else:
                    assert isinstance(name, ast.Name), f"{file}:{call.lineno}: a rule whose name nobody sees"


def test_every_rule_of_the_supervisor_has_words_and_is_sorted() -> None:
    names = set(rules_of_the_supervisor())
    assert len(names) > 40
    fences = {name for name in names if name.startswith("fence_")}
    assert names - fences - RULES.keys() == WORDED_ELSEWHERE
    assert not {name for name in names if abort_kind(f"{name}: unknown, need known") is AbortKind.OTHER}
