"""``--from-log`` with a recording twice: a copy is no repeat, and makes no interval narrower."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from calibration.bench.inertia.recordings import write_swing
from perchhw.cli.main import run
from tests.truth.bench.pendulum import Hang, record

RIG = ["--axis", "z", "--mass", "38.1 g", "--string-length", "600 mm", "--string-distance", "60 mm"]


def test_four_copies_of_one_swing_are_not_four_trials(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    swing, copy = tmp_path / "swing.csv", tmp_path / "copy.csv.gz"
    write_swing(swing, record(Hang(), np.random.default_rng(0), 10.0, cycles=20.0))
    copy.write_bytes(gzip.compress(swing.read_bytes()))
    assert run(["--json", "calibrate", "bifilar", *RIG, "--from-log", str(swing)]) == 0
    assert json.loads(capsys.readouterr().out)["inertia"]
    assert run(["--json", "calibrate", "bifilar", *RIG, "--from-log", str(swing), str(copy)]) == 2
    said = json.loads(capsys.readouterr().out)["error"]
    assert said.startswith(f"{copy} is the same recording as {swing}")


@pytest.mark.parametrize("header", ["time,omega", "t_us,edge_count"])
def test_a_staircase_that_is_given_twice_is_not_twice_as_many_steps(
    header: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{1000 * k},{k}" for k in range(1, 4)]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([header, *rows]) + "\n")
    assert run(["--json", "calibrate", "tachometer", "--from-log", str(log), str(log)]) == 2
    assert "is the same recording as" in json.loads(capsys.readouterr().out)["error"]
