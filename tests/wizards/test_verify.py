"""``perchhw calibrate verify``: a discharge that held its thrust, and one that did not."""

import json
from html import escape
from pathlib import Path

import numpy as np
import pytest

from calibration.bench.thrust.compensation import read_discharge, write_discharge
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
    cells = [line.split(",") for line in lines[-20:]]
    low = [
        ",".join([str(200 + k), "3.1", asked, "65280", *rest])
        for k, (_, _, asked, _, *rest) in enumerate(cells)
    ]
    path.write_text("\n".join([*lines, *low]) + "\n")
    assert run(["--json", "calibrate", "verify", str(path)]) == 0
    assert json.loads(capsys.readouterr().out)["saturated_below_v"] == pytest.approx(3.1)


def test_a_table_of_another_kind_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.csv"
    path.write_text("a,b\n1,2\n")
    assert run(["--json", "calibrate", "verify", str(path)]) == 2
    assert "expected" in json.loads(capsys.readouterr().out)["error"]


def test_a_page_shows_the_discharge(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.html"
    table = str(discharge(tmp_path, 0.06))
    assert run(["--json", "calibrate", "verify", table, "--report", str(page)]) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["report"] == str(page)
    text = page.read_text(encoding="utf-8")
    assert "not passed" in text
    assert escape(said["findings"][0]["text"]) in text
    assert "V of the battery" in text
    assert run(["--json", "calibrate", "verify", table]) == 1
    assert json.loads(capsys.readouterr().out)["report"] is None


def test_a_written_discharge_is_read_back(tmp_path: Path) -> None:
    before = read_discharge(discharge(tmp_path, 0.02))
    write_discharge(tmp_path / "again.csv", before, 4)
    after = read_discharge(tmp_path / "again.csv")
    for name in ("time", "battery", "requested", "measured", "command"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), rtol=1e-4)
