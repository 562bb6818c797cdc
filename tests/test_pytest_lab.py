"""The plugin's labs as another project would use them: its page, faults, truth, records, many at once."""

import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from perchhw.testing import (
    Lab,
    LabInputError,
    LabWaitTimeout,
    SimulatedDrone,
    StageFailed,
    StageProcess,
)
from perchhw.testing.instant import InstantLab
from tests.conftest import REPOSITORY

pytest_plugins = ["pytester"]

PAGE = (REPOSITORY / "docs" / "pytest.md").read_text(encoding="utf-8")
STRICT = ("-W", "error", "--strict-config", "--strict-markers", "-q", "-p", "no:cacheprovider")


def blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.slow
def test_the_page_is_true(pytester: pytest.Pytester) -> None:
    whole, markers, instant = blocks()
    assert len(whole.splitlines()) <= 40
    assert len(PAGE.split()) <= 900  # to be read in three minutes
    pytester.makepyfile(test_flight=whole, test_markers=markers, test_instant=instant)
    pytester.runpytest_subprocess(*STRICT).assert_outcomes(passed=5)


def test_it_says_all_that_there_is() -> None:
    from perchhw import pytest_plugin

    for name in pytest_plugin._OPTIONS:
        assert f"`{name}" in PAGE
    for name, value in vars(Lab).items():
        if not name.startswith("_") and callable(value) and name not in ("look", "ask", "note", "close"):
            assert f"lab.{name}(" in PAGE
    for name in vars(SimulatedDrone):
        assert name.startswith("_") or f"{name}" in PAGE


@pytest.fixture(scope="module")
def stage():
    with StageProcess() as stage:
        yield stage


@pytest.fixture
def fresh(stage: StageProcess, tmp_path: Path):
    lab = Lab(stage, tmp_path / "lab")
    yield lab
    lab.close()


def test_a_fresh_lab_knows_nothing_of_the_one_before(stage: StageProcess, tmp_path: Path) -> None:
    first = Lab(stage, tmp_path / "1")
    with first.drones[0].connect() as cf:
        cf.param.set_value("ring.effect", "7")
        first.drones[0].reboot()
    first.drones[0].lose_packets(1.0)
    first.stop_poses()
    second = Lab(stage, tmp_path / "2", drones=2)
    assert [drone.boots for drone in second.drones] == [1, 1]
    assert second.time < 30.0
    with second.drones[1].connect() as cf:
        assert cf.param.get_value("ring.effect") != "7"
    second.close()


def test_two_labs_of_one_seed_begin_alike(stage: StageProcess, tmp_path: Path) -> None:
    looks = []
    for name in ("1", "2"):
        lab = Lab(stage, tmp_path / name, seed=5)
        looks.append((*lab.drones[0].position, lab.drones[0].voltage))
        lab.close()
    assert looks[0] == pytest.approx(looks[1])


def test_freeze_and_thaw(fresh: Lab) -> None:
    drone = fresh.drones[0]
    with drone.connect() as cf:
        drone.freeze()
        before = drone.boots
        fresh.run_for(0.1)
        drone.thaw()
        assert drone.boots == before
        assert cf.link_uri == f"{drone.uri}?silence_s=10"


def test_brown_out(fresh: Lab) -> None:
    drone = fresh.drones[0]
    began = fresh.time
    drone.brown_out(0.5)
    motors, booted = drone.motors, drone.boots == 2
    assert booted or motors == (0, 0, 0, 0)
    fresh.wait_until(lambda: drone.powered, within=5.0)
    assert fresh.time - began >= 0.5  # however late somebody looks
    assert drone.boots == 2


def test_a_drone_that_is_hit_finds_itself_tumbled(fresh: Lab) -> None:
    drone = fresh.drones[0]
    fresh.wait_until(lambda: drone.ready, within=10.0)
    drone.tumble()
    fresh.wait_until(lambda: drone.tumbled, within=5.0)


def test_poses_that_jump_take_the_estimate_with_them_and_not_the_drone(fresh: Lab) -> None:
    drone = fresh.drones[0]
    fresh.wait_until(lambda: drone.ready, within=10.0)
    x = drone.position[0]
    fresh.shift_poses(x=0.5)
    with drone.connect() as cf:
        estimated = _estimates(cf)
        fresh.wait_until(
            lambda: abs(estimated[-1:][0] - (x + 0.5)) < 0.05 if estimated else False, within=10.0
        )
    assert drone.position[0] == pytest.approx(x, abs=0.01)
    events = [json.loads(line) for line in (fresh.folder / "events.jsonl").read_text().splitlines()]
    assert [event["event"] for event in events] == ["poses"]
    assert events[0]["shift"] == [0.5, 0.0, 0.0]


def _estimates(cf) -> list[float]:
    from cflib.crazyflie.log import LogConfig

    config = LogConfig("x", period_in_ms=20)
    config.add_variable("stateEstimate.x", "float")
    seen: list[float] = []
    cf.log.add_config(config)
    config.data_received_cb.add_callback(lambda _t, values, _c: seen.append(values["stateEstimate.x"]))
    config.start()
    return seen


def test_what_does_not_come_to_pass_says_what_is(fresh: Lab) -> None:
    with pytest.raises(LabWaitTimeout, match=r"within 0\.1 s.*motors"):
        fresh.wait_until(lambda: False, within=0.1)


def test_what_cannot_be_done_says_why(stage: StageProcess, tmp_path: Path) -> None:
    with pytest.raises(StageFailed, match="known: "):
        Lab(stage, tmp_path / "1", faults=["lightning=1"])
    with pytest.raises(StageFailed, match="brick"):
        Lab(stage, tmp_path / "2", vehicle="brick")
    lab = Lab(stage, tmp_path / "3", poses=False)
    with pytest.raises(StageFailed, match="sends no poses"):
        lab.stop_poses()
    lab.close()
    with pytest.raises(StageFailed, match="no lab is open"):
        lab.look()


def test_a_room_serves_poses_as_well(stage: StageProcess, tmp_path: Path) -> None:
    from mocap_bridge.bridge import PoseBridge

    lab = Lab(stage, tmp_path / "lab", room=True)
    with PoseBridge(lab.mocap[0], sink=None) as bridge:
        assert bridge.wait_for(lambda status: status.last_good is not None, 60.0)
        assert bridge.status().last_good.position == pytest.approx(lab.drones[0].position, abs=0.001)
    lab.close()


FAILS = """
    def test_fails(lab, drone):
        lab.run_for(0.3)
        drone.lose_packets(0.5)
        assert drone.position[2] > 1.0

    def test_passes(lab, drone):
        assert not drone.armed
"""


@pytest.mark.further
def test_a_test_that_fails_leaves_its_record(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(FAILS)
    result = pytester.runpytest_subprocess(*STRICT, "--crazyflie-records", "kept")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["*simulated lab*", "*record: kept*"])
    (record,) = (pytester.path / "kept").iterdir()
    assert "test_fails" in record.name
    truth = (record / "truth.csv").read_text().splitlines()
    assert truth[0].startswith("t,drone,x,y,z")
    assert len(truth) > 25
    (event,) = (json.loads(line) for line in (record / "events.jsonl").read_text().splitlines())
    assert (event["event"], event["drone"], event["value"]) == ("loss", "cf1", 0.5)


FAILS_IN_FIXTURES = """
    import pytest

    pytestmark = pytest.mark.crazyflie(flies=False)

    @pytest.fixture
    def broken(drone):
        drone.freeze()
        raise ValueError("before the test")

    def test_before(broken):
        pass

    @pytest.fixture
    def breaks(drone):
        yield
        drone.freeze()
        raise ValueError("after the test")

    def test_after(breaks):
        pass

    def test_that_ends_the_process(lab):
        lab.ask("drone", index=7, act="freeze")

    def test_that_is_innocent(drone):
        assert drone.powered

    @pytest.mark.crazyflie(room=True)
    def test_a_room_of_parked_drones(lab):
        pass
"""


@pytest.mark.further
def test_fixtures_that_fail_leave_records_and_a_lab_that_dies_ends_one_test(
    pytester: pytest.Pytester,
) -> None:
    pytester.makepyfile(FAILS_IN_FIXTURES)
    result = pytester.runpytest_subprocess(*STRICT, "--crazyflie-records", "kept")
    # The test whose lab died fails, and so does the end of its lab.
    result.assert_outcomes(passed=2, failed=1, errors=4)
    result.stdout.fnmatch_lines(["*room=True or flies=False*"])
    for name in ("test_before", "test_after"):
        (record,) = (pytester.path / "kept").glob(f"*{name}")
        (event,) = (json.loads(line) for line in (record / "events.jsonl").read_text().splitlines())
        assert event["event"] == "freeze"


@pytest.mark.parametrize(
    "options",
    [{"drones": 33}, {"drones": 0}, {"drones": "2"}, {"drones": 1.5}, {"seed": -1}, {"seed": "x"}],
    ids=str,
)
def test_a_lab_that_cannot_be_is_refused(
    stage: StageProcess, tmp_path: Path, options: dict[str, Any]
) -> None:
    for lab in (lambda: Lab(stage, tmp_path, **options), lambda: InstantLab(tmp_path, **options)):
        with pytest.raises(LabInputError, match="is not a whole number"):
            lab()


def test_values_that_no_lab_can_have_are_refused(fresh: Lab) -> None:
    drone = fresh.drones[0]
    for ask in (
        lambda: drone.lose_packets(10),
        lambda: drone.lose_packets("10%"),
        lambda: drone.brown_out(math.nan),
        lambda: drone.set_log("range.zrange", "abc"),
        lambda: drone.offset_voltage("a"),
        lambda: drone.offset_accelerometer(x=math.inf),
        lambda: fresh.turn_poses(math.inf),
        lambda: fresh.run_for(-1.0),
        lambda: fresh.run_for(math.nan),
    ):
        with pytest.raises(LabInputError, match="is not a number"):
            ask()
    assert drone.powered


@pytest.mark.further
def test_workers_of_xdist_do_not_meet(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.crazyflie(flies=False)
        @pytest.mark.parametrize("value", range(6))
        def test_alone(lab, drone, value):
            with drone.connect() as cf:
                assert cf.param.get_value("ring.effect") == "6"  # as after power-on
                cf.param.set_value("ring.effect", str(value + 10))
        """
    )
    pytester.runpytest_subprocess(*STRICT, "-n", "2").assert_outcomes(passed=6)


def test_parked_drones_compile_nothing(tmp_path: Path) -> None:
    program = (
        "import sys; from pathlib import Path; from perchhw.testing import Lab, StageProcess\n"
        "with StageProcess(parked=True) as stage:\n"
        "    lab = Lab(stage, Path(sys.argv[1]))\n"
        "    with lab.drones[0].connect() as cf:\n"
        "        assert cf.param.get_value('system.selftestPassed') == '1'\n"
        "        assert len(cf.log.toc.toc['stateEstimate']) > 10\n"
        "    lab.close()\n"
    )
    cache = tmp_path / "cache"
    subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "lab")],
        env={**os.environ, "XDG_CACHE_HOME": str(cache), "NUMBA_CACHE_DIR": str(cache)},
        check=True,
        timeout=120,
    )
    assert not [path for path in cache.rglob("*") if path.suffix in (".nbi", ".nbc")]


def test_a_marker_that_is_wrong_says_so(pytester: pytest.Pytester) -> None:
    wrong = {"unknown": ("wings=2", "knows no 'wings'"), "nameless": ("3", "takes names")}
    test = "import pytest\n\n@pytest.mark.crazyflie({})\ndef test_it(drone):\n    pass\n"
    pytester.makepyfile(**{f"test_{name}": test.format(marker) for name, (marker, _) in wrong.items()})
    result = pytester.runpytest_subprocess(*STRICT)
    result.assert_outcomes(errors=2)
    for name, (_, says) in wrong.items():
        result.stdout.fnmatch_lines([f"*test_{name}.py::test_it: *{says}*"])
