"""A whole lab in lock step: the same flight every time, and a time that stops, waits and goes on in turn."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest

from onboard.app_interface import Parameter
from onboard.lab_time import open_timebase, time_address
from onboard.lab_time.figures import lab_figures
from onboard.link import DroneLink, reboot
from perchhw.lab_process import FREE_PORTS, SimulatedLab
from tests.lab_time.busy import busy_processes
from tests.lab_time.hover import hover
from tests.patience import patient_link, until

pytestmark = pytest.mark.slow


def lab_at(pace: str, *arguments: str) -> SimulatedLab:
    return SimulatedLab("lab", (*FREE_PORTS, "--seed", "5", "--pace", pace, *arguments))


@pytest.fixture(scope="module")
def lab() -> Iterator[SimulatedLab]:
    """One in lock step, for tests that leave it to the next: the last one locks its drone."""
    with lab_at("lockstep") as served:
        yield served


def figures(lab: SimulatedLab) -> dict[str, Any]:
    address = time_address(lab.drones[0])
    assert address is not None
    return lab_figures(address)


def without_query(uri: str) -> str:
    return uri.split("?")[0]


@pytest.mark.parametrize(
    ("scheme", "busy", "count"),
    [
        ("vicon", 0, 1),
        pytest.param("vicon-udp", 0, 1, marks=pytest.mark.soak),
        pytest.param("vicon", 4, 2, marks=pytest.mark.soak),
    ],
)
def test_the_same_seed_gives_the_same_flights_also_on_a_busy_machine(
    scheme: str, busy: int, count: int
) -> None:
    flights = []
    for loops in (0, busy):
        with lab_at("lockstep") as lab, busy_processes(loops):
            mocap = next(uri for uri in lab.mocap if uri.startswith(f"{scheme}:"))
            flights.append([hover(lab.drones[0], mocap) for _ in range(count)])
    assert flights[0] == flights[1]
    first = flights[0][0]
    assert first.connected == first.began  # no lab time for what takes none on the drone
    assert max(sample[4] for sample in first.samples) == pytest.approx(0.5, abs=0.05)


@pytest.mark.further
def test_time_stands_still_where_nobody_takes_part_and_nothing_moves() -> None:
    with lab_at("lockstep") as lab:
        assert figures(lab)["t"] == 0.0
        flown = hover(lab.drones[0], lab.mocap[0])
        resting = figures(lab)["t"]
        assert resting >= flown.ended - 1e-9
        assert [figures(lab)["t"] for _ in range(3)] == [resting] * 3
        assert figures(lab)["takes_part"] == []


def test_a_client_that_takes_no_part_finds_a_lab_in_real_time(lab: SimulatedLab) -> None:
    with patient_link(without_query(lab.drones[0])) as stranger:
        begin, lab_begin = time.monotonic(), figures(lab)["t"]
        heard: list[int] = []
        stranger.stream(("pm.vbat",), 100, lambda sample: heard.append(sample.drone_time_ms))
        while len(heard) < 15:
            assert time.monotonic() - begin < 60.0
            time.sleep(0.01)
        lab_elapsed, elapsed = figures(lab)["t"] - lab_begin, time.monotonic() - begin
    assert heard[14] - heard[0] == 1400  # more may have come while this process waited for its turn
    assert lab_elapsed <= 1.1 * elapsed + 0.1


def test_a_lab_lives_on_for_a_drone_that_is_not_done_with_a_parameter_when_somebody_connects(
    lab: SimulatedLab,
) -> None:
    """Its parameter task answers nobody before; a lab that stood still would wait for it for ever."""
    with open_timebase("test", lab.drones[0]) as lab_time:
        for _ in range(2):
            begin = lab_time()
            with DroneLink.open(lab.drones[0], clock=lab_time) as link:
                taken = lab_time() - begin
                link.set_param(Parameter.TRAJECTORY_ARM, 0)
        assert 0.0 < taken <= 0.01
        begin = lab_time()
        with DroneLink.open(lab.drones[0], clock=lab_time) as link:
            assert link.param(Parameter.TRAJECTORY_ARM) == 0


@pytest.mark.parametrize("when", [pytest.param("armed", marks=pytest.mark.further), "flying"])
def test_a_process_that_dies_is_not_waited_for_and_the_watchdog_bites(when: str, lab: SimulatedLab) -> None:
    reboot(lab.drones[0], even_flying=True)  # of what the one before locked
    pilot = subprocess.Popen(
        [sys.executable, "-m", "tests.lab_time.hover", lab.drones[0], lab.mocap[0], when],
        stdout=subprocess.PIPE,
    )
    assert pilot.stdout is not None
    assert pilot.stdout.readline() == b"watched\n"
    pilot.send_signal(signal.SIGKILL)
    pilot.wait()
    pilot.stdout.close()
    assert figures(lab)["takes_part"] == []
    with patient_link(without_query(lab.drones[0])) as link:
        until(lambda: link.supervisor_info().is_locked)


@pytest.mark.further
def test_a_factor_is_a_limit() -> None:
    with lab_at("0.5") as lab, open_timebase("test", lab.drones[0]) as lab_time:
        begin = time.monotonic()
        lab_time.event().wait(0.5)
        assert time.monotonic() - begin >= 0.9


@pytest.mark.soak
def test_a_factor_gives_the_flight_of_lock_step_however_long_it_was_waited_for() -> None:
    flights = []
    for pace, wait_s in (("lockstep", 0.0), ("10", 0.5)):
        with lab_at(pace) as lab:
            time.sleep(wait_s)
            flights.append(hover(lab.drones[0], lab.mocap[0]))
    assert flights[0] == flights[1]


@pytest.mark.further
def test_lost_packets_are_sent_again_in_the_labs_time() -> None:
    with lab_at("lockstep", "--fault", "link_loss=0.1") as lab:
        flown = hover(lab.drones[0], lab.mocap[0])
    assert max(sample[4] for sample in flown.samples) == pytest.approx(0.5, abs=0.05)
    assert flown.ended - flown.connected < 15.0


@pytest.mark.soak
def test_a_process_that_hangs_ends_the_lab_with_an_error_that_names_it() -> None:
    lab = subprocess.Popen(
        [sys.executable, "-m", "perchhw", "sim", "lab", *FREE_PORTS, "--pace", "lockstep"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert lab.stdout is not None
    ready = json.loads(lab.stdout.readline())
    with subprocess.Popen(
        [sys.executable, "-m", "tests.lab_time.hover", ready["drones"][0], ready["mocap"][0]],
        stdout=subprocess.PIPE,
    ) as pilot:
        assert pilot.stdout is not None
        assert pilot.stdout.readline() == b"watched\n"
        pilot.send_signal(signal.SIGSTOP)
        try:
            _, errors = lab.communicate(timeout=200.0)
        finally:
            pilot.kill()
            lab.kill()
    assert lab.returncode == 1
    assert "hover takes part in the lab's time and has said nothing for 60 s" in errors
