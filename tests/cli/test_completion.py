"""Completion: made from the parser, and asked of a real shell."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from perchhw.cli.completion import command_words
from perchhw.cli.main import VERBS, run

_ASKED = """\
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
_perchhw
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("completion") / "perchhw.bash"
    with pytest.MonkeyPatch.context() as patch, path.open("w") as stream:
        patch.setattr("sys.stdout", stream)
        assert run(["completion", "bash"]) == 0
    return path


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (("ca",), {"calibrate", "campaign"}),
        (("campaign", ""), {"run", "status", "report"}),
        (("--json", "policy", "up"), {"upload"}),
        (("campaign", "run", "--res"), {"--resume"}),
        (("fly", "--accept"), {"--accept-mismatch"}),
        (("campaign", "run", "here.t"), {"here.toml"}),
    ],
)
def test_bash_offers_what_may_follow(
    typed: tuple[str, ...], offered: set[str], script: Path, tmp_path: Path
) -> None:
    (tmp_path / "here.toml").touch()
    command = ["bash", "--norc", "-c", _ASKED, "bash", str(script), "perchhw", *typed]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True, timeout=30)
    assert offered <= set(said.stdout.split())
    assert all(word.startswith(typed[-1]) for word in said.stdout.split())


def test_every_verb_and_option_is_known() -> None:
    known = {command.chain: command for command in command_words()}
    assert set(known["perchhw"].verbs) == set(VERBS)
    assert "--ceiling" in known["perchhw fly"].options
    assert "--drone" in known["perchhw policy upload"].options


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_can_read_their_script(
    shell: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["completion", shell]) == 0
    path = tmp_path / "script"
    path.write_text(capsys.readouterr().out)
    assert "accept-mismatch" in path.read_text()
    if shutil.which(shell) is not None:
        subprocess.run([shell, "--no-execute", path], check=True, timeout=30)


def test_a_script_gets_one_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["completion", "bash", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["shell"] == "bash"
    assert document["script"].startswith("_perchhw()")


def test_another_shell_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["completion", "tcsh"]) == 2
    assert "bash, zsh, fish" in capsys.readouterr().err
