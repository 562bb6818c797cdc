"""cppcheck on the drone's code: core, shell and host, with the stand-in for the firmware as its headers."""

import shutil
import subprocess
from pathlib import Path

import pytest

from onboard.firmware.compiler import SOURCES
from onboard.firmware.header import vehicle_header
from tests.firmware.histories import VEHICLE
from tests.firmware.shell import SHIM

pytestmark = pytest.mark.skipif(
    shutil.which("cppcheck") is None, reason="cppcheck is not installed: apt-get install cppcheck"
)


def test_nothing_is_found(tmp_path: Path) -> None:
    (tmp_path / "perch_vehicle_constants.h").write_text(vehicle_header(VEHICLE), encoding="utf-8")
    headers = (tmp_path, SHIM / "include", SHIM, SOURCES / "core")
    places = (SOURCES / "core", SOURCES / "host", SOURCES / "app" / "src", SHIM)
    command = ["cppcheck", "--std=c11", "--quiet", "--error-exitcode=1"]
    command += ["--enable=warning,style,performance,portability", *(f"-I{place}" for place in headers)]
    run = subprocess.run([*command, *map(str, places)], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
