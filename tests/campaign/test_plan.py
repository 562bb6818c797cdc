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
        ("[2.0, 2.5]", "[200, 250]", "key grid.speeds: 200 is not among positive speeds below 10 m/s. That"),
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
