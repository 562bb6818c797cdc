"""Rows for every width: nothing wider than the terminal, and prompt, alert and keys always among them."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console, Group

from perchhw.screen.layout import rows
from perchhw.screen.snapshot import Snapshot
from perchhw.screen.watch import PLAN
from perchhw.supervisor import Phase

FLYING = Snapshot(
    title="campaign legs-nl",
    drone="udp://127.0.0.1:19850",
    attempt=3,
    attempts=24,
    condition="2.5 m/s, 50 deg",
    phases=("checking", "uploading", "ready", "arming", "taking off"),
    planned=tuple(phase.value for phase in PLAN),
    in_phase_s=1.23,
    waiting_for="the first hover",
    battery_v=3.92,
    telemetry_hz=99.6,
    silence_s=0.008,
    mocap="OK",
    mocap_hz=100.0,
    mocap_age_s=0.011,
    estimate_to_mocap_m=0.012,
    tau_s=0.512,
    policy_crc=0x1A2B3C4D,
    outcomes=(("four_leg", 1), ("failure", 1)),
    time_left_s=700.0,
    packs_left=2,
    flying=True,
)
ASKED = FLYING.with_changes(question="Put it on its mark", question_number=1, alert="STOP NOT CONFIRMED")
TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=["C", "M"]), max_size=200)


def plain(snapshot: Snapshot, width: int = 80, height: int = 24, typed: str = "") -> list[str]:
    return [row.plain.rstrip() for row in rows(snapshot, typed, width, height)]


@given(
    width=st.integers(1, 250),
    height=st.integers(1, 60),
    ascii_only=st.booleans(),
    snapshot=st.builds(
        Snapshot,
        title=TEXTS,
        condition=TEXTS,
        waiting_for=TEXTS,
        phases=st.lists(st.sampled_from([p.value for p in Phase]), unique=True).map(tuple),
        planned=st.just(FLYING.planned),
        alert=st.none() | TEXTS,
        question=st.none() | TEXTS,
        wants_words=st.booleans(),
        battery_v=st.none() | st.floats(),
        tau_s=st.none() | st.floats(),
        silence_s=st.none() | st.floats(0.0, 1e9),
        messages=st.lists(TEXTS, max_size=3).map(tuple),
        attempts=st.none() | st.integers(1, 999),
    ),
    typed=TEXTS,
)
def test_nothing_is_larger_than_the_terminal(
    width: int, height: int, ascii_only: bool, snapshot: Snapshot, typed: str
) -> None:
    shown = rows(snapshot, typed, width, height, ascii_only)
    assert len(shown) <= height
    assert all(row.cell_len <= width for row in shown)
    assert not ascii_only or all(row.plain.isascii() for row in shown)


@pytest.mark.parametrize("width", [40, 80, 120])
def test_everything_that_is_known_is_on_it(width: int) -> None:
    text = "\n".join(plain(FLYING, width))
    for shown in (
        *("campaign legs-nl", "3 of 24", "taking off, 1.2 s: waits for the", "3.92 V", "100 Hz, silent 8 ms"),
        *("100 Hz, age 11 ms, OK", "1.2 cm", "0.512 s", "1a2b3c4d", "four_leg 1", "22 attempts"),
    ):
        assert shown in text, shown
    if width > 40:
        assert "about 12 min, 2 new packs" in text


def test_where_not_all_phases_fit_the_present_one_and_the_next_have_their_names() -> None:
    assert plain(FLYING, 160)[1].startswith("● check ● upload ● ready ● arm ▶ take-off ○ to start")
    bar = plain(FLYING, 80)[1]
    assert bar.startswith("● ● ● ● ▶ take-off ○ to start ○ arm approach")
    assert bar.endswith("settle ○")
    narrow = plain(FLYING, 40)[1]
    assert narrow.startswith("● ● ● ● ▶ take-off ○")
    assert narrow.count("○") == bar.count("○")


def test_before_the_first_attempt_none_has_a_number() -> None:
    assert plain(FLYING.with_changes(attempt=None))[0].endswith(" 2.5 m/s, 50 deg")
    assert "attempt 3 of 24, 2.5 m/s" in plain(FLYING)[0]


def test_one_is_no_plural() -> None:
    last = FLYING.with_changes(attempts=3, packs_left=1)
    assert "1 attempt, about 12 min, 1 new pack" in "\n".join(plain(last))


def test_where_it_is_seen_fits_and_stays_among_messages() -> None:
    view = "view: http://127.0.0.1:9090/"
    assert view in plain(FLYING.with_changes(view=view, messages=("one", "two", "three")), 40)


@pytest.mark.parametrize("width", [40, 80, 120])
def test_what_is_asked_changes_no_other_row(width: int) -> None:
    """The prompt has a place of its own, and the rows above stand where they stood."""
    quiet, asked = plain(FLYING, width), plain(ASKED.with_changes(alert=None), width)
    assert quiet[-3:-1] == ["", ""]
    assert asked[-3].startswith("Put it on its mark")
    assert asked[:-3] == quiet[:-3]


def test_on_six_rows_alert_prompt_and_keys_are_left() -> None:
    shown = plain(ASKED, 60, 6)
    assert any("STOP NOT CONFIRMED" in row for row in shown)
    assert any("Put it on its mark" in row for row in shown)
    assert "space" in shown[-1]


def test_a_way_out_is_no_longer_the_plan() -> None:
    landing = FLYING.with_changes(phases=(*FLYING.phases, "landing"), aborted_by="pose_age: 0.31 s")
    shown = plain(landing, 120)
    assert shown[1].endswith("▶ land")
    assert shown[2].endswith("ended by pose_age: 0.31 s")


def test_a_command_that_flies_nothing_shows_its_stages_and_the_one_key_that_ends_it() -> None:
    stages = ("connecting", "uploading", "approaching", "reading")
    shown = plain(
        Snapshot(
            title="rehearse", on_desk=True, phases=stages[:2], planned=stages, waiting_for="the read-back"
        )
    )
    assert shown[1] == "● connecting ▶ upload ○ approach ○ reading"
    assert shown[2] == "uploading: waits for the read-back"
    assert shown[-1] == " space  stop now"
    assert not any("battery" in row for row in shown)


def test_words_are_shown_as_they_are_typed() -> None:
    note = FLYING.with_changes(question="Note on landing:", question_number=1, wants_words=True)
    shown = plain(note, typed="left leg")
    assert "Note on landing: left leg_" in shown
    assert shown[-1] == " Enter  keep   Esc  leave it empty"


def test_what_is_sent_is_what_was_meant() -> None:
    assert Snapshot.from_line(ASKED.to_line()) == ASKED
    assert Snapshot.from_line(FLYING.with_changes(tau_s=float("inf")).to_line()).tau_s is None


@pytest.mark.parametrize(("environment", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False)])
def test_colour_is_left_out_where_nobody_wants_it(environment: dict[str, str], coloured: bool) -> None:
    stream = io.StringIO()
    size = {"TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24", **environment}
    console = Console(file=stream, force_terminal=True, _environ=size, width=80, height=24)
    console.print(Group(*rows(ASKED, "", 80, 24)))
    assert ("\x1b[32m" in stream.getvalue()) == coloured


def test_a_long_message_is_said_to_its_end() -> None:
    words = "The drone is locked, as after every flight and every stop. Put it upright on its start mark"
    shown = [row.plain for row in rows(Snapshot(title="fly", drone="cf1", messages=(words,)), "", 80, 24)]
    assert " ".join(" ".join(shown).split()).count(words) == 1
    assert max(map(len, shown)) <= 80


def test_only_a_campaign_offers_a_pause() -> None:
    assert "p  pause after attempt" in plain(FLYING, 120)[-1]
    assert "pause" not in plain(FLYING.with_changes(attempts=None), 120)[-1]
