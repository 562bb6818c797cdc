"""The pytest plugin as another project would use it: in a pytest of its own, with nothing of ours but the
fixtures."""

import json
import subprocess
import sys

import pytest

from perchhw.lab_process import LabNotReady, SimulatedLab
from tests.link.tiny_drone import TinyDrone

pytest_plugins = ["pytester"]

STRICT = ("-W", "error", "--strict-config", "--strict-markers", "-q")

ON_ANY_DRONE = """
    import threading

    def test_link(drone_link):
        drone_link.set_param("ring.solid", 0.5)
        assert drone_link.param("ring.solid") == 0.5

    def test_cflib(crazyflie):
        assert crazyflie.is_connected()
        read = threading.Event()
        crazyflie.param.add_update_callback("ring", "solid", lambda name, value: read.set())
        crazyflie.param.request_param_update("ring.solid")
        assert read.wait(60.0)
        assert float(crazyflie.param.get_value("ring.solid")) == 0.5

    def test_uri(crazyflie_uri):
        assert crazyflie_uri == {uri!r}
"""


def loaded_by(module: str) -> set[str]:
    """Packages that a process has loaded which imports this module."""
    program = f"import json, sys, {module}; print(json.dumps(sorted(sys.modules)))"
    output = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout
    return {name.split(".")[0] for name in json.loads(output)}


def test_the_plugin_loads_nothing_heavy() -> None:
    heavy = {"cflib", "numpy", "numba", "scipy", "typer", "rich", "onboard", "sim_backend", "mcap"}
    assert not loaded_by("perchhw.pytest_plugin") & heavy


def test_a_lab_needs_nothing_of_learning_reports_and_mavlink() -> None:
    theirs = {"torch", "sklearn", "joblib", "matplotlib", "pymavlink", "mcap", "typer", "rich"}
    assert not loaded_by("sim_backend.stage") & theirs


def test_strict_projects_get_no_warning(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("def test_nothing():\n    pass\n")
    result = pytester.runpytest_subprocess(*STRICT)
    result.assert_outcomes(passed=1)
    result.stdout.no_fnmatch_line("*arning*")


def test_fixtures_and_option_are_described(pytester: pytest.Pytester) -> None:
    listed = pytester.runpytest_subprocess("--fixtures", "-q")
    for name in ("crazyflie_uri", "simulated_lab", "simulated_room", "crazyflie", "drone_link"):
        listed.stdout.fnmatch_lines([f"{name}*"])
    pytester.runpytest_subprocess("--help").stdout.fnmatch_lines(["*--crazyflie-uri=URI*"])


def test_the_same_tests_run_on_a_given_drone(pytester: pytest.Pytester) -> None:
    with TinyDrone() as drone:
        pytester.makepyfile(ON_ANY_DRONE.replace("{uri!r}", repr(drone.uri)))
        result = pytester.runpytest_subprocess(*STRICT, f"--crazyflie-uri={drone.uri}")
    result.assert_outcomes(passed=3)


ON_SIMULATED_PARTS = """
    import socket
    from urllib.parse import urlsplit

    def test_cflib_gets_the_real_tables(crazyflie):
        assert len(crazyflie.log.toc.toc["stateEstimate"]) > 10
        assert crazyflie.param.get_value("system.selftestPassed") == "1"

    def test_link_to_the_same_drone(drone_link, crazyflie_uri):
        assert drone_link.uri == crazyflie_uri
        assert not drone_link.supervisor_info().is_flying

    def test_room_accepts_vicon_clients(simulated_room):
        vicon = [urlsplit(uri) for uri in simulated_room.mocap if uri.startswith("vicon://")]
        socket.create_connection((vicon[0].hostname, vicon[0].port), timeout=60.0).close()

    def test_lab_has_both(simulated_lab):
        assert simulated_lab.drones[0].startswith("udp://")
        assert simulated_lab.mocap
"""


def test_simulated_parts_are_started_on_demand_and_stopped(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(ON_SIMULATED_PARTS)
    result = pytester.runpytest_subprocess(*STRICT)
    result.assert_outcomes(passed=4)


def test_simulator_that_does_not_start_says_why() -> None:
    with (
        pytest.raises(LabNotReady, match="no-such-fault"),
        SimulatedLab("drone", ("--fault", "no-such-fault=1")),
    ):
        pass
