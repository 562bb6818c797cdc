"""Steps that are done once: each has a folder, and a result that is written last."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from onboard.errors import InputError
from onboard.json_file import parsed, write_json_atomically
from onboard.record.folder import make_folder
from perchhw.errors import FlightStackError

RESULT_FILE = "result.json"


class StepResultError(FlightStackError, InputError):
    """The result of a step that was done cannot be read; the message names the file."""


def step(folder: Path, work: Callable[[Path], dict[str, Any]]) -> dict[str, Any]:
    """The result of a step: read when it was done before, else worked out and kept.

    Args:
        folder: of the step; made.
        work: does the step in its folder and gives the result (JSON).

    Raises:
        OutputFolderError: the folder cannot be written.
        StepResultError: the result that is there is damaged.
    """
    path = folder / RESULT_FILE
    if path.is_file():
        return _read(path)
    make_folder(folder)
    result = work(folder)
    write_json_atomically(path, result)
    return result


def _read(path: Path) -> dict[str, Any]:
    try:
        result = parsed(path.read_text(encoding="utf-8"))
        if not isinstance(result, dict):
            raise ValueError("not an object")
    except (OSError, ValueError) as error:
        raise StepResultError(
            f"{path}: cannot be read ({error}); remove it, and the step is done again"
        ) from error
    return result
