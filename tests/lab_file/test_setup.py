"""What flies where: an option beats the file, the file beats the defaults, and hardware needs a file."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from onboard.lab_file import LabFile, LabFileError
from onboard.policy.files import shipped_policy_path
from onboard.room import RoomGeometry
from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE
from perchhw.lab import (
    LabRequired,
    SetupError,
    correction_of,
    drones_of,
    find_lab,
    flight_setup,
    limits_of,
    on_this_machine,
    read_lab,
    require_lab,
)
from perchhw.supervisor import SafetyLimits
from tests.lab_file.labs import LAB

DRONE, MOCAP = "udp://127.0.0.1:19850?time=shm", "vicon://127.0.0.1:18801?subject=cf1"
RADIO = "radio://0/80/2M/E7E7E7E7E7"
SECOND = f'[[drones]]\nuri = "{RADIO}"\nvehicle = "crazyflie21-stock"\nlegs = "wide-long"\nsubject = "cf2"\n'
TRANSFORM = "\nsubject_to_body = { position = [0, 0, -0.02] }"


def lab_of(folder: Path, text: str = LAB) -> LabFile:
    path = folder / "lab.toml"
    path.write_text(text)
    return read_lab(path)


def test_the_file_gives_what_no_option_says(tmp_path: Path) -> None:
    lab = lab_of(tmp_path)
    setup = flight_setup(lab)
    assert (setup.drone, setup.mocap, setup.vehicle) == (DRONE, MOCAP, "crazyflie21-upgraded")
    assert (setup.legs, setup.policy) == (None, DEFAULT_POLICY)
    assert setup.room == lab.room.geometry()
    assert setup.lab is lab


def test_options_beat_the_file(tmp_path: Path) -> None:
    given = {
        "drone": "udp://127.0.0.1:1",
        "mocap": "vicon://127.0.0.1:2?subject=cf1",
        "vehicle": "crazyflie21-stock",
        "legs": "wide-long",
        "policy": "p",
    }
    lab = lab_of(tmp_path)
    setup = flight_setup(lab, ceiling=3.0, **given)
    assert {key: getattr(setup, key) for key in given} == given
    assert setup.room == replace(lab.room.geometry(), ceiling_z=3.0)


def test_without_file_and_option_it_is_the_simulated_room() -> None:
    setup = flight_setup(None, drone=DRONE, mocap=MOCAP)
    assert (setup.vehicle, setup.legs, setup.policy, setup.room) == (
        DEFAULT_VEHICLE,
        None,
        DEFAULT_POLICY,
        RoomGeometry(),
    )


@pytest.mark.parametrize("given", [{}, {"drone": DRONE}, {"mocap": MOCAP}])
def test_what_nobody_gives_is_named_with_the_remedy(given: dict[str, str]) -> None:
    missing = "mocap" if "drone" in given else "drone"
    with pytest.raises(SetupError, match=rf"^--{missing}: missing; .*--lab FILE, or lab\.toml"):
        flight_setup(None, **given)


@pytest.mark.parametrize("key", ["drone", "mocap", "vehicle", "legs", "policy"])
def test_what_is_empty_is_not_taken_for_what_is_usual(key: str) -> None:
    """A script's ``--policy "$POLICY"``."""
    given: dict[str, Any] = {"drone": DRONE, "mocap": MOCAP} | {key: ""}
    with pytest.raises(SetupError, match=f"^--{key}: is empty"):
        flight_setup(None, **given)


def test_each_drone_has_its_own(tmp_path: Path) -> None:
    lab = lab_of(tmp_path, LAB + SECOND)
    with pytest.raises(SetupError, match=r"--drone: .*has several; name one of .*E7E7E7E7E7"):
        flight_setup(lab)
    second = flight_setup(lab, drone=RADIO)
    assert (second.vehicle, second.legs) == ("crazyflie21-stock", "wide-long")
    assert second.mocap == "vicon://127.0.0.1:18801?subject=cf2"


def test_a_drone_that_the_file_does_not_have_is_not_taken_for_one_of_its_own(tmp_path: Path) -> None:
    lab = lab_of(tmp_path)
    with pytest.raises(
        SetupError, match=r"--vehicle: .*lab\.toml has no drone udp://127\.0\.0\.1:7, it has .*19850"
    ):
        flight_setup(lab, drone="udp://127.0.0.1:7")
    assert flight_setup(lab, drone="udp://127.0.0.1:7", vehicle="crazyflie21-stock").legs is None


def test_a_transform_is_not_used_for_another_subject(tmp_path: Path) -> None:
    lab = lab_of(tmp_path, LAB + TRANSFORM)
    assert flight_setup(lab, mocap="vicon-udp://:51001?subject=cf1").mocap.startswith("vicon-udp")
    with pytest.raises(SetupError, match=r"--mocap: subject_to_body of .* is that of cf1"):
        flight_setup(lab, mocap="vicon://127.0.0.1:18801?subject=cf3")


def test_names_of_files_are_relative_to_the_lab_file(tmp_path: Path) -> None:
    library = Path(__file__).parents[2] / "onboard" / "vehicle" / "library"
    (tmp_path / "mine.toml").write_text((library / "crazyflie21-stock.toml").read_text())
    lab = lab_of(tmp_path, LAB.replace('"crazyflie21-upgraded"', '"mine.toml"'))
    assert flight_setup(lab).vehicle == str(tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("udp://", "foo://", "drones[0].uri: 'foo://127.0.0.1:19850?time=shm' is not a drone address"),
        ('"crazyflie21-upgraded"', '"no-such"', "drones[0].vehicle: no-such: no such vehicle"),
        ('"crazyflie21-upgraded"', '"crazyflie21-stock"\nlegs = "x"', "drones[0].legs: legs: there is no"),
        ('"crazyflie21-upgraded"', '"crazyflie21-stock"\npolicy = "x"', "drones[0].policy: x: no such file"),
        ("vicon://", "optitrack://", "mocap.uri: mocap URI 'optitrack://"),
        ('subject = "cf1"', 'subject = "cf1"\n[limits]\nroom = 3', "limits.room: unknown key"),
    ],
)
def test_what_the_file_names_must_exist(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(LabFileError) as caught:
        lab_of(tmp_path, LAB.replace(old, new))
    assert str(caught.value).startswith(f"{tmp_path / 'lab.toml'}: {message}")


@pytest.mark.parametrize(
    ("policy", "problem"),
    [
        ("lab.toml", "is not JSON"),
        (".", "cannot be read"),
        ("half.policy.json", "is not JSON"),
        ("swept.json", "perchhw.policy/1"),
    ],
)
def test_a_policy_that_cannot_be_flown_is_told_with_the_lab(
    tmp_path: Path, policy: str, problem: str
) -> None:
    """And not in the evening, when the first flight is about to begin."""
    (tmp_path / "half.policy.json").write_text(shipped_policy_path().read_text()[:-100])
    (tmp_path / "swept.json").write_text('{"schema": "perchhw.sweep/1"}')
    line = f'"crazyflie21-upgraded"\npolicy = "{policy}"'
    with pytest.raises(LabFileError) as caught:
        lab_of(tmp_path, LAB.replace('"crazyflie21-upgraded"', line))
    said = str(caught.value)
    assert said.startswith(f"{tmp_path / 'lab.toml'}: drones[0].policy: ")
    assert problem in said


def test_a_policy_beside_the_lab_file_is_found(tmp_path: Path) -> None:
    (tmp_path / "mine.policy.json").write_text(shipped_policy_path().read_text())
    line = '"crazyflie21-upgraded"\npolicy = "mine.policy.json"'
    lab = lab_of(tmp_path, LAB.replace('"crazyflie21-upgraded"', line))
    assert flight_setup(lab).policy == str(tmp_path / "mine.policy.json")


def test_the_file_in_the_working_folder_counts_unless_another_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert find_lab(None) is None
    with pytest.raises(LabFileError, match=r"no lab\.toml in this folder; give --drone URI, or --lab FILE"):
        drones_of(None)
    lab = lab_of(tmp_path)
    assert find_lab(None) == lab
    assert drones_of(None) == [DRONE]
    other = tmp_path / "other.toml"
    other.write_text(LAB + SECOND)
    assert drones_of(other) == [DRONE, RADIO]
    found = find_lab(other)
    assert found is not None
    assert len(found.drones) == 2
    with pytest.raises(LabFileError, match=r"missing\.toml: cannot be read"):
        find_lab(tmp_path / "missing.toml")


@pytest.mark.parametrize(
    "uri",
    [
        RADIO,
        "usb://0",
        "udp://192.168.1.7:19850",
        "udp://drone.local:19850",
        "udp://0.0.0.0:19850",
        "vicon://192.168.1.10?subject=cf1",
        "vicon-udp://192.168.1.10:51001?subject=cf1",
        "motioncapture+optitrack://10.0.0.2?subject=cf1",
        "radio://127.0.0.1",
        "udp://",
        "udp://[::1",
        "nonsense",
        "",
    ],
)
def test_what_is_not_this_machine_needs_a_lab_file(uri: str, tmp_path: Path) -> None:
    assert not on_this_machine(uri)
    for pair in ((uri, MOCAP), (DRONE, uri)):
        with pytest.raises(LabRequired, match="nothing flies without a lab file"):
            require_lab(*pair, None)
        require_lab(*pair, lab_of(tmp_path))
        with pytest.raises(LabRequired, match="simulated lab describes no room"):
            require_lab(*pair, replace(lab_of(tmp_path), clock="127.0.0.1:40123"))


@pytest.mark.parametrize(
    "uri",
    [
        DRONE,
        MOCAP,
        "udp://localhost:1",
        "udp://[::1]:19850",
        "udp://127.9.9.9:1",
        "vicon-udp://:51001?subject=a",
    ],
)
def test_the_loopback_interface_is_the_simulation(uri: str) -> None:
    assert on_this_machine(uri)


def test_limits_mark_and_transform_reach_the_flight(tmp_path: Path) -> None:
    text = LAB + "latency_s = 0.012" + TRANSFORM + "\n[limits]\n"
    text += "battery_at_rest = 3.9\n"
    text += 'tilt_in_hover = { value = 20, unit = "deg", sigma = 0, source = "cautious" }\n'
    lab = lab_of(tmp_path, text)
    room = lab.room.geometry()
    assert limits_of(lab, room, DRONE) == SafetyLimits(
        room=room,
        battery_at_rest=3.9,
        tilt_in_hover=pytest.approx(math.radians(20.0)),
        start_mark=lab.room.start.pose,
    )
    assert limits_of(None, room, DRONE) == SafetyLimits(room=room)
    correction = correction_of(lab)
    assert (correction.position, correction.quaternion) == ((0.0, 0.0, -0.02), (0.0, 0.0, 0.0, 1.0))
    assert correction.latency == 0.012


@pytest.mark.parametrize("ceiling", [math.nan, math.inf, -2.0, 0.99, 4.01, 100.0])
def test_a_ceiling_that_is_none_is_refused_by_the_name_of_its_option(tmp_path: Path, ceiling: float) -> None:
    for lab in (None, lab_of(tmp_path)):
        with pytest.raises(SetupError, match=rf"^--ceiling: is {ceiling:g} m; .* 1 to 4 m"):
            flight_setup(lab, drone=DRONE, mocap=MOCAP, vehicle="crazyflie21-stock", ceiling=ceiling)


def test_a_lower_ceiling_must_stay_above_the_floor_where_it_tilts(tmp_path: Path) -> None:
    text = LAB.replace("x_min = -3.0", "x_min = -40.0").replace("tilt_x_deg = 1.0", "tilt_x_deg = 2.0")
    lab = lab_of(tmp_path, text)
    with pytest.raises(SetupError, match=r"^--ceiling: comes down to -0\.39"):
        flight_setup(lab, ceiling=1.0)
    assert flight_setup(lab, ceiling=1.5).room.ceiling_z == 1.5
