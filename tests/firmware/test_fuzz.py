"""Core and shell under the address and undefined-behaviour sanitizers: bundles, accesses and sequences."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import pytest

from onboard.app_interface import LandingState
from onboard.firmware.compiler import FLAGS, SOURCES, find_compiler
from onboard.firmware.header import vehicle_header
from tests.firmware.histories import BUNDLE, VEHICLE
from tests.firmware.shell import SHIM
from tests.tiers import some

SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")
SAMPLE, LONG = 20_000, 1_000_000
KINDS = ("bundles", "memory", "sequences", "shell")
"""Of the core, and `shell`: of the whole app, by its parameters, memory port and samples of the firmware."""

SOURCES_OF_FUZZERS = Path(__file__).with_name("fuzz")
CORE, SHELL = SOURCES / "core", SOURCES / "app" / "src"


def build(compiler: str, folder: Path, name: str, *places: Path) -> None:
    """Compile a fuzzer and the sources in `places`, which find their headers in each other."""
    fuzzer = SOURCES_OF_FUZZERS / f"{name}.c"
    sources = [str(fuzzer), *(str(file) for place in places for file in sorted(place.glob("*.c")))]
    flags = ["-std=gnu11" if flag == "-std=c11" else flag for flag in FLAGS]  # the shim has tasks
    headers = [f"-I{place}" for place in (folder, SHIM / "include", *places)]
    command = [compiler, *flags, *SANITIZERS, *headers, *sources, "-lm", "-o", name]
    made = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if made.returncode != 0 and "-lasan" in made.stderr:
        pytest.skip("this compiler has no sanitizers (Debian: apt install libgcc-12-dev)")
    assert made.returncode == 0, made.stderr


Fuzzers: TypeAlias = Callable[[str], Path]
"""Compiles a fuzzer, once, and says where it is."""

PLACES = {"fuzz": (CORE,), "fuzz_shell": (CORE, SHELL, SHIM)}


@pytest.fixture(scope="session")
def fuzzers(tmp_path_factory: pytest.TempPathFactory) -> Fuzzers:
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C compiler: the drone's code in C cannot be tested")
    folder = tmp_path_factory.mktemp("fuzz")
    for name in ("vehicle_constants.h", "perch_vehicle_constants.h"):
        (folder / name).write_text(vehicle_header(VEHICLE))
    (folder / "good.bundle").write_bytes(BUNDLE)

    def built(name: str) -> Path:
        if not (folder / name).exists():
            build(compiler, folder, name, *PLACES[name])
        return folder / name

    return built


def fuzz(fuzzers: Fuzzers, kind: str, cases: int) -> list[int]:
    """Steps that ended in each state of the landing machine."""
    fuzzer = fuzzers("fuzz_shell" if kind == "shell" else "fuzz")
    command = [str(fuzzer), kind, str(cases), os.environ.get("SEED", "1"), "good.bundle"]
    run = subprocess.run(command, cwd=fuzzer.parent, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return [int(number) for number in run.stdout.split()]


@pytest.mark.further
@pytest.mark.parametrize("kind", some(reversed(KINDS), len(KINDS)))
def test_a_sample(fuzzers: Fuzzers, kind: str) -> None:
    fuzz(fuzzers, kind, SAMPLE)


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", KINDS)
def test_a_million_cases(fuzzers: Fuzzers, kind: str) -> None:
    counts = fuzz(fuzzers, kind, LONG)
    if kind in ("sequences", "shell"):
        assert all(counts[state] > 0 for state in LandingState), counts


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_the_other_tests_under_the_sanitizers() -> None:
    """Parity and histories once more, in a Python that begins with the sanitizer's library."""
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C compiler")
    said = subprocess.run(
        [compiler, "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    )
    library = said.stdout.strip()
    if not Path(library).is_absolute():
        pytest.skip("this compiler has no sanitizers")
    environment = os.environ | {
        "LD_PRELOAD": library,
        "ASAN_OPTIONS": "detect_leaks=0",
        "PERCHHW_SANITIZE": " ".join(SANITIZERS),
    }
    files = ["test_policy_parity.py", "test_law_parity.py", "test_histories.py"]
    command = [sys.executable, "-m", "pytest", "-q", *(str(Path(__file__).with_name(name)) for name in files)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
