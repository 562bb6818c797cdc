"""Code of others that breaks: an error that is not of its contract is a bug of it, told with its place."""

import os
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mocap_bridge.errors import ListenerBroken, SourceBroken
from onboard.errors import PerchhwError

_PYTHON = str(Path(os.__file__).parent)


@contextmanager
def blamed_on_the_source() -> Iterator[None]:
    """Around what calls a source, which tells what is wrong by our errors.

    Raises:
        SourceBroken: for every other error; it says type, text, file and line.
    """
    try:
        yield
    except PerchhwError:
        raise
    except Exception as error:
        raise SourceBroken(f"the source broke, which is a bug of it: {_told(error)}") from error


@contextmanager
def blamed_on_the_listener() -> Iterator[None]:
    """Around what calls a listener, of which no error is expected.

    Raises:
        ListenerBroken: for every error, of ours too; it says type, text, file and line.
    """
    try:
        yield
    except Exception as error:
        raise ListenerBroken(
            f"who listens to the poses (on_sample) broke, which is a bug of it: {_told(error)}"
        ) from error


def _told(error: Exception) -> str:
    return f"{type(error).__name__}: {error}{_place(error)}"


def _place(error: Exception) -> str:
    """The innermost line outside Python's own library; of a SyntaxError nothing: its text has the line."""
    if isinstance(error, SyntaxError):
        return ""
    lines = [line for line in traceback.extract_tb(error.__traceback__) if not _of_python(line.filename)]
    return f" ({Path(lines[-1].filename).name}:{lines[-1].lineno})"


def _of_python(file: str) -> bool:
    return file.startswith("<frozen") or (file.startswith(_PYTHON) and "site-packages" not in file)
