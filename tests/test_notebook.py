"""``import perchhw``: the examples of its docstrings run, and nothing is imported before it is used."""

import ast
import doctest
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import perchhw
import perchhw.notebook
from calibration.flights import Flight, FlightFileError
from calibration.gap.find import NothingToFindError
from onboard.errors import PerchhwError
from onboard.link.stop_drone import stop_drone
from onboard.room import CeilingError
from perchhw.lab_process import LabNotReady
from perchhw.learning.errors import LearningInputError
from tests.conftest import REPOSITORY


@pytest.mark.slow
@pytest.mark.parametrize("module", [perchhw, pytest.param(perchhw.notebook, marks=pytest.mark.soak)])
def test_the_examples_of_the_docstrings_run(module: object) -> None:
    done = doctest.testmod(module)  # type: ignore[arg-type]
    assert done.attempted >= 3
    assert done.failed == 0


@pytest.mark.soak
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


@cache
def simulated_approach() -> Flight:
    """A flight that any function here takes."""
    return perchhw.simulate_approach("default", 2.5, 50.0)


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
    vehicle = perchhw.load_vehicle("crazyflie21-upgraded")
    flight = simulated_approach()
    for ask in (
        lambda: perchhw.LearningSetup(ceiling_z=ceiling_z),
        lambda: perchhw.label_flight(flight, vehicle, ceiling_z=ceiling_z),
        lambda: perchhw.find_gap([flight], vehicle, ceiling_z=ceiling_z),
    ):
        with pytest.raises(CeilingError, match=f"a ceiling {problem} cannot be"):
            ask()


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
        perchhw.find_gap([], perchhw.load_vehicle("crazyflie21-upgraded"))


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
        lambda seen: perchhw.find_gap(seen, perchhw.load_vehicle("crazyflie21-upgraded")),
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
