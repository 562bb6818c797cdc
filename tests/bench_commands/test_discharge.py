"""A discharge recorded on the simulated bench, and what ``calibrate verify`` says of it."""

import sys
from pathlib import Path

import pytest

from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE
from calibration.bench.procedures.motors import HAND_PHRASE
from perchhw.lab_process import SimulatedLab
from tests.bench_commands.conftest import Bench, patient_ports, run
from tests.patience import patient_uri


def discharge(served: SimulatedLab, vehicle: Path, out: Path, *further: str) -> list[str]:
    ports = patient_ports(served)
    line = [sys.executable, "-m", "perchhw", "--json", "calibrate", "discharge"]
    line += ["--drone", patient_uri(served.drones[0]), "--vehicle", str(vehicle), "--scale", ports["scale"]]
    return [*line, "--hands", ports["hands"], "--out", str(out), "--confirm", UNLOCK_PHRASE, *further]


@pytest.mark.soak  # what a discharge means is tested without a bench too (tests/thrust_voltage)
@pytest.mark.parametrize(("gauge_error", "code"), [(0.0, 0), (0.04, 1)])
def test_compensation_holds_when_the_drone_reads_its_voltage_right(
    bench: Bench, tmp_path: Path, true_file: Path, gauge_error: float, code: int
) -> None:
    served = bench("--fault", f"bench_gauge_error={gauge_error}")
    supply = patient_ports(served)["supply"]
    said = run(discharge(served, true_file, tmp_path, "--supply", supply), expected=code)
    assert said["passed"] is (code == 0)
    assert said["readings"] >= 10
    verified = run([sys.executable, "-m", "perchhw", "--json", "calibrate", "verify", str(tmp_path)], code)
    assert verified == said
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "V of the battery" in page
    assert ("not passed" in page) is (code == 1)


@pytest.mark.soak
def test_a_battery_is_discharged_until_it_is_empty(bench: Bench, tmp_path: Path, true_file: Path) -> None:
    served = bench("--fault", "battery_voltage=4.0", "--fault", "bench_gauge_error=0")
    line = discharge(served, true_file, tmp_path, "--no-remote-cut", "--confirm", HAND_PHRASE)
    assert run([*line[: line.index("--no-remote-cut")]], expected=3)["error"]
    said = run(line, expected=1)  # a battery that was nearly empty falls by too little to tell anything
    assert [finding["code"] for finding in said["findings"]] == ["short_discharge"]
    rows = [line.split(",") for line in (tmp_path / "discharge.csv").read_text().splitlines()[1:]]
    voltages = [float(row[1]) for row in rows]
    assert voltages[-1] < 3.2 <= min(voltages[:-1])
    assert len({row[2] for row in rows}) == 1
