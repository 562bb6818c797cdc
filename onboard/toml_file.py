"""The files that people write: TOML, read with complaints that name the file and say what to do; its text."""

import json
import tomllib
from pathlib import Path

from onboard.errors import InputError
from onboard.quantity import Quantity


def read_toml(path: Path, error: type[InputError]) -> dict[str, object]:
    """The content of a TOML file.

    Args:
        path: the file.
        error: raised when the file is absent, unreadable or not TOML; its message names file and line.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as problem:
        raise error(f"{path}: cannot be read ({problem.strerror}); check the path") from problem
    except UnicodeDecodeError as problem:
        raise error(f"{path}: is not UTF-8 text (byte {problem.start}); save it as UTF-8") from problem
    except (ValueError, RecursionError) as problem:  # also of a number with more digits than Python reads
        raise error(f"{path}: is not valid TOML: {problem}") from problem


def quantity_line(key: str, quantity: Quantity) -> str:
    """A line that gives `key` (as :func:`toml_key` writes it) a quantity."""
    return f"{key} = {quantity_table(quantity)}"


def quantity_table(quantity: Quantity) -> str:
    """A quantity as an inline table."""
    return (
        f"{{ value = {quantity.value!r}, unit = {toml_text(quantity.unit)}, "
        f"sigma = {quantity.sigma!r}, source = {toml_text(quantity.source)} }}"
    )


def toml_key(key: str) -> str:
    """`key`, in quotes where it needs them."""
    bare = bool(key) and all(c.isascii() and (c.isalnum() or c in "_-") for c in key)
    return key if bare else toml_text(key)


def toml_text(text: str) -> str:
    """`text` as a TOML basic string: JSON escapes are TOML escapes, except for the delete character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
