"""A folder for results that cannot be written is refused before the work, not after it."""

from pathlib import Path

import pytest

from perchhw.cli.main import run

VEHICLE = ("--vehicle", "crazyflie21-upgraded")


@pytest.mark.parametrize(
    "command",
    [
        ("demo",),
        ("gap", "find", "--data", "flights", *VEHICLE),
        ("gap", "landings", "--data", "flights", *VEHICLE),
    ],
    ids=["demo", "gap find", "gap landings"],
)
def test_no_work_begins_for_it(
    command: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def began(*_: object, **__: object) -> None:
        raise AssertionError("the work began")

    monkeypatch.setattr("perchhw.lab_process.SimulatedLab", began)
    monkeypatch.setattr("perchhw.cli.gap.read_flights", began)
    monkeypatch.setattr("calibration.flights.flight_files", began)
    (tmp_path / "file").touch()
    assert run([*command, "--out", str(tmp_path / "file" / "results")]) == 2
    assert "cannot be written" in capsys.readouterr().err
