"""A wizard that could not begin leaves no folder behind; one whose folder was given leaves that."""

import io
import signal
from pathlib import Path

import pytest

from perchhw.cli.bench_options import run_folder
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


class InterruptedOnce(io.StringIO):
    """Ctrl-C comes with the first word that is written."""

    def write(self, text: str, /) -> int:
        if not self.tell():
            super().write(text)
            signal.raise_signal(signal.SIGINT)
        return super().write(text)


def test_no_folder_is_left_by_who_is_interrupted_at_the_first_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = InterruptedOnce()
    monkeypatch.setattr("sys.stderr", words)
    with pytest.raises(KeyboardInterrupt), run_folder(None, "bifilar"):
        pass
    assert list((tmp_path / "runs").iterdir()) == []
    assert "begins anew" in words.getvalue()
