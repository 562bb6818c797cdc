"""The header of a vehicle: the compiler makes the constants of it whose checksum the host expects."""

import json
import re
import subprocess
from pathlib import Path

import pytest

from onboard import app_interface
from onboard.firmware.compiler import FLAGS, SOURCES, find_compiler
from onboard.firmware.constants import onboard_constants, vehicle_crc32
from onboard.firmware.header import vehicle_header
from onboard.policy import bundle, model
from onboard.vehicle import load_vehicle
from perchhw.cli.main import run
from tests.firmware.float32 import VEHICLES

PROGRAM = """
#include <stdio.h>
#include "perch_vehicle_constants.h"
int main(void) {
  printf("%u %u\\n", (unsigned)PERCH_VEHICLE_CRC, (unsigned)perch_vehicle_crc(&PERCH_VEHICLE));
  return 0;
}
"""


@pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda vehicle: vehicle.name)
def test_the_compiled_header_has_the_checksum_of_the_vehicle(vehicle: object, tmp_path: Path) -> None:
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C compiler: the header cannot be compiled")
    (tmp_path / "perch_vehicle_constants.h").write_text(vehicle_header(vehicle))
    (tmp_path / "say.c").write_text(PROGRAM)
    core = SOURCES / "core"
    sources = ["say.c", str(core / "vehicle.c"), str(core / "crc32.c")]
    subprocess.run([compiler, *FLAGS, f"-I{core}", *sources, "-o", "say"], cwd=tmp_path, check=True)
    said = subprocess.run([str(tmp_path / "say")], capture_output=True, text=True, check=True).stdout.split()
    assert [int(word) for word in said] == [vehicle_crc32(vehicle)] * 2


def test_the_structure_has_the_constants_in_their_order() -> None:
    text = (SOURCES / "core" / "vehicle.h").read_text()
    body = text[text.index("typedef struct {") : text.index("} perch_vehicle;")]
    fields = [name.strip() for line in re.findall(r"float ([^;]+);", body) for name in line.split(",")]
    at = fields.index("thrust_map[PERCH_MAP_COEFFICIENTS]")
    fields[at : at + 1] = [f"thrust_map_{i}" for i in range(8)]
    assert fields == [constant.name for constant in onboard_constants(VEHICLES[0])]


def test_the_command_prints_the_header(capsys: pytest.CaptureFixture[str]) -> None:
    vehicle = load_vehicle("crazyflie21-upgraded")
    assert run(["vehicle", "header", vehicle.name]) == 0
    assert capsys.readouterr().out == vehicle_header(vehicle)
    assert run(["--json", "vehicle", "header", vehicle.name]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == {
        "vehicle": vehicle.name,
        "crc32": vehicle_crc32(vehicle),
        "header": vehicle_header(vehicle),
    }


def numbers_of_c() -> dict[str, int]:
    """Every name with a number in ``interface.h``."""
    text = (SOURCES / "core" / "interface.h").read_text()
    found = re.findall(r"(?:#define )?(PERCH_[A-Z_]+) (?:= )?(\d+)", text)
    return {name: int(number) for name, number in found}


def test_c_and_the_host_have_the_same_numbers() -> None:
    expected = {f"PERCH_{state.name}": int(state) for state in app_interface.LandingState}
    expected |= {f"PERCH_REASON_{reason.name}": int(reason) for reason in app_interface.EndReason}
    expected |= {f"PERCH_POLICY_{status.name}": int(status) for status in app_interface.PolicyStatus}
    for status in app_interface.TrajectoryStatus:
        name = "ARMED_STATUS" if status is app_interface.TrajectoryStatus.ARMED else status.name
        expected[f"PERCH_TRAJECTORY_{name}"] = int(status)
    on = {"OFF": "NO_REHEARSAL", "POSES": "ON_POSES", "MODEL": "ON_MODEL"}
    expected |= {f"PERCH_{on[kind.name]}": int(kind) for kind in app_interface.Rehearsal}
    expected |= {
        "PERCH_INTERFACE_VERSION": app_interface.INTERFACE_VERSION,
        "PERCH_MAX_VECTORS": model.MAX_SUPPORT_VECTORS,
        "PERCH_MAX_LAYERS": model.MAX_LAYERS,
        "PERCH_MAX_WIDTH": model.MAX_LAYER_WIDTH,
        "PERCH_MAX_BUNDLE": bundle.MAX_BUNDLE_BYTES,
    }
    assert numbers_of_c() == expected
