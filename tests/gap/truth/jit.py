"""How the kernels of the hidden flights are compiled: as ours, and kept on disk until any file of this folder
changes, which the project's own cache, named after the project's source, does not look at.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from onboard.jit import APART, kept

Array = np.ndarray

_FILES = sorted(Path(__file__).parent.glob("*.py"))
_STATE = hashlib.sha256(
    b"\0".join(file.name.encode() + b"\0" + file.read_bytes() for file in _FILES)
).hexdigest()


def jitted(function: Callable[..., Any]) -> Any:
    """Compiled free of the interpreter lock, with IEEE division; kept under the state of all files here."""
    dispatcher: Any = kept(**APART)(function)
    if dispatcher is not function:  # numba is not told to leave it to Python
        dispatcher._cache._cache_file._source_stamp = _STATE  # numba has no public way to it
    return dispatcher
