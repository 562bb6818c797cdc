"""Reading numbers from a JSON document so that every complaint names the file and the key."""

import json
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from onboard.policy.model import Float32Array, PolicyError

_SHAPES = ("one number", "a list of numbers", "a list of rows of numbers, all of one length")


class PolicyFileError(PolicyError):
    """A policy file that cannot be used: the message names file and key, and says what to do."""


class JsonTable:
    """A JSON object being read; numbers come out as float32, as on the drone."""

    def __init__(self, content: Any, path: Path, key: str = "") -> None:
        self._path = path
        self._key = key
        if not isinstance(content, dict):
            where = f"{path}: {key}" if key else f"{path}: the document"
            raise PolicyFileError(f"{where} must be an object {{...}}, not {content!r:.60}")
        self._content = content

    @classmethod
    def from_file(cls, path: Path) -> "JsonTable":
        """The document in a file; NaN and Infinity, which JSON does not have, are refused."""

        def refuse(constant: str) -> NoReturn:
            raise PolicyFileError(
                f"{path}: holds {constant}, which is not a usable number; make the policy again"
            )

        try:
            content = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
        except OSError as error:
            raise PolicyFileError(f"{path}: cannot be read ({error.strerror}); check the path") from error
        except (ValueError, RecursionError) as error:  # also of more digits than Python reads
            raise PolicyFileError(f"{path}: is not JSON ({error}); give a policy file") from error
        return cls(content, path)

    def __contains__(self, key: str) -> bool:
        return key in self._content

    def error(self, key: str, problem: str) -> PolicyFileError:
        """The complaint about one key."""
        return PolicyFileError(f"{self._path}: {self._name(key)} {problem}")

    def only(self, *keys: str) -> None:
        """Refuse other keys: a misspelt one would be ignored in silence."""
        unknown = sorted(set(self._content) - set(keys))
        if unknown:
            raise self.error(unknown[0], f"is not known here; the keys are {', '.join(keys)}")

    def content(self) -> dict[str, Any]:
        """The object itself."""
        return self._content

    def value(self, key: str) -> Any:
        """Any JSON value."""
        if key not in self._content:
            raise self.error(key, "is missing")
        return self._content[key]

    def table(self, key: str) -> "JsonTable":
        """An object."""
        return JsonTable(self.value(key), self._path, self._name(key))

    def tables(self, key: str) -> list["JsonTable"]:
        """A list of objects."""
        content = self.value(key)
        if not isinstance(content, list):
            raise self.error(key, f"must be a list, not {content!r:.60}")
        return [JsonTable(item, self._path, f"{self._name(key)}[{i}]") for i, item in enumerate(content)]

    def text(self, key: str) -> str:
        """A string."""
        content = self.value(key)
        if not isinstance(content, str):
            raise self.error(key, f"must be text, not {content!r:.60}")
        return content

    def integer(self, key: str) -> int:
        """A whole number."""
        content = self.value(key)
        if not isinstance(content, int) or isinstance(content, bool):
            raise self.error(key, f"must be a whole number, not {content!r:.60}")
        return content

    def number(self, key: str) -> np.float32:
        """One number."""
        return np.float32(self._numbers(key, dimensions=0))

    def vector(self, key: str) -> Float32Array:
        """A list of numbers."""
        return self._numbers(key, dimensions=1)

    def matrix(self, key: str) -> Float32Array:
        """A list of rows of numbers."""
        return self._numbers(key, dimensions=2)

    def _name(self, key: str) -> str:
        return f"{self._key}.{key}" if self._key else key

    def _numbers(self, key: str, dimensions: int) -> Float32Array:
        content = self.value(key)
        try:
            array = np.array(content)
        except ValueError as error:
            raise self.error(key, f"must be {_SHAPES[dimensions]}") from error
        if array.ndim != dimensions or array.dtype.kind not in "iuf":
            raise self.error(key, f"must be {_SHAPES[dimensions]}")
        with np.errstate(over="ignore"):  # too large for float32 becomes infinite, which no policy accepts
            return array.astype(np.float32)
