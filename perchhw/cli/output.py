"""How every verb speaks: one JSON document on stdout with ``--json``, words for a person otherwise.

Everything that is not the result (progress, warnings, prompts) goes to stderr, so that a script can always
parse stdout.
"""

import errno
import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TextIO

from onboard.json_file import as_json
from perchhw.consoles import console, in_width


@dataclass
class OutputSettings:
    """The global flags of the command line, and whether the verb has given its result yet."""

    as_json: bool = False
    emitted: bool = False


settings = OutputSettings()


def written(stream: TextIO | None, tell: Callable[[], object]) -> bool:
    """Tell a result to `stream`; False where its reader is gone (a closed pipe or terminal), or never was.

    That changes no exit code. What is told afterwards, also what the interpreter still has to flush, goes
    nowhere.
    """
    if stream is None:
        return False
    try:
        tell()
        stream.flush()
    except (OSError, SystemExit) as error:  # rich makes an exit of a broken pipe
        if isinstance(error, OSError) and error.errno not in (errno.EPIPE, errno.EIO):
            raise
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
        return False
    return True


def emit_error(message: str, exit_code: int) -> None:
    """With ``--json``, the document of a verb that ended without a result, so that there is always one."""
    if settings.as_json and not settings.emitted:
        emit({"error": message, "exit_code": exit_code}, "")


def emit(result: Any, human: Callable[[], None] | str) -> bool:
    """Give the result of a verb: as one JSON document, or `human`: a text or a function that draws.

    Returns:
        Whether anybody took it.
    """
    settings.emitted = True

    def tell() -> None:
        if settings.as_json:
            sys.stdout.write(json.dumps(as_json(result), allow_nan=False) + "\n")
        elif callable(human):
            human()
        else:
            screen = console()
            screen.print(in_width(human, screen), markup=False, soft_wrap=True)

    return written(sys.stdout, tell)
