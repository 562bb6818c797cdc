"""How the kernels of the hidden flights are compiled: kept on disk until any file of this folder changes.

Numba keeps a kernel under the time stamp of its own file, and does not see that a function which it calls
from another one, or a constant, has changed.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

Array = np.ndarray


def _state_of_the_files() -> str:
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()


_STATE = _state_of_the_files()


def jitted(function: Callable[..., Any]) -> Any:
    """Compiled free of the interpreter lock, with IEEE division; kept under the state of all files here."""
    dispatcher = njit(cache=True, nogil=True, error_model="numpy")(function)
    if dispatcher is not function:  # numba is not told to leave it to Python
        dispatcher._cache._cache_file._source_stamp = _STATE  # numba has no public way to it
    return dispatcher
