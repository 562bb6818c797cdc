"""Who flies take-off, hover and level-out: what the lab file says is set on the drone, and read back."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from onboard.app_interface import Parameter
from onboard.errors import PerchhwError
from onboard.lab_file import LabFile
from perchhw.flight import fly_attempt
from perchhw.flight.course import CourseRequest, fly_course
from perchhw.flight.readback import OWN_LAW, ReadBack
from perchhw.lab import read_lab
from tests.flight.unflown import REQUEST
from tests.link.tiny_drone import TinyDrone
from tests.patience import patient_link


def lab_of(uri: str, folder: Path, line: str) -> LabFile:
    file = folder / "lab.toml"
    file.write_text(
        'schema = "perchhw.lab/1"\n'
        "[room]\nx_min = -4.0\nx_max = 1.5\ny_min = -1.0\ny_max = 1.0\n"
        "ceiling = { height = 2.1 }\nstart = { x = -2.5, y = 0.0 }\n"
        f'[[drones]]\nuri = "{uri}"\nvehicle = "crazyflie21-upgraded"\n{line}\n'
        '[mocap]\nuri = "vicon://127.0.0.1:9"\nsubject = "cf1"\n'
    )
    return read_lab(file)


def attempt(drone: str, lab: LabFile, folder: Path) -> None:
    fly_attempt(replace(REQUEST, drone=drone, lab=lab, folder=folder))


def course(drone: str, lab: LabFile, folder: Path) -> None:
    fly_course(
        CourseRequest(
            kind="long_discharge",
            folder=folder,
            drone=drone,
            mocap=REQUEST.mocap,
            vehicle=REQUEST.vehicle,
            lab=lab,
        )
    )


@pytest.mark.parametrize("fly", [attempt, course])
@pytest.mark.parametrize(("line", "told"), [("", 0), ("own_law = false", 0), ("own_law = true", 1)])
def test_the_drone_is_told_who_flies(
    line: str, told: int, fly: Callable[[str, LabFile, Path], None], tmp_path: Path
) -> None:
    """No flight begins here, on a drone that has not even the log variables for one."""
    with TinyDrone() as drone:
        lab = lab_of(drone.uri, tmp_path, line)
        with pytest.raises(PerchhwError):
            fly(drone.uri, lab, tmp_path / "run")
        assert drone.values[Parameter.OWN_LAW] == told


def test_a_drone_that_keeps_its_pid_is_not_flown_as_ours() -> None:
    with TinyDrone() as drone, patient_link(drone.uri) as link:
        readback = ReadBack()
        readback.check_settings(link, OWN_LAW)
        assert readback.parameters_problem == "perch.ownLaw is 0, need 1"
