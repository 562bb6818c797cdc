"""The lab file that the documentation shows."""

import math
import re
from pathlib import Path

import pytest

from perchhw.lab import drones_of, find_lab, flight_setup, limits_of
from tests.conftest import REPOSITORY


@pytest.fixture
def page() -> str:
    return (REPOSITORY / "docs" / "lab_file.md").read_text(encoding="utf-8")


def block(page: str, language: str) -> str:
    (text,) = re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)
    return str(text)


def test_the_example_is_a_lab_that_could_be_flown_in(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("lab.toml").write_text(block(page, "toml"))
    lab = find_lab(None)
    assert lab is not None
    setup = flight_setup(lab, drone=drones_of(None)[0])
    setup.check()
    assert setup.room.ceiling_at(1.0, 0.0) == pytest.approx(2.412 + math.tan(math.radians(0.4)))
    assert limits_of(lab, setup.room, setup.drone).tilt_in_hover == pytest.approx(math.radians(25.0))
    assert flight_setup(lab, drone=lab.drones[1].uri).mocap.endswith("?subject=cf2")


def test_the_lines_of_python_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("lab.toml").write_text(block(page, "toml"))
    exec(compile(block(page, "python"), "docs/lab_file.md", "exec"), {})
