"""``perchhw://``: cflib against a drone in its own process, at no pace but the test's."""

import itertools
import json
import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

from onboard.link.errors import LinkInputError
from onboard.link.in_process import InProcessDriver, serve_in_process, stop_serving
from perchhw.testing import LabInputError, LabWaitTimeout, SimulatedDrone
from perchhw.testing.instant import InstantLab
from tests.patience import PATIENCE_S, until

pytest_plugins = ["pytester"]


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[InstantLab]:
    cflib.crtp.init_drivers()
    lab = InstantLab(tmp_path / "lab")
    yield lab
    lab.close()


def connected(drone: SimulatedDrone, folder: Path) -> SyncCrazyflie:
    return SyncCrazyflie(drone.uri, cf=Crazyflie(rw_cache=str(folder / "cache")))


def take_off(lab: InstantLab, drone: SimulatedDrone, cf: Crazyflie) -> None:
    lab.wait_until(lambda: drone.ready, within=10.0)
    cf.supervisor.send_arming_request(True)
    lab.wait_until(lambda: drone.armed, within=1.0)
    lab.run_for(0.2)
    cf.high_level_commander.takeoff(0.6, 1.5)
    lab.run_for(2.0)


def flight(folder: Path) -> tuple[str, list[tuple[int, float]]]:
    """The truth of a flight, and what cflib logged of it."""
    lab = InstantLab(folder, seed=3)
    drone, seen = lab.drones[0], []
    config = LogConfig("z", period_in_ms=20)
    config.add_variable("stateEstimate.z", "float")
    config.data_received_cb.add_callback(lambda t, values, _: seen.append((t, values["stateEstimate.z"])))
    with connected(drone, folder) as scf:
        scf.cf.log.add_config(config)
        config.start()
        take_off(lab, drone, scf.cf)
        lab.shift_poses(x=0.1)
        lab.run_for(0.5)
        scf.cf.high_level_commander.land(0.0, 1.5)
        lab.run_for(2.0)
    lab.close()
    return (folder / "truth.csv").read_text(), seen


def test_a_whole_flight_is_the_same_to_the_last_bit(tmp_path: Path) -> None:
    cflib.crtp.init_drivers()
    first, second = flight(tmp_path / "1"), flight(tmp_path / "2")
    assert first == second
    heights = [float(line.split(",")[4]) for line in first[0].splitlines()[1:]]
    assert max(heights) == pytest.approx(0.6, abs=0.03)
    assert heights[-1] < 0.1
    assert len(first[1]) > 200
    assert {b[0] - a[0] for a, b in itertools.pairwise(first[1])} == {20}


def test_time_stands_still_but_for_the_test(lab: InstantLab, tmp_path: Path) -> None:
    with connected(lab.drones[0], tmp_path) as scf:
        assert lab.time == 0.0
        assert len(scf.cf.log.toc.toc["stateEstimate"]) > 10
        lab.run_for(1.5)
        assert lab.time == pytest.approx(1.5)


def test_a_callback_acts_at_the_time_of_its_packet(lab: InstantLab, tmp_path: Path) -> None:
    times: list[tuple[float, int]] = []
    config = LogConfig("x", period_in_ms=50)
    config.add_variable("stateEstimate.x", "float")
    config.data_received_cb.add_callback(lambda t, _values, _c: times.append((lab.time, t)))
    with connected(lab.drones[0], tmp_path) as scf:
        scf.cf.log.add_config(config)
        config.start()
        lab.run_for(1.0)
        assert len(times) >= 19
        assert all(round(1000.0 * at) == t for at, t in times)


def test_parameters_are_written_and_read(lab: InstantLab, tmp_path: Path) -> None:
    with connected(lab.drones[0], tmp_path) as scf:
        scf.wait_for_params()
        scf.cf.param.set_value("ring.effect", "9")
        until(lambda: scf.cf.param.get_value("ring.effect") == "9")


def test_motion_capture_that_is_lost_and_a_brown_out_in_the_air(lab: InstantLab, tmp_path: Path) -> None:
    drone = lab.drones[0]
    with connected(drone, tmp_path) as scf:
        take_off(lab, drone, scf.cf)
        hovered = drone.position
        lab.stop_poses()
        lab.run_for(0.3)
        assert math.dist(drone.position, hovered) < 0.1
        drone.brown_out(0.5)
        lab.run_for(0.4)
        assert not drone.powered
        lab.run_for(0.2)
        assert drone.powered
        assert drone.boots == 2
        lab.run_for(1.0)
        assert drone.position[2] < 0.1
    events = [json.loads(line)["event"] for line in (lab.folder / "events.jsonl").read_text().splitlines()]
    assert events == ["poses", "brown_out"]


def test_a_drone_that_crashes_finds_itself_tumbled(lab: InstantLab, tmp_path: Path) -> None:
    drone = lab.drones[0]
    with connected(drone, tmp_path) as scf:
        take_off(lab, drone, scf.cf)
        drone.tumble()
        lab.wait_until(lambda: drone.tumbled, within=1.0)
        lab.wait_until(lambda: max(drone.motors) == 0, within=0.1)


def test_a_drone_that_nobody_hears_is_not_waited_for(lab: InstantLab) -> None:
    with pytest.raises(LabWaitTimeout, match=r"within 0\.5 s"):
        lab.wait_until(lambda: lab.drones[0].flying, within=0.5)
    lab.drones[0].freeze()
    lab.run_for(0.1)
    lab.drones[0].thaw()


def test_loss_is_refused_because_cflib_would_wait_for_ever(lab: InstantLab, tmp_path: Path) -> None:
    with pytest.raises(LabInputError, match="loses no packets"):
        lab.drones[0].lose_packets(0.1)
    with pytest.raises(LabInputError, match="loses no packets"):
        InstantLab(tmp_path / "other", faults=["link_loss=0.02"])


def test_addresses(lab: InstantLab) -> None:
    assert InProcessDriver().scan_interface() == [["perchhw://cf1", ""]]
    assert ["perchhw://cf1", ""] in [
        found
        for driver in cflib.crtp.CLASSES
        if driver is InProcessDriver
        for found in driver().scan_interface()
    ]
    with pytest.raises(LinkInputError, match="served: cf1"):
        InProcessDriver().connect("perchhw://cf9", None, None)
    with pytest.raises(LinkInputError, match="served already"):
        serve_in_process("cf1", None)  # type: ignore[arg-type]
    stop_serving("nobody")


PLAIN = """
    import time
    import cflib.crtp
    import pytest
    from cflib.crazyflie import Crazyflie
    from cflib.crazyflie.log import LogConfig
    from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
    from cflib.crazyflie.syncLogger import SyncLogger
    from cflib.utils.reset_estimator import reset_estimator

    def test_cflibs_own_waiting(instant_lab):
        with SyncCrazyflie(instant_lab.drones[0].uri, cf=Crazyflie()) as scf:
            reset_estimator(scf)
            config = LogConfig("z", period_in_ms=50)
            config.add_variable("stateEstimate.z")
            with SyncLogger(scf, config) as samples:
                times = [next(samples)[0] for _ in range(5)]
            assert [b - a for a, b in zip(times, times[1:])] == [50, 50, 50, 50]

    @pytest.mark.crazyflie(drones=2)
    def test_plain_code_with_sleeps(instant_lab):
        cflib.crtp.init_drivers()
        began = time.monotonic()
        for drone in instant_lab.drones:
            with SyncCrazyflie(drone.uri, cf=Crazyflie()) as scf:
                time.sleep(2)
                scf.cf.supervisor.send_arming_request(True)
                time.sleep(0.5)
                scf.cf.high_level_commander.takeoff(0.3, 1.0)
                time.sleep(1.5)
                assert drone.position[2] == pytest.approx(0.3, abs=0.03)
                scf.cf.high_level_commander.land(0.0, 1.0)
                time.sleep(1.5)
                assert drone.position[2] < 0.1
        assert instant_lab.time == pytest.approx(11.0)
        print("took", time.monotonic() - began)
"""


@pytest.mark.further  # in fixtures of pytest: tests/test_pytest_lab.py
def test_plain_code_that_sleeps_flies_in_lab_time(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(PLAIN)
    pytester.runpytest_subprocess("-W", "error", "-q", "-p", "no:cacheprovider").assert_outcomes(passed=2)


WITHOUT_POSIX = """
import os, sys, tempfile
from pathlib import Path

for name in ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"):
    sys.modules[name] = None
for name in ("fork", "sched_getaffinity", "setsid"):
    delattr(os, name)

from perchhw import pytest_plugin
from perchhw.testing.instant import InstantLab
from sim_backend.warm_up import _cores

lab = InstantLab(Path(tempfile.mkdtemp()))
lab.run_for(0.1)
print(round(lab.time, 3), _cores() >= 1)
"""


def test_it_needs_nothing_that_only_posix_has() -> None:
    command = [sys.executable, "-c", WITHOUT_POSIX]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.stdout.split() == ["0.1", "True"], done.stderr
