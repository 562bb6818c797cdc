"""A command of mutation as it is given in a shell."""

import json
import subprocess
import sys
from typing import Any

from tests.conftest import REPOSITORY


def give(module: str, *arguments: str) -> tuple[int, dict[str, Any]]:
    """Run ``python -m module``; its exit code and the document that it prints."""
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout, done.stderr
    return done.returncode, json.loads(done.stdout)
