"""What ended an attempt is named as what it was, with its value against its limit."""

import json
from typing import Any

import pytest

from mocap_bridge.health import PoseVerdict
from onboard.link.crazyflie import broken_opening
from onboard.record.checksum import with_checksum
from perchhw.diagnosis import Cause, diagnose_run, keep_diagnosis
from perchhw.diagnosis.ended_early import broken_rules
from perchhw.diagnosis.rules import RULES
from perchhw.record.listing import kept_sentence
from perchhw.supervisor import Observation, SafetyLimits
from perchhw.supervisor.descent import DESCENT_RULES
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.rules import APPROACH_RULES, HOVER_RULES, PREFLIGHT_RULES, TEST_FLIGHT_RULES
from tests.diagnosis.conftest import Ended

STALE = "drone_broke_off: pose_lost (pose: STALE (refused so far: 16 of a kind), need OK)"
OTHERS = "drone_can_fly: no, need yes; stopped by others: perchhw stop, or the drone's own supervisor"


@pytest.mark.parametrize(
    ("aborted_by", "cause", "said"),
    [
        ("battery_at_rest: 3.7 V, need at least 3.8 V", Cause.BATTERY_LOW, "3.7 V, at least 3.8 V needed"),
        ("battery_in_flight: 2.6 V, need at least 2.72 V", Cause.BATTERY_LOW, "under load: 2.6 V"),
        ("link_silence: 0.6 s, need at most 0.5 s", Cause.LINK_LOST, "0.6 s, at most 0.5 s allowed"),
        ("link_lost: no packet for 1.04 s", Cause.LINK_LOST, "no packet for 1.04 s"),
        ("tilt_in_hover: 38.3 deg, need at most 35 deg", Cause.TUMBLED, "tipped over: 38.3 deg"),
        ("drone_state: tumbled, need upright and unlocked (reboot)", Cause.TUMBLED, "tumbled"),
        ("drone_state: locked, need upright and unlocked (reboot)", Cause.STOPPED_BY_OTHERS, "locked"),
        (OTHERS, Cause.STOPPED_BY_OTHERS, "somebody else stopped the drone"),
        ("operator", Cause.OPERATOR, "the operator stopped it"),
        ("corridor_distance: 0.7 m, need at most 0.6 m", Cause.OFF_PATH, "0.7 m, at most 0.6 m allowed"),
        ("fence_x_max: -0.2 m to stop in, need at least 0 m to stop in", Cause.LEFT_ROOM, "too near"),
        ("drone_broke_off: tilt", Cause.TUMBLED, "broke off: it tilted too far"),
        ("drone_broke_off: abort", Cause.DRONE_ENDED_IT, "broke off its approach (abort)"),
        ("UploadPolicy failed: refused", Cause.COMMAND_FAILED, "order UploadPolicy failed (refused)"),
        ("record_lost: disk full", Cause.RECORD_LOST, "disk full"),
        ("approach: no answer from the drone", Cause.NOT_BEGUN, "no answer from the drone"),
    ],
)
def test_reasons_in_words(ended: Ended, aborted_by: str, cause: Cause, said: str) -> None:
    found = diagnose_run(ended(aborted_by))
    assert (found.cause, found.values["phase"]) == (cause, "approaching")
    assert found.sentence.startswith("ended while approaching: ")
    assert said in found.sentence
    assert found.next


def test_a_connection_that_breaks_while_it_is_set_up_is_a_lost_link(ended: Ended) -> None:
    found = diagnose_run(ended(str(broken_opening("udp://127.0.0.1:1", "gone", heard=True))))
    assert found.cause is Cause.LINK_LOST
    assert "udp://127.0.0.1:1 answered" in found.sentence


def test_an_operator_who_cut_the_motors_is_not_told_to_fly_again_at_once(ended: Ended) -> None:
    found = diagnose_run(ended("operator", way_out="stopping"))
    assert (found.cause, found.values["phase"]) == (Cause.OPERATOR, "approaching")
    assert "its motors were cut" in found.sentence
    assert "locked until it is rebooted" in found.next


@pytest.mark.parametrize(
    ("verdict", "cause"),
    [
        (PoseVerdict.OCCLUDED, Cause.MOCAP_OCCLUDED),
        (PoseVerdict.FROZEN, Cause.MOCAP_FROZEN),
        (PoseVerdict.JUMPED, Cause.MOCAP_JUMPED),
        (PoseVerdict.FLIPPED, Cause.MOCAP_JUMPED),
        (PoseVerdict.LATE, Cause.MOCAP_LATE),
    ],
)
def test_poses_are_told_apart_by_what_was_refused(ended: Ended, verdict: PoseVerdict, cause: Cause) -> None:
    found = diagnose_run(ended(STALE, verdicts=verdict.name))
    assert found.cause is cause
    assert found.values[verdict.value] == 30
    assert "(30 frames" in found.sentence


def test_poses_that_are_old_or_stay_away(ended: Ended) -> None:
    assert diagnose_run(ended("pose: COASTING, need OK", age=0.04)).cause is Cause.MOCAP_LATE


def test_frames_that_stay_away(ended: Ended) -> None:
    found = diagnose_run(ended("pose_age: 0.31 s, need at most 0.3 s"))
    assert found.cause is Cause.MOCAP_SILENT
    assert "0.31 s old, at most 0.3 s allowed" in found.sentence


@pytest.mark.parametrize(
    ("info", "said"),
    [
        ({"drone_clock_rate": 0.83, "host": {"cpus": 2, "load": 1.0}}, "the lab ran at 0.83 of real time"),
        ({"drone_clock_rate": 1.0, "host": {"cpus": 2, "load": 17.0}}, "its load was 17 on 2 processors"),
        ({"drone_clock_rate": 1.0, "host": {"cpus": 8, "load": 9.0}}, None),
        ({"host": {"cpus": 2, "load": 3.7, "late_s": 0.251}}, "program was late by 251 ms"),
        ({"host": {"cpus": 2, "load": 3.7, "late_s": 0.052}}, None),
        ({"drone_clock_rate": None}, None),
    ],
)
def test_a_computer_that_was_too_busy_is_named(ended: Ended, info: dict[str, Any], said: str | None) -> None:
    run = ended("pose_age: 0.31 s, need at most 0.3 s")
    run.info.update(info)
    found = diagnose_run(run)
    assert found.cause is Cause.MOCAP_SILENT
    assert ("too busy" in found.sentence) is (said is not None)
    assert (said or "") in found.sentence
    assert ("--pace lockstep" in found.next) is (said is not None)
    run.info["aborted_by"] = "operator"
    assert "busy" not in diagnose_run(run).sentence


@pytest.mark.parametrize(
    ("why", "busy"),
    [
        ("no packet from udp://127.0.0.1:19850 for 1.00 s although asked: frozen or away", True),
        ("cannot receive from udp://127.0.0.1:19850: Connection refused", False),
        ("cannot send to udp://127.0.0.1:19850: Connection refused", False),
    ],
)
def test_a_link_at_whose_end_nobody_is_was_not_lost_to_a_busy_computer(
    ended: Ended, why: str, busy: bool
) -> None:
    run = ended(f"link_lost: the link to udp://127.0.0.1:19850 is lost: {why}")
    run.info.update({"drone_clock_rate": 1.0, "host": {"cpus": 2, "load": 17.0}})
    found = diagnose_run(run)
    assert found.cause is Cause.LINK_LOST
    assert ("too busy" in found.sentence) is ("--pace lockstep" in found.next) is busy


@pytest.mark.parametrize(("rate", "busy"), [(0.95, True), (1.0, False)])
def test_a_lab_that_is_late_hides_the_drone_from_its_cameras(ended: Ended, rate: float, busy: bool) -> None:
    run = ended(STALE, verdicts=PoseVerdict.OCCLUDED.name)
    run.info.update({"drone_clock_rate": rate, "host": {"cpus": 2, "load": 17.0}})
    found = diagnose_run(run)
    assert found.cause is Cause.MOCAP_OCCLUDED
    assert ("too busy" in found.sentence) is ("--pace lockstep" in found.next) is busy


def test_a_biased_gyro_is_found_behind_what_it_causes(ended: Ended) -> None:
    reason = "the start of the approach was not reached within 14.6 s"
    found = diagnose_run(ended(reason, bias=0.2))
    assert found.cause is Cause.GYRO_BIASED
    assert found.values["gyro_bias_rad_s"] == pytest.approx(0.2)


ELSEWHERE = "estimate_to_mocap: 0.525 m, need at most 0.05 m"


@pytest.mark.parametrize(
    "reason",
    [
        ELSEWHERE,
        "start_mark_heading: 179 deg, need at most 15 deg",
        "the start of the approach was not reached within 14.6 s",
    ],
)
def test_poses_that_turned_round_on_the_ground_are_found_behind_what_they_cause(
    ended: Ended, reason: str
) -> None:
    found = diagnose_run(ended(reason, jumped=9))
    assert (found.cause, found.values["flipped"]) == (Cause.MOCAP_JUMPED, 9)
    assert "before take-off (9 frames flipped); ended while approaching: " in found.sentence
    assert "asymmetric" in found.next


@pytest.mark.parametrize(
    ("jumped", "reason", "cause"),
    [
        (8, ELSEWHERE, Cause.ESTIMATE_WRONG),
        (9, "battery_at_rest: 3.7 V, need at least 3.8 V", Cause.BATTERY_LOW),
    ],
)
def test_poses_that_were_never_believed_or_explain_nothing_are_not_blamed(
    ended: Ended, jumped: int, reason: str, cause: Cause
) -> None:
    assert diagnose_run(ended(reason, jumped=jumped)).cause is cause


def test_a_start_that_is_not_reached(ended: Ended) -> None:
    reason = "the start of the approach was not reached within 14.6 s"
    assert diagnose_run(ended(reason)).cause is Cause.START_NOT_REACHED


def test_all_failing_rules_are_said_at_once(ended: Ended) -> None:
    reason = (
        "tilt_on_ground: 30 deg, need at most 10 deg; battery_at_rest: 3.6 V, need at least 3.8 V; "
        "drone_can_arm: no, need yes"
    )
    found = diagnose_run(ended(reason))
    for said in ("does not stand upright: 30 deg", "not charged: 3.6 V", "do not let it arm: no"):
        assert said in found.sentence
    assert "start mark" in found.next
    assert "charge" in found.next


def test_consequences_of_a_silent_room_are_not_told_as_causes(ended: Ended) -> None:
    reason = (
        "pose: LOST, need OK; inside_room: unknown, need known; battery_at_rest: 3.6 V, need at least 3.8 V"
    )
    found = diagnose_run(ended(reason))
    assert found.cause is Cause.MOCAP_SILENT
    assert "room" not in found.sentence
    assert "3.6 V" in found.sentence


def test_every_rule_of_the_supervisor_has_words() -> None:
    nothing, limits = Admitted(Observation()), SafetyLimits()
    rules = {*PREFLIGHT_RULES, *HOVER_RULES, *APPROACH_RULES, *TEST_FLIGHT_RULES, *DESCENT_RULES}
    broken = [violation for rule in rules if (violation := rule(nothing, limits)) is not None]
    names = {violation.rule for violation in broken} - {"pose"}
    assert len(names) > 15
    assert not {name for name in names if name not in RULES and not name.startswith("fence_")}
    for violation in broken:
        parts = broken_rules(str(violation))[0]
        assert (parts.rule, parts.measured, parts.demanded) == (
            violation.rule,
            violation.measured,
            violation.demanded,
        )


def test_what_a_killed_process_leaves(ended: Ended) -> None:
    folder = ended(None).folder
    info = json.loads((folder / "run.json").read_text())
    left = with_checksum({**info, "closed": False, "outcome": None})
    (folder / "run.json").write_text(json.dumps(left))
    events = (folder / "events.jsonl").read_text()
    (folder / "events.jsonl").write_text(events[: events.index('"braking"') - 20])
    found = keep_diagnosis(folder)
    assert found.cause is Cause.PROCESS_KILLED
    assert "while approaching" in found.sentence
    assert kept_sentence(folder) == found.sentence
    assert json.loads((folder / "run.json").read_text())["diagnosis"]["code"] == "process_killed"


def test_a_dry_run_and_a_lost_record(ended: Ended) -> None:
    run = ended(None, record_lost="no space left")
    assert diagnose_run(run).cause is Cause.RECORD_LOST
    run.info["record_lost"] = None
    run.config["dry_run"] = True
    assert diagnose_run(run).cause is Cause.DRY_RUN
