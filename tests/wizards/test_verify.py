"""``perchhw calibrate verify``: a discharge that held its thrust, and one that did not."""

import json
from pathlib import Path

import pytest

from perchhw.cli.main import run


def discharge(folder: Path, error: float) -> Path:
    rows = ["t_s,battery_v,asked_gf,command,scale_g,motors"]
    for k in range(200):
        battery = 4.2 - 0.004 * k
        command = min(round(65535 * 3.2 / battery), 65280)
        most = 10.0 if command < 65280 else 9.0
        rows.append(f"{k},{battery:.3f},10.0,{command},{4.0 * most * (1.0 + error):.3f},4")
    path = folder / "discharge.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(("error", "code"), [(0.01, 0), (0.06, 1)])
def test_a_discharge_is_judged(
    error: float, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["--json", "calibrate", "verify", str(discharge(tmp_path, error))]) == code
    said = json.loads(capsys.readouterr().out)
    assert said["passed"] is (code == 0)
    assert said["worst_relative"] == pytest.approx(error, abs=1e-3)


def test_a_battery_that_cannot_give_more_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = discharge(tmp_path, 0.0)
    lines = path.read_text().splitlines()
    low = [
        line.replace(line.split(",")[1], "3.1").replace(line.split(",")[3], "65280") for line in lines[-20:]
    ]
    path.write_text("\n".join([*lines, *low]) + "\n")
    assert run(["--json", "calibrate", "verify", str(path)]) == 0
    assert json.loads(capsys.readouterr().out)["saturated_below_v"] == pytest.approx(3.1)


def test_a_table_of_another_kind_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.csv"
    path.write_text("a,b\n1,2\n")
    assert run(["--json", "calibrate", "verify", str(path)]) == 2
    assert "expected" in json.loads(capsys.readouterr().out)["error"]
