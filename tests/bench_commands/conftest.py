"""A simulated bench with a drone that is not as the shipped file says, and the command line against it."""

import io
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE
from perchhw.cli import main
from perchhw.lab_process import SimulatedLab
from perchhw.walkthrough.bench.story import write_true
from tests.patience import patient_port, patient_uri

PACE = 8
Bench = Callable[..., SimulatedLab]
Refused = Callable[..., str]
Said = Callable[..., dict[str, Any]]


@pytest.fixture(scope="session")
def true_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_true(tmp_path_factory.mktemp("true"))


@pytest.fixture
def bench(true_file: Path) -> Iterator[Bench]:
    opened: list[SimulatedLab] = []

    def open_bench(*arguments: str, pace: float = PACE) -> SimulatedLab:
        opened.append(serve(true_file, *arguments, pace=pace).open())
        return opened[-1]

    yield open_bench
    for one in opened:
        one.close()


@pytest.fixture(scope="module")
def still_bench(true_file: Path) -> Iterator[SimulatedLab]:
    """A bench for everything that is refused before anything turns, and is held to that."""
    with serve(true_file, pace=0.5) as served:
        yield served


@pytest.fixture
def said() -> Said:
    """Runs a command line in this process; its JSON document."""
    return run_here


@pytest.fixture
def refused(said: Said) -> Refused:
    """The same, for a command that ends with an error: what that says."""
    return lambda line, expected: str(said(line, expected)["error"])


def run_here(line: list[str], expected: int = 0) -> dict[str, Any]:
    """Run a command line in this process, which saves its start; its JSON document."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = main.run(line[line.index("--json") :])
    assert code == expected, err.getvalue()
    document: dict[str, Any] = json.loads(out.getvalue())
    return document


def serve(vehicle: Path, *arguments: str, pace: float = PACE) -> SimulatedLab:
    """``perchhw sim bench`` with that drone, not yet open."""
    return SimulatedLab(
        "bench", ["--drone-port", "0", "--vehicle", str(vehicle), "--pace", str(pace), *arguments]
    )


def command(kind: str, bench: SimulatedLab, out: Path, *arguments: str) -> list[str]:
    """``perchhw --json calibrate KIND`` on the instruments of a bench."""
    ports = patient_ports(bench)
    line = [sys.executable, "-m", "perchhw", "--json", "calibrate", kind]
    line += ["--drone", patient_uri(bench.drones[0]), "--hands", ports["hands"], "--out", str(out)]
    if kind == "tachometer":
        line += ["--tachometer", ports["tachometer"], "--supply", ports["supply"], "--confirm", UNLOCK_PHRASE]
    if kind == "thrust":
        line += ["--scale", ports["scale"], "--supply", ports["supply"], "--confirm", UNLOCK_PHRASE]
    return [*line, *arguments]


def patient_ports(bench: SimulatedLab) -> dict[str, str]:
    """The addresses of a bench's instruments, for a machine that is busy."""
    return {
        name: address if name == "hands" else patient_port(address)
        for name, address in bench.ready["bench"].items()
    }


def run(line: list[str], expected: int = 0) -> dict[str, Any]:
    """Run a command line to its end; its JSON document."""
    done = subprocess.run(line, check=False, capture_output=True, text=True, timeout=250)
    assert done.returncode == expected, done.stderr
    document: dict[str, Any] = json.loads(done.stdout)
    return document
