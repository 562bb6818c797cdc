"""The benchmarks that the documentation names: they are there, start, and print one JSON document."""

import json
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY
from tests.docs.test_documented_commands import PAGES

SHARED = ("drawn_sets.py", "gap_judgement.py", "machine.py", "peer_process.py")
SCRIPTS = sorted(path for path in (REPOSITORY / "benchmarks").glob("*.py") if path.name not in SHARED)


def run(script: str, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, str(REPOSITORY / "benchmarks" / script), *arguments],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_a_benchmark_starts(
    script: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [str(script), "--help"])
    monkeypatch.syspath_prepend(str(script.parent))
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(script), run_name="__main__")
    assert not ended.value.code
    assert "usage" in capsys.readouterr().out


def test_the_documentation_names_benchmarks_that_exist() -> None:
    named = {
        name
        for page in PAGES
        for name in re.findall(r"benchmarks/([a-z_]+\.py)", page.read_text(encoding="utf-8"))
    }
    assert named == {script.name for script in SCRIPTS}


@pytest.mark.further  # seconds of compiling
def test_rollouts_prints_one_document_of_positive_rates() -> None:
    done = run("rollouts.py", "--seconds", "0.01")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["free_flight_with_controller_steps_per_s"]["median"] > 0.0
    assert document["contact_steps_per_s"]["median"] > 0.0
    assert document["peers"]["mujoco"]["measured"] is False
