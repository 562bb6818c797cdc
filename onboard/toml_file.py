"""Reading the files that people write: TOML, with complaints that name the file and say what to do."""

import tomllib
from pathlib import Path

from onboard.errors import InputError


def read_toml(path: Path, error: type[InputError]) -> dict[str, object]:
    """The content of a TOML file.

    Args:
        path: the file.
        error: raised when the file is absent, unreadable or not TOML; its message names file and line.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as problem:
        raise error(f"{path}: cannot be read ({problem.strerror}); check the path") from problem
    except UnicodeDecodeError as problem:
        raise error(f"{path}: is not UTF-8 text (byte {problem.start}); save it as UTF-8") from problem
    except (tomllib.TOMLDecodeError, RecursionError) as problem:
        raise error(f"{path}: is not valid TOML: {problem}") from problem
