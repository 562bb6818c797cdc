"""Campaign files: what they mean, and errors that name file and key."""

from pathlib import Path

import pytest

from onboard.room import RoomGeometry
from perchhw.campaign import CampaignFileError, load_plan


def test_defaults_and_order(campaign_file: Path) -> None:
    plan = load_plan(campaign_file)
    assert (plan.name, plan.policy, plan.vehicle, plan.legs) == (
        "small",
        "default",
        "crazyflie21-upgraded",
        None,
    )
    assert plan.angles_deg == (40.0, 60.0)
    assert plan.room == RoomGeometry()
    shuffled = plan.slots()
    assert shuffled == load_plan(campaign_file).slots()
    campaign_file.write_text('order = "grid"\n' + campaign_file.read_text())
    grid = load_plan(campaign_file).slots()
    assert [(s.speed, s.angle_deg, s.repeat) for s in grid[:3]] == [
        (2.0, 40.0, 1),
        (2.0, 60.0, 1),
        (2.5, 40.0, 1),
    ]
    conditions = {(s.speed, s.angle_deg, s.repeat) for s in shuffled}
    assert conditions == {(s.speed, s.angle_deg, s.repeat) for s in grid}
    assert [(s.speed, s.angle_deg, s.repeat) for s in shuffled] != [
        (s.speed, s.angle_deg, s.repeat) for s in grid
    ]


def test_a_range_includes_both_ends(campaign_file: Path) -> None:
    campaign_file.write_text(campaign_file.read_text().replace("[2.0, 2.5]", '"1.5:3.5:0.1"'))
    speeds = load_plan(campaign_file).speeds
    assert len(speeds) == 21
    assert (speeds[0], speeds[7], speeds[-1]) == (1.5, 2.2, 3.5)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seed = 7", "seeds = 7", "key seeds: unknown; known are "),
        ("seed = 7", "seed = 7.5", "key seed: 7.5 is not a whole number"),
        ("seed = 7", "seed = -1", "key seed: -1 is less than 0"),
        ("seed = 7", "seed = true", "key seed: True is not a whole number"),
        ("seed = 7", 'order = "random"', "key order: 'random' is not one of shuffled, grid"),
        ("[2.0, 2.5]", "[2.0, -2.5]", "key grid.speeds: -2.5 is not among positive speeds"),
        ("[2.0, 2.5]", "[2.0, 2.0]", "key grid.speeds: a value stands twice"),
        ("[2.0, 2.5]", "[]", "key grid.speeds: empty"),
        ("[2.0, 2.5]", "2.0", "key grid.speeds: 2.0 is not a list"),
        ('"40:60:20"', '"40:60"', "key grid.angles_deg: '40:60' is not a range"),
        ('"40:60:20"', '"60:40:5"', "key grid.angles_deg: '60:40:5' needs first <= last"),
        (
            '"40:60:20"',
            '"40:60:0.001"',
            "key grid.angles_deg: '40:60:0.001' are 20001 values, more than 1000",
        ),
        ("repeats = 2", "repeats = 2501", "key grid.repeats: 10004 attempts in all, more than 10000"),
        ('"40:60:20"', "[95]", "key grid.angles_deg: 95 is not among angles above 1.57 and up to 90"),
        ('"40:60:20"', "[0.87, 1.05]", "90 deg. That looks like radians; write degrees (49.85)"),
        (
            "[2.0, 2.5]",
            "[200, 250]",
            "key grid.speeds: 200, 250 are not among positive speeds below 10 m/s. That",
        ),
        ("repeats = 2", "repeats = 0", "key grid.repeats: 0 is less than 1"),
        ("repeats = 2", "repeat = 2", "key grid.repeat: unknown; known are angles_deg, repeats, speeds"),
        ("repeats = 2", "[room]\nceiling = 2", "key room.ceiling: unknown; known are ceiling_z"),
        ("repeats = 2", "[room]\nceiling_z = -2", "key room.ceiling_z: -2 is not a height"),
        ("repeats = 2", "[approach]\ntau = 0.5", "key approach.tau: unknown; known are ax, az, impact_x"),
        ("repeats = 2", "[stop]\naborted_in_a_row = 0", "key stop.aborted_in_a_row: 0 is less than 1"),
        ("campaign/1", "campaign/9", 'key schema: is "perchhw.campaign/9", newer'),
        ('drone = "udp://127.0.0.1:19850"', "", "key drone: missing; give it, or a lab file that has it"),
        (
            "udp://127",
            "foo://127",
            "key drone: 'foo://127.0.0.1:19850' is not a drone address; the known schemes",
        ),
        ("udp://127.0.0.1:19850", "udp:/nonsense", "key drone: 'udp:/nonsense' is not a drone address"),
        (
            "vicon://",
            "optitrack://",
            "key mocap: mocap URI 'optitrack://127.0.0.1:18801?subject=cf1': unknown",
        ),
        ("seed = 7", 'policy = "no-such"', "key policy: no-such: no such file, and no shipped policy"),
        ("seed = 7", 'policy = "pyproject.toml"', "key policy: pyproject.toml"),
        ("seed = 7", 'vehicle = "no-such"', "key vehicle: "),
        ("seed = 7", 'legs = "no-such"', "key legs: "),
        ("[grid]", "[grid", "not valid TOML"),
    ],
)
def test_errors_name_file_and_key(campaign_file: Path, old: str, new: str, message: str) -> None:
    campaign_file.write_text(campaign_file.read_text().replace(old, new))
    with pytest.raises(CampaignFileError) as caught:
        load_plan(campaign_file)
    assert str(campaign_file) in str(caught.value)
    assert message in str(caught.value)


WRONG = [
    ("drone", "'udp:/nonsense' is not a drone address; the known schemes"),
    ("mocap", "missing; give it, or a lab file that has it"),
    ("seed", "-1 is less than 0"),
    ("order", "'random' is not one of shuffled, grid, adaptive"),
    ("grid.speeds", "200, -1, 'fast', 300 and 1 more are not among positive speeds below 10 m/s. That looks"),
    ("grid.angles_deg", "'40:60:0' needs first <= last and a step above 0"),
    ("grid.repeats", "0 is less than 1"),
    ("room.ceiling_z", "'high' is not a number"),
    ("approach.ax", "inf is not finite"),
    ("approach.az", "missing; give all of ax, az, tau0"),
    ("stop.attempts", "True is not a whole number"),
    ("stop.aborts.link", "-1 is less than 0"),
    ("sed", "unknown; known are"),
    ("policy", "no-such: no such file"),
    ("day.warm_up_s", "long_discharge: seconds = 1 (s) must be 5 to 600"),
]


def test_all_that_is_wrong_is_told_at_once(campaign_file: Path) -> None:
    campaign_file.write_text(
        """schema = "perchhw.campaign/1"
drone = "udp:/nonsense"
policy = "no-such"
order = "random"
seed = -1
sed = 1

[grid]
speeds = [2.0, 200, -1, "fast", 300, 400]
angles_deg = "40:60:0"
repeats = 0

[room]
ceiling_z = "high"

[approach]
ax = inf

[stop]
attempts = true
aborts = { link = -1 }

[day]
warm_up_s = 1
"""
    )
    with pytest.raises(CampaignFileError) as caught:
        load_plan(campaign_file)
    told = str(caught.value).splitlines()
    assert all(line.startswith(f"{campaign_file}: key ") for line in told)
    for line, (key, problem) in zip(told, WRONG, strict=True):
        assert line.startswith(f"{campaign_file}: key {key}: {problem}")


def test_a_number_of_more_digits_than_a_float_has_room_for_is_refused(campaign_file: Path) -> None:
    campaign_file.write_text(
        campaign_file.read_text().replace("repeats = 2", f"[room]\nceiling_z = {10**400}")
    )
    with pytest.raises(CampaignFileError, match=r"key room\.ceiling_z: inf is not finite"):
        load_plan(campaign_file)


def test_a_table_that_is_none_is_told_once(campaign_file: Path) -> None:
    text = campaign_file.read_text()
    campaign_file.write_text(text[: text.index("[grid]")])
    with pytest.raises(CampaignFileError) as caught:
        load_plan(campaign_file)
    assert str(caught.value) == f"{campaign_file}: key grid: missing; expected a table"
