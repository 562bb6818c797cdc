"""Sweeps on a real Dask cluster on this machine: same numbers, dead workers, other versions, Ctrl-C."""

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest

import perchhw
from onboard.policy.files import load_policy, shipped_policy_path
from perchhw.cli.main import run
from perchhw.learning.dask_cluster import do_batch
from perchhw.learning.environment import environment
from perchhw.learning.errors import LearningError, LearningInputError
from perchhw.learning.executor import LocalThreads, open_executor
from perchhw.learning.grid import conditions
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid, run_sweep
from perchhw.learning.validate import validate_policy

ROOT = Path(perchhw.__file__).parents[1]
SETUP = LearningSetup(seed=5, randomise=("legs.stiffness",))
GRID = SweepGrid(speeds=(2.0, 2.25, 2.5), angles_deg=(40.0, 50.0, 60.0, 70.0), repeats=2)
GRID_OPTIONS = ("--speeds", "2:2.5:0.25", "--angles", "40:70:10", "--repeats", "2")
SETUP_OPTIONS = ("--seed", "5", "--randomise", "legs.stiffness")

Seen = TypeVar("Seen")


def wait_until(look: Callable[[], Seen | None], process: subprocess.Popen[str]) -> Seen:
    """What `look` sees, as soon as it sees anything, while the process runs."""
    for _ in range(5000):
        if seen := look():
            return seen
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=0.05)
            break
    raise AssertionError(f"{process.args} ended or took minutes, and nothing was seen")


class Cluster:
    """A scheduler and workers, each a process of its own on the loopback."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._processes: list[subprocess.Popen[str]] = []
        scheduler = self._start("scheduler", "--port", "0", "--no-dashboard", cwd=ROOT)
        self.address = self._wait_for(scheduler, r"Scheduler at:\s+(tcp://\S+)")

    def start_worker(self, source: Path = ROOT) -> subprocess.Popen[str]:
        """A worker with one thread that imports perchhw from `source`, ready for work."""
        folder = str(self._folder / "scratch")
        worker = self._start(
            "worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
            "--local-directory", folder, cwd=source,
        )  # fmt: skip
        self._wait_for(worker, "(Starting established connection)")
        return worker

    def _start(self, *arguments: str, cwd: Path) -> subprocess.Popen[str]:
        with self._log(len(self._processes)).open("w") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments, "--host", "127.0.0.1"],
                cwd=cwd, env={**os.environ, "PYTHONPATH": str(cwd)}, text=True, stderr=log,
            )  # fmt: skip
        self._processes.append(process)
        return process

    def _log(self, number: int) -> Path:
        return self._folder / f"{number}.log"

    def _wait_for(self, process: subprocess.Popen[str], pattern: str) -> str:
        """What the first group matches in the log of a process, once it is there."""
        log = self._log(self._processes.index(process))
        return wait_until(lambda: re.search(pattern, log.read_text()), process).group(1)

    def stop(self, process: subprocess.Popen[str]) -> None:
        process.kill()
        process.wait()

    def close(self) -> None:
        for process in self._processes:
            self.stop(process)


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sweep on threads of this process (which also compiles for the workers)."""
    folder = tmp_path_factory.mktemp("local")
    run_sweep(SETUP, GRID, folder, executor=LocalThreads(2))
    return folder


@pytest.fixture
def cluster(local: Path, tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    try:
        yield made
    finally:
        made.close()


def _pairs(folder: Path) -> bytes:
    return (folder / "pairs.csv").read_bytes()


@pytest.mark.further
def test_a_dead_worker_costs_nothing_but_time(cluster: Cluster, local: Path, tmp_path: Path) -> None:
    """One of two workers is killed with its hands full; the table is that of the local sweep, bit for bit."""
    victim, _ = cluster.start_worker(), cluster.start_worker()

    def kill(row: Any, done: int, total: int) -> None:
        if done == 3:
            os.kill(victim.pid, signal.SIGKILL)

    with open_executor(scheduler=cluster.address) as executor:
        assert executor.describe() == {"backend": "dask", "processes": 2, "workers": 2}
        run_sweep(SETUP, GRID, tmp_path / "out", executor=executor, on_trial=kill)
        assert executor.describe()["processes"] == 1
        assert victim.wait() == -signal.SIGKILL
        assert _pairs(tmp_path / "out") == _pairs(local)


@pytest.mark.further
def test_a_validation_gives_the_same_rows(cluster: Cluster) -> None:
    policy = load_policy(shipped_policy_path("default"))
    approaches = conditions((2.0, 3.0), (40.0, 60.0))
    here = validate_policy(policy, SETUP, approaches, rollouts=3, executor=LocalThreads(1))
    cluster.start_worker()
    with open_executor(scheduler=cluster.address) as executor:
        assert validate_policy(policy, SETUP, approaches, rollouts=3, executor=executor) == here


@pytest.mark.further  # a worker that dies is asked above
def test_interrupted_on_the_cluster_and_resumed_here(cluster: Cluster, local: Path, tmp_path: Path) -> None:
    cluster.start_worker()
    for attempt in range(4):  # a sweep this small may end on its own before the signal arrives
        out = tmp_path / f"out_{attempt}"
        if _interrupted_sweep(cluster, out) != 0:
            break
    rows = _pairs(out).splitlines()[1:]
    assert 2 <= len(rows) < 24
    with open_executor(scheduler=cluster.address) as executor:
        assert _outstanding(executor) == 0
    resumed = run_sweep(SETUP, GRID, out, executor=LocalThreads(2), resume=True)
    assert resumed.new_trials == 24 - len(rows)
    assert _pairs(out) == _pairs(local)


def _interrupted_sweep(cluster: Cluster, out: Path) -> int:
    """Exit code of a sweep that is interrupted once it has rows: 130, or 0 when it was faster."""
    command = [sys.executable, "-c", "from perchhw.cli.main import main; main()", "learn", "sweep"]
    options = [*GRID_OPTIONS, *SETUP_OPTIONS, "--out", str(out)]
    sweep = subprocess.Popen(
        [*command, *options, "--scheduler", cluster.address], cwd=ROOT, stderr=subprocess.DEVNULL, text=True
    )
    wait_until(lambda: (out / "pairs.csv").exists() and _pairs(out).count(b"\n") > 2, sweep)
    sweep.send_signal(signal.SIGINT)
    code = sweep.wait(timeout=120)
    assert code in (0, 130)
    return code


def _outstanding(executor: Any) -> int:
    """Tasks that the scheduler still knows of."""
    return int(executor._client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)))


def test_a_worker_with_another_source_is_refused(cluster: Cluster, tmp_path: Path) -> None:
    other = tmp_path / "other"
    for package in ("perchhw", "sim_backend", "onboard"):
        shutil.copytree(ROOT / package, other / package, ignore=shutil.ignore_patterns("__pycache__"))
    with (other / "perchhw" / "learning" / "reward.py").open("a", encoding="utf-8") as file:
        file.write("\n")
    cluster.start_worker(other)
    with (
        pytest.raises(LearningInputError, match=r"worker tcp://\S+ has perchhw .* install the same"),
        open_executor(scheduler=cluster.address),
    ):
        pass
    with pytest.raises(LearningInputError, match=r"numba 0\.1"):  # one that joins during the work
        do_batch((1,), abs, {**environment(), "numba": "0.1"})


@pytest.mark.further
def test_a_lost_scheduler_keeps_the_rows(cluster: Cluster, tmp_path: Path) -> None:
    cluster.start_worker()

    def lose(row: Any, done: int, total: int) -> None:
        if done == 3:
            cluster.close()

    with (
        pytest.raises(LearningError, match="--resume"),
        open_executor(scheduler=cluster.address) as executor,
    ):
        run_sweep(SETUP, GRID, tmp_path / "out", executor=executor, on_trial=lose)
    assert _pairs(tmp_path / "out").count(b"\n") >= 4


@pytest.mark.further
def test_without_any_worker_left_the_sweep_ends(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("perchhw.learning.dask_cluster.PATIENCE", 0.4)
    monkeypatch.setattr("perchhw.learning.dask_cluster.LOOK_EVERY", 0.2)
    worker = cluster.start_worker()

    def kill(row: Any, done: int, total: int) -> None:
        if done == 3:
            cluster.stop(worker)

    with (
        pytest.raises(LearningError, match=r"all workers .* are gone .*--resume"),
        open_executor(scheduler=cluster.address) as executor,
    ):
        run_sweep(SETUP, GRID, tmp_path / "out", executor=executor, on_trial=kill)


def test_a_scheduler_without_workers_says_so(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("perchhw.learning.dask_cluster.WORKER_TIMEOUT", 0.5)
    with (
        pytest.raises(LearningError, match=re.escape(f"dask worker {cluster.address}")),
        open_executor(scheduler=cluster.address),
    ):
        pass


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--scheduler", "tcp://127.0.0.1:9"], 1, "dask scheduler"),
        (["--scheduler", "localhost"], 2, "tcp://HOST:PORT"),
        (["--scheduler", "tcp://127.0.0.1:9", "--workers", "2"], 2, "--workers"),
    ],
)
def test_no_cluster_there(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    code: int,
    words: str,
) -> None:
    monkeypatch.setattr("perchhw.learning.dask_cluster.CONNECT_TIMEOUT", 0.5)
    assert run(["--json", "learn", "sweep", *options, "--out", str(tmp_path / "out")]) == code
    assert words in json.loads(capsys.readouterr().out)["error"]
    assert not (tmp_path / "out").exists()


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "perchhw.learning.dask_cluster")
    monkeypatch.setitem(sys.modules, "dask", None)  # what Python itself does with a module that is absent
    with (
        pytest.raises(LearningInputError, match=r"pip install 'perchhw\[cluster\]'"),
        open_executor(scheduler="tcp://127.0.0.1:9"),
    ):
        pass
