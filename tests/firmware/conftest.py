"""The drone's code in C, where a compiler is found; without one its tests skip and say so."""

import os
from pathlib import Path

import pytest

from onboard.firmware import compiler
from onboard.firmware.library import CoreLibrary, core_library
from onboard.vehicle import load_vehicle
from tests.firmware.shell import build_shell

if "PERCHHW_SANITIZE" in os.environ:  # test_fuzz.py runs these tests once more with sanitizers
    compiler.FLAGS = (*compiler.FLAGS, *os.environ["PERCHHW_SANITIZE"].split())


@pytest.fixture(scope="session")
def core() -> CoreLibrary:
    if compiler.find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot be tested")
    return core_library()


@pytest.fixture(scope="session")
def shell_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The app with its shell, on a firmware made for tests."""
    if compiler.find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot be tested")
    return build_shell(tmp_path_factory.mktemp("shell"), load_vehicle("crazyflie21-upgraded"))
