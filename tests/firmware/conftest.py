"""The drone's code in C, where a compiler is found; without one its tests skip and say so."""

import os

import pytest

from onboard.firmware import compiler
from onboard.firmware.library import CoreLibrary, core_library

if "PERCHHW_SANITIZE" in os.environ:  # test_fuzz.py runs these tests once more with sanitizers
    compiler.FLAGS = (*compiler.FLAGS, *os.environ["PERCHHW_SANITIZE"].split())


@pytest.fixture(scope="session")
def core() -> CoreLibrary:
    if compiler.find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot be tested")
    return core_library()
