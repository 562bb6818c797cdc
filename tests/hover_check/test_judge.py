"""The same drone or not: file, days, and what is kept."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from calibration.measurement import Estimate
from onboard.json_file import as_json
from perchhw.cli.check import as_table, in_digits
from perchhw.cli.check import in_words as check_in_words
from perchhw.diagnosis.busy import too_busy_for_poses
from perchhw.hover_check.check import HoverCheck
from perchhw.hover_check.expected import expected
from perchhw.hover_check.history import History, HistoryError
from perchhw.hover_check.judge import LineVerdict, against_days, in_words, judge
from perchhw.hover_check.quantities import HELD
from tests.hover_check.numbers import VEHICLE

BY_NAME = {held.what: held for held in HELD}
ROOM = "vicon://192.168.1.10?subject=cf1"
MORNING = datetime(2026, 11, 23, 7, tzinfo=UTC)


def day(rng: np.random.Generator, **changed: float) -> dict[str, float]:
    """A morning's figures of a drone that is as its file says, but for `changed`."""
    truth = {held.what: 0.0 for held in HELD} | {k: e.value for k, e in expected(VEHICLE).items()}
    truth |= {"mocap_rate": 100.0, **changed}
    return {
        held.what: truth[held.what]
        + held.repeats * (abs(truth[held.what]) if held.relative else 1.0) * rng.standard_normal()
        for held in HELD
    }


def measured(values: dict[str, float]) -> dict[str, Estimate]:
    return {what: Estimate(value, "1", 0.1 * BY_NAME[what].repeats) for what, value in values.items()}


def changes(values: dict[str, float], before: list[dict[str, float]]) -> list[str]:
    lines = judge(measured(values), expected(VEHICLE), before)
    return [line.held.what for line in lines if line.verdict is LineVerdict.CHANGED]


@pytest.mark.parametrize(
    ("value", "u95", "shown"),
    [
        (99.78, 1.4, "99.8 ± 1.4"),
        (101.2, 23.0, "101 ± 23"),
        (-6.364e-05, 0.0038, "0.0001 ± 0.0038"),
        (100.0, 0.0, "100 ± 0"),
    ],
)
def test_a_figure_has_the_digits_that_its_uncertainty_allows(value: float, u95: float, shown: str) -> None:
    assert in_digits(value, u95).removeprefix("-") == shown


def test_the_lines_are_a_table() -> None:
    rng = np.random.default_rng(7)
    lines = judge(measured(day(rng, thrust=1.4)), expected(VEHICLE), [day(rng), day(rng)])
    rows = as_table(lines)
    head = rows[0]
    for line in lines:
        row = next(row for row in rows if line.held.what in row.split())
        assert row.index(line.held.what) == head.index("what")
        assert row.endswith("of 2")
        assert row[head.index("days before") - 1] == " " != row[head.index("days before")]
    below = rows[1 + next(k for k, row in enumerate(rows) if row.startswith("changed"))]
    assert below.startswith(" " * head.index("what"))


def test_a_drone_that_repeats_as_it_does_is_rarely_accused_and_a_changed_one_is_named() -> None:
    rng = np.random.default_rng(11)
    accused = mornings = 0
    for _ in range(40):
        before: list[dict[str, float]] = []
        for _ in range(6):
            today = day(rng)
            if before:
                mornings += 1
                accused += bool(changes(today, before))
            before.append(today)
        assert "thrust" in changes(day(rng, thrust=1.09), before)
        assert "battery_resistance" in changes(day(rng, battery_resistance=0.46), before)
        assert "mocap_latency" in changes(day(rng, mocap_latency=0.03), before)
    assert mornings == 200
    assert accused <= 12  # 21 lines, 0.27 % each on either side


def test_less_vibration_is_no_change_and_more_is() -> None:
    before = [{"vibration_gyro": 0.01}] * 4
    assert changes({"vibration_gyro": 0.001}, before) == []
    assert changes({"vibration_gyro": 0.02}, before) == ["vibration_gyro"]


def test_limits_follow_the_drones_own_scatter_once_there_are_many_days() -> None:
    held = BY_NAME["thrust"]
    rng = np.random.default_rng(2)
    few, many = against_days(held, np.array([1.0])), against_days(held, 1.0 + 0.002 * rng.standard_normal(80))
    assert few.high - 1.0 > 0.05
    assert 0.006 < many.high - 1.0 < 0.02


def test_against_the_file_alone() -> None:
    lines = judge(measured({"motor_2": 1.18, "thrust": 1.03}), expected(VEHICLE), [])
    assert [(line.held.what, line.verdict) for line in lines] == [
        ("thrust", LineVerdict.SAME),
        ("motor_2", LineVerdict.OFF_FILE),
    ]
    assert "motor_2" in in_words(lines, None)
    assert "tachometer" in as_json(lines[1])["settles"]
    assert "but not as its vehicle file says" in in_words(lines, "yesterday")


def test_what_a_busy_computer_makes_late_is_not_blamed_on_motion_capture() -> None:
    late = {"mocap_jitter": 0.06, "mocap_age": 0.08, "mocap_latency": 0.05}
    busy = "its load was 17 on 2 processors"
    calm = judge(measured(late), expected(VEHICLE), [])
    assert {line.settles for line in calm} == {BY_NAME["mocap_age"].settles}
    lines = judge(measured(late), expected(VEHICLE), [], busy)
    for line in lines:
        assert str(line.settles).startswith(f"{busy}; end other programs on this computer")
        assert str(line.settles).endswith(f"else {line.held.settles}")
    assert in_words(lines, "yesterday") == (
        f"not to be judged, {busy}: mocap_age, mocap_jitter, mocap_latency"
    )
    # What no computer makes wrong is said as ever.
    both = judge(measured({**late, "motor_2": 1.18}), expected(VEHICLE), [], busy)
    assert both[0].settles == BY_NAME["motor_2"].settles
    assert "motor_2" in in_words(both, None)
    assert "not to be judged" not in in_words(both, None)


def keep(
    history: History,
    values: dict[str, float],
    number: int,
    *,
    begins_anew: bool = False,
    busy: str | None = None,
) -> None:
    before = () if begins_anew else history.before()
    lines = judge(measured(values), expected(VEHICLE), [one.values for one in before])
    history.keep(MORNING + timedelta(days=number), Path("run"), lines, begins_anew=begins_anew, busy=busy)


def test_a_changed_day_does_not_count_until_it_is_meant(tmp_path: Path) -> None:
    history = History.of(tmp_path, "radio://0/80/2M/E7E7E7E7E7", ROOM, VEHICLE)
    for number in range(3):
        keep(history, {"thrust": 1.0}, number)
    keep(history, {"thrust": 1.2}, 3)
    assert [one.values["thrust"] for one in history.before()] == [1.0] * 3
    keep(history, {"thrust": 1.2}, 4, begins_anew=True)
    keep(history, {"thrust": 1.21}, 5)
    assert [one.values["thrust"] for one in history.before()] == [1.2, 1.21]
    assert History.of(tmp_path, "radio://0/90/2M/E7E7E7E7E7", ROOM, VEHICLE).before() == ()
    lighter = replace(VEHICLE, body=replace(VEHICLE.body, mass=replace(VEHICLE.body.mass, value=0.03)))
    assert History.of(tmp_path, "radio://0/80/2M/E7E7E7E7E7", ROOM, lighter).before() == ()


def test_a_day_on_a_busy_computer_does_not_count(tmp_path: Path) -> None:
    history = History.of(tmp_path, "radio://0/80/2M/E7E7E7E7E7", ROOM, VEHICLE)
    keep(history, {"mocap_jitter": 0.001}, 0)
    keep(history, {"mocap_jitter": 0.004}, 1, busy="this computer was too busy: it was late by 40 ms")
    assert [one.values for one in history.before()] == [{"mocap_jitter": 0.001}]
    (file, _) = sorted(history.folder.iterdir())
    file.write_text(file.read_text().replace('"busy"', '"of_old"'), encoding="utf-8")
    assert len(history.before()) == 1


@pytest.mark.parametrize(
    ("host", "said"),
    [
        ({"cpus": 2, "load": 1.0, "late_s": 0.0026}, None),
        ({"cpus": 2, "load": 1.0, "late_s": 0.0525}, "the flight's program was late by 52 ms"),
        ({"cpus": 2, "load": 17.0, "late_s": 0.0026}, None),  # who waits may be nobody of ours
        ({"cpus": 2, "load": 17.0}, "its load was 17 on 2 processors"),  # a record of before it was measured
    ],
)
def test_a_busy_computer_is_known_by_what_waited_for_it(host: dict[str, float], said: str | None) -> None:
    words = too_busy_for_poses({"drone_clock_rate": 1.0, "host": host})
    assert words == (None if said is None else f"this computer was too busy: {said}")


def test_who_checks_on_a_busy_computer_is_told_that_the_day_does_not_count() -> None:
    busy = "this computer was too busy: the flight's program was late by 32 ms"
    for measured_today, why in (({"thrust": 1.0}, f"{busy}; "), ({"mocap_jitter": 0.06}, "")):
        lines = judge(measured(measured_today), expected(VEHICLE), [], busy)
        check = HoverCheck(
            lines=lines, rotors=(), since=None, checks=0, record=Path("run"), kept=Path("kept"), busy=busy
        )
        told = check_in_words(check)
        assert f"\n{why}this check is none of the days that later ones are held against\n" in told
        assert "none of the days" not in check_in_words(replace(check, busy=None))
    assert as_json(check)["busy"] == busy


@pytest.mark.parametrize("text", ["", "[]", '{"schema": "perchhw.hover_check/0"}', '{"values": 3}'])
def test_a_damaged_day_is_named(text: str, tmp_path: Path) -> None:
    simulated = "udp://127.0.0.1:19850?time=127.0.0.1:5", "vicon://127.0.0.1:18801?subject=cf1"
    history = History.of(tmp_path, *simulated, VEHICLE)
    assert history.folder.name == "simulated-cf1"
    keep(history, {"thrust": 1.0}, 0)
    file = history.folder / "20261124T000000.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(HistoryError, match=r"20261124T000000\.json: is no check that can be read"):
        history.before()
