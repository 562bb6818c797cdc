"""The drone's code in C, where a compiler is found; without one its tests skip and say so."""

import pytest

from onboard.firmware.compiler import find_compiler
from onboard.firmware.library import CoreLibrary, core_library


@pytest.fixture(scope="session")
def core() -> CoreLibrary:
    if find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot be tested")
    return core_library()
