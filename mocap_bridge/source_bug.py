"""A source tells what is wrong by the errors of its contract; another is a bug of it, told with its place."""

import os
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mocap_bridge.errors import SourceBroken
from onboard.errors import PerchhwError

_PYTHON = str(Path(os.__file__).parent)


@contextmanager
def blamed_on_the_source() -> Iterator[None]:
    """Around what calls a source.

    Raises:
        SourceBroken: for every error that is none of ours; it says type, text, file and line.
    """
    try:
        yield
    except PerchhwError:
        raise
    except Exception as error:
        told = f"{type(error).__name__}: {error}{_place(error)}"
        raise SourceBroken(f"the source broke, which is a bug of it: {told}") from error


def _place(error: Exception) -> str:
    """The innermost line outside Python's own library; of a SyntaxError nothing: its text has the line."""
    if isinstance(error, SyntaxError):
        return ""
    lines = [line for line in traceback.extract_tb(error.__traceback__) if not _of_python(line.filename)]
    return f" ({Path(lines[-1].filename).name}:{lines[-1].lineno})"


def _of_python(file: str) -> bool:
    return file.startswith("<frozen") or (file.startswith(_PYTHON) and "site-packages" not in file)
