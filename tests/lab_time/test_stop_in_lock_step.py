"""An emergency stop in a lab that waits for those who take part: neither waits for the other."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from signal import SIGINT

import pytest

from onboard.lab_time import open_timebase, time_address
from onboard.lab_time.figures import lab_figures
from onboard.link import DroneLink
from onboard.link.stop import SILENT_S
from onboard.supervisor_info import SupervisorInfo
from perchhw.lab_process import FREE_PORTS, SimulatedLab

pytestmark = pytest.mark.slow
IN_LOCK_STEP = (*FREE_PORTS, "--seed", "5", "--pace", "lockstep")


@pytest.fixture(scope="module")
def lab() -> Iterator[SimulatedLab]:
    with SimulatedLab("lab", IN_LOCK_STEP) as lab:
        yield lab


def bits_of(drone: str) -> SupervisorInfo:
    with open_timebase("witness", drone) as time, DroneLink.open(drone, clock=time) as link:
        return link.supervisor_info()


@pytest.mark.parametrize(
    "fault", ["drone_dies_at=0.5", pytest.param("freeze_drone_at=0.5", marks=pytest.mark.further)]
)
def test_the_stop_of_a_silent_drone_gives_up_in_the_labs_time_which_goes_on(fault: str) -> None:
    with SimulatedLab("lab", (*IN_LOCK_STEP, "--fault", fault)) as lab:
        drone = lab.drones[0]
        with open_timebase("test", drone) as time, DroneLink.open(drone, clock=time) as link:
            pause = time.event()
            while link.lost is None:
                assert time() < 20.0
                pause.wait(0.1)
            link.stop_path.trigger()
            report = link.stop_path.wait(10.0)
            assert report is not None
            assert not report.locked
            assert "has said nothing for 3 s" in report.reason
            assert SILENT_S <= report.seconds < SILENT_S + 0.2
            began = time()
            pause.wait(1.0)  # nothing that the lost link has left behind holds the time
            assert time() == pytest.approx(began + 1.0, abs=0.01)
        address = time_address(drone)
        assert address is not None
        assert lab_figures(address)["takes_part"] == []


def test_two_keys_before_the_drone_was_asked_to_arm_do_not_lock_it(lab: SimulatedLab, tmp_path: Path) -> None:
    options = ("--drone", lab.drones[0], "--mocap", lab.mocap[0], "--out", str(tmp_path))
    with subprocess.Popen(
        [sys.executable, "-m", "perchhw", "fly", "--speed", "2.5", "--angle", "50", *options],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    ) as flight:
        assert flight.stderr is not None
        assert "checking" in flight.stderr.readline()
        for _ in range(2):
            flight.send_signal(SIGINT)
        flight.communicate()
    assert flight.returncode == 130
    assert not bits_of(lab.drones[0]).is_locked


def test_a_stop_that_is_under_way_as_the_link_closes_is_confirmed(lab: SimulatedLab) -> None:
    """Who closes waits for the stop, and the stop for the drone: neither may hold the lab's time."""
    drone = lab.drones[0]
    with open_timebase("test", drone) as time:
        with DroneLink.open(drone, clock=time) as link:
            link.stop_path.trigger()
        report = link.stop_path.report
    assert report is not None
    assert report.locked
    assert report.seconds < 0.5
    assert bits_of(drone).is_locked
