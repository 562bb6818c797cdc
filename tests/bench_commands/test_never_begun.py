"""A wizard that could not begin leaves no folder behind; one whose folder was given leaves that."""

from pathlib import Path

import pytest

from perchhw.cli.main import run

NEVER = {
    "no terminal": (2, "bifilar"),
    "no supply that can be cut": (3, "tachometer", "--tachometer", "/dev/none"),
    "no such port": (2, "thrust", "--scale", "manual://", "--supply", "scpi:///dev/none"),
}


@pytest.mark.parametrize("why", NEVER)
def test_no_folder_is_left(why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    code, *words = NEVER[why]
    line = ["calibrate", *map(str, words), "--drone", "udp://127.0.0.1:1"]
    assert run(line) == code
    assert list((tmp_path / "runs").iterdir()) == []
    given = tmp_path / "given"
    assert run([*line, "--out", str(given)]) == code
    assert given.is_dir()
