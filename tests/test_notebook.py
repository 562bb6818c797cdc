"""``import perchhw``: the examples of its docstrings run, and nothing is imported before it is used."""

import ast
import doctest
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import perchhw
import perchhw.notebook
from calibration.flights import Flight, FlightFileError, PoseSource
from calibration.flights.flight import finite_masks
from calibration.gap.find import NothingToFindError
from onboard.errors import InputError, PerchhwError
from onboard.link.stop_drone import stop_drone
from onboard.room import CeilingError
from perchhw.campaign import CampaignFileError
from perchhw.lab_process import LabNotReady
from perchhw.learning.errors import LearningInputError
from perchhw.learning.sweep import SweepGrid
from tests.campaign.conftest import CAMPAIGN
from tests.conftest import REPOSITORY


@pytest.mark.slow
@pytest.mark.parametrize("module", [perchhw, perchhw.notebook])
def test_the_examples_of_the_docstrings_run(module: object) -> None:
    done = doctest.testmod(module)  # type: ignore[arg-type]
    assert done.attempted >= 3
    assert done.failed == 0


@pytest.mark.slow
def test_the_examples_of_the_page_run() -> None:
    done = doctest.testfile(str(REPOSITORY / "docs" / "python.md"), module_relative=False)
    assert done.attempted >= 8
    assert done.failed == 0


@pytest.mark.parametrize("name", perchhw.__all__)
def test_every_name_is_there(name: str) -> None:
    assert getattr(perchhw, name) is not None
    assert name in dir(perchhw)


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(str(perchhw.__file__)).read_text())
    seen = {
        (alias.name, node.module)
        for block in tree.body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == set(perchhw._HOMES.items())


NAME = "crazyflie21-upgraded"


@cache
def hanging_flight() -> Flight:
    """A flight that any function here takes: it hangs by four legs."""
    t = np.arange(0.0, 1.0, 0.01)
    data = {"legs_attached": np.full(t.size, 4.0)}
    return Flight(
        name="hangs",
        source=Path("hangs.csv"),
        format="table",
        pose_source=PoseSource.TRUTH,
        t=t,
        data=data,
        valid=finite_masks(data),
    )


@pytest.mark.parametrize(
    ("speed", "angle_deg", "problem"),
    [
        (0.0, 50.0, "a speed of 0 m/s"),
        (250.0, 50.0, "a speed of 250 m/s"),
        (float("nan"), 50.0, "a speed of nan m/s"),
        (2.5, -10.0, "an angle of -10 deg"),
        (2.5, 500.0, "an angle of 500 deg"),
    ],
)
def test_an_approach_that_cannot_be_is_not_simulated(speed: float, angle_deg: float, problem: str) -> None:
    policy = perchhw.load_policy("default")
    with pytest.raises(LearningInputError, match=f"{problem} makes no approach"):
        perchhw.simulate_approach(policy, speed, angle_deg)


NO_CEILINGS = [(float("nan"), "at nan m"), (-1.0, "at -1 m"), (0, "at 0 m"), (2100, "at 2100 m")]


@pytest.mark.parametrize(("ceiling_z", "problem"), NO_CEILINGS)
def test_below_a_ceiling_that_cannot_be_nothing_is_learned_labelled_or_found(
    ceiling_z: float, problem: str
) -> None:
    vehicle = perchhw.load_vehicle(NAME)
    flight = hanging_flight()
    for ask in (
        lambda: perchhw.LearningSetup(ceiling_z=ceiling_z),
        lambda: perchhw.label_flight(flight, vehicle, ceiling_z=ceiling_z),
        lambda: perchhw.find_gap([flight], vehicle, ceiling_z=ceiling_z),
    ):
        with pytest.raises(CeilingError, match=f"a ceiling {problem} cannot be"):
            ask()


@pytest.mark.parametrize(
    ("ask", "problem"),
    [
        (lambda: perchhw.simulate_approach("default", "2.5", 50.0), "speed: '2.5' is no number"),  # type: ignore[arg-type]
        (lambda: perchhw.simulate_approach("default", 2.5, None), "angle_deg: None is no number"),  # type: ignore[arg-type]
        (lambda: perchhw.simulate_approach("default", 2.5, 50.0, seed=-1), "seed: -1 is no whole number"),
        (lambda: perchhw.LearningSetup(seed=1.5), "seed: 1.5 is no whole number"),  # type: ignore[arg-type]
        (lambda: perchhw.train("none", seed=-1), "seed: -1 is no whole number"),
        (lambda: perchhw.train("none", landing_rate_min="0.6"), "landing_rate_min: '0.6' is no number"),  # type: ignore[arg-type]
        (lambda: perchhw.train("none", landing_rate_min=2), "landing_rate_min 2 is no rate: give 0 to 1"),
        (lambda: perchhw.train("none", landing_rate_min=-1), "landing_rate_min -1 is no rate"),
        (lambda: perchhw.find_gap([], NAME, seed=1.5), "seed: 1.5 is no whole number of at least 0"),  # type: ignore[arg-type]
        (lambda: perchhw.load_policy(""), "policy is empty: give a name or a file"),
        (lambda: perchhw.load_policy(None), "policy is a NoneType: give a name or a file"),  # type: ignore[arg-type]
        (lambda: perchhw.fly("none", 2.5, 50.0, policy=perchhw.load_policy()), "perchhw.save_policy"),  # type: ignore[arg-type]
        (lambda: perchhw.fly(None, 2.5, 50.0), "lab is a NoneType: give a running perchhw.SimulatedLab, or"),  # type: ignore[arg-type]
        (lambda: perchhw.fly("", 2.5, 50.0), "lab is empty: give a running perchhw.SimulatedLab, or a lab f"),
        (lambda: perchhw.fly(perchhw.SimulatedLab, 2.5, 50.0), "lab is a type: give a running"),  # type: ignore[arg-type]
        (
            lambda: perchhw.simulate_approach("default", 2.5, 50.0, setup={}),
            "setup is a dict: give a perchhw",
        ),  # type: ignore[arg-type]
        (
            lambda: perchhw.simulate_approach("default", 2.5, 50.0, setup="wide-long", seed=1),
            "setup is a str",
        ),  # type: ignore[arg-type]
        (lambda: perchhw.LearningSetup(vehicle=perchhw.load_vehicle(NAME)), "vehicle is a Vehicle: give a n"),  # type: ignore[arg-type]
        (lambda: perchhw.find_gap("runs", NAME), "flights is a str, no list of flights: flights, unusable ="),  # type: ignore[arg-type]
        (lambda: perchhw.find_gap(([], []), NAME), "a list is no flight: flights, unusable = perchhw.open_"),  # type: ignore[arg-type]
        (lambda: perchhw.find_gap(hanging_flight(), NAME), "flights is a Flight, no list"),  # type: ignore[arg-type]
        (lambda: perchhw.find_gap([], 3), "vehicle is a int: give a name or a file"),  # type: ignore[arg-type]
        (lambda: perchhw.label_flight("run", NAME), "a str is no flight"),  # type: ignore[arg-type]
    ],
)
def test_what_is_of_another_kind_is_told_in_one_sentence(ask: Callable[[], object], problem: str) -> None:
    with pytest.raises(InputError) as refused:
        ask()
    assert problem in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("grid", "problem"),
    [
        ({"speeds": 2.5}, "speeds: 2.5 is no list of numbers"),
        ({"speeds": "2.5"}, "speeds: '2.5' is no list of numbers"),
        ({"speeds": [2.5, "fast"]}, "speeds: 'fast' is no number"),
        ({"angles_deg": [True]}, "angles_deg: True is no number"),
        ({"repeats": 1.5}, "repeats: 1.5 is no whole number of at least 1"),
        ({"setup": "wide-long"}, r"setup is a str: give a perchhw\.LearningSetup"),
        ({"setup": perchhw.LearningSetup}, "setup is a type"),
        ({"repeats": 0}, "repeats: 0 is no whole number of at least 1"),
    ],
)
def test_a_grid_of_no_numbers_is_refused_before_its_folder_is_made(
    tmp_path: Path, grid: dict[str, Any], problem: str
) -> None:
    with pytest.raises(InputError, match=problem):
        perchhw.sweep(tmp_path / "swept", **({"speeds": [2.5], "angles_deg": [50.0]} | grid))
    assert not (tmp_path / "swept").exists()


def test_a_sweep_takes_the_numbers_of_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    setup = perchhw.LearningSetup(seed=np.int64(3), ceiling_z=np.float32(2.0))  # type: ignore[arg-type]
    kept: list[str] = []

    def keep(setup: perchhw.LearningSetup, grid: SweepGrid, folder: Path, *, resume: bool) -> None:
        kept.append(json.dumps([setup.seed, setup.ceiling_z, asdict(grid)]))

    monkeypatch.setattr("perchhw.learning.sweep.run_sweep", keep)
    perchhw.sweep(
        "none", np.array([2.5], np.float32), np.arange(30, 91, 30), repeats=np.int64(1), setup=setup
    )
    grid = {"speeds": [2.5], "angles_deg": [30.0, 60.0, 90.0], "repeats": 1}
    assert json.loads(kept[0]) == [3, 2.0, grid]


@pytest.mark.parametrize("vehicle", [NAME, perchhw.load_vehicle(NAME)], ids=["name", "vehicle"])
def test_a_vehicle_goes_by_its_name_too(vehicle: Any) -> None:
    assert perchhw.label_flight(hanging_flight(), vehicle).outcome == "four_leg"
    with pytest.raises(NothingToFindError):
        perchhw.find_gap([], vehicle)


def test_test_flights_are_told_from_landings(tmp_path: Path) -> None:
    file = tmp_path / "suggested.toml"
    file.write_text('schema = "perchhw.campaign/1"\n[[flight]]\nkind = "hover"\n')
    with pytest.raises(CampaignFileError, match=r"test flights.*`perchhw campaign run .*suggested\.toml`"):
        perchhw.fly_campaign("none", file, tmp_path / "out", confirm=print)


def test_a_campaign_in_no_lab_is_told_so(tmp_path: Path) -> None:
    (file := tmp_path / "day.toml").write_text(CAMPAIGN)
    with pytest.raises(InputError, match="lab is a NoneType: give a running"):
        perchhw.fly_campaign(None, file, tmp_path / "out", confirm=print)  # type: ignore[arg-type]
    assert not (tmp_path / "out").exists()


def test_a_lab_that_was_closed_says_so(tmp_path: Path) -> None:
    lab = perchhw.SimulatedLab()
    lab._command = [sys.executable, "-c", 'print(\'{"lab": "lab.toml"}\', flush=True); input()']
    with lab:
        assert lab.lab_file == Path("lab.toml")
    with pytest.raises(LabNotReady, match="was closed, or has ended: open another"):
        perchhw.fly(lab, 2.5, 50.0, out=tmp_path)


@pytest.mark.further
def test_a_policy_goes_by_its_name_too() -> None:
    flights = [perchhw.simulate_approach(which, 2.5, 50.0) for which in ("default", perchhw.load_policy())]
    assert flights[0].t.size == flights[1].t.size
    assert np.array_equal(flights[0].data["z"], flights[1].data["z"])


def test_a_format_that_there_is_not_is_no_fault_of_the_files(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,x\n0,1\n")
    with pytest.raises(FlightFileError, match="unknown flight format 'nope'"):
        perchhw.open_flights(tmp_path / "a.csv", format="nope")


def test_a_gap_in_no_flights_is_not_looked_for() -> None:
    with pytest.raises(NothingToFindError, match="no usable flight: none was given"):
        perchhw.find_gap([], perchhw.load_vehicle(NAME))


def test_a_lab_that_was_not_opened_is_told_to_whoever_flies_in_it(tmp_path: Path) -> None:
    with pytest.raises(LabNotReady, match="open it first"):
        perchhw.fly(perchhw.SimulatedLab(), 2.5, 50.0, out=tmp_path)


@pytest.mark.further
def test_a_drone_that_is_locked_is_put_back_where_somebody_can_be_asked(tmp_path: Path) -> None:
    asked: list[str] = []
    with perchhw.SimulatedLab() as lab:
        assert stop_drone(lab.drones[0]).locked
        left = perchhw.fly(lab, 2.5, 50.0, out=tmp_path)
        flown = perchhw.fly(lab, 2.5, 50.0, out=tmp_path, confirm=asked.append)
    assert str(left.aborted_by).startswith("drone_state: locked")
    assert (flown.triggered, flown.aborted_by) == (True, None)
    assert ["on its start mark" in request for request in asked] == [True]


def test_a_name_that_is_not_there_says_so() -> None:
    with pytest.raises(AttributeError, match="no attribute 'land'"):
        perchhw.land  # noqa: B018


def test_importing_perchhw_imports_nothing_heavy() -> None:
    code = "import perchhw, sys; sys.exit(str({'numpy', 'numba', 'cflib', 'torch'} & set(sys.modules) or ''))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == ""


class ThreadsSeen(os.PathLike[str]):
    """Flights, speeds or a path: notes how many threads the linear algebra has where somebody looks."""

    def __init__(self) -> None:
        self.threads: set[int] = set()

    def __fspath__(self) -> str:
        self.threads = {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}
        return "/there/is/no/such/file"

    def __iter__(self) -> Iterator[Any]:
        self.__fspath__()
        return iter(())


@pytest.mark.parametrize(
    "fit",
    [
        lambda seen: perchhw.find_gap(seen, perchhw.load_vehicle(NAME)),
        lambda seen: perchhw.sweep("/there/is/no", seen, [50.0]),
        perchhw.train,
        lambda seen: perchhw.fly_campaign("lab.toml", seen, "folder", confirm=print),
    ],
    ids=["find_gap", "sweep", "train", "fly_campaign"],
)
def test_functions_that_fit_have_one_thread_of_linear_algebra(fit: Callable[[ThreadsSeen], object]) -> None:
    seen = ThreadsSeen()
    with threadpool_limits(limits=3, user_api="blas"):
        with pytest.raises(PerchhwError):
            fit(seen)
        assert seen.threads == {1}
        assert {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"} == {3}


def test_a_library_of_linear_algebra_that_is_loaded_late_has_one_thread_too() -> None:
    code = """if True:
        import numpy, threadpoolctl
        from onboard.linear_algebra import on_one_thread
        with on_one_thread():
            import scipy.linalg
            told = threadpoolctl.threadpool_info()
        print({one["num_threads"] for one in told})"""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "3"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=environment, check=True)
    assert done.stdout == b"{1}\n"
