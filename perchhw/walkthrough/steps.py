"""Steps that are done once: each has a folder, and a result that is written last."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from onboard.json_file import write_json_atomically
from onboard.record.folder import make_folder

RESULT_FILE = "result.json"


def step(folder: Path, work: Callable[[Path], dict[str, Any]]) -> dict[str, Any]:
    """The result of a step: read when it was done before, else worked out and kept.

    Args:
        folder: of the step; made.
        work: does the step in its folder and gives the result (JSON).

    Raises:
        OutputFolderError: the folder cannot be written.
    """
    path = folder / RESULT_FILE
    if path.is_file():
        result: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return result
    make_folder(folder)
    result = work(folder)
    write_json_atomically(path, result)
    return result
