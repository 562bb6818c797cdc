"""The stage of labs ends with its input, whatever its input is."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import PATIENCE_S
from tests.tiers import some


@pytest.mark.parametrize("said", [pytest.param("", marks=pytest.mark.further), '{"do": "look"}\n'])
@pytest.mark.parametrize("kind", some(["nothing", "file", "pipe"], 2))
def test_it_ends_with_its_input(said: str, kind: str, tmp_path: Path) -> None:
    """For a file and for /dev/null no event loop can wait."""
    file = tmp_path / "commands"
    file.write_text(said)
    line = [sys.executable, "-m", "sim_backend.stage", "parked"]
    if kind == "pipe":
        done = subprocess.run(
            line, input=said, capture_output=True, text=True, timeout=PATIENCE_S, check=True
        )
    else:
        with (file if kind == "file" else Path("/dev/null")).open() as stream:
            done = subprocess.run(
                line, stdin=stream, capture_output=True, text=True, timeout=PATIENCE_S, check=True
            )
    ready, *answers = map(json.loads, done.stdout.splitlines())
    assert ready["ready"]
    expected = [{"error": "no lab is open"}] if said and kind != "nothing" else []
    assert answers == expected
