"""Kernels of hidden worlds: kept on disk until any file of their world changes.

Numba keeps a kernel under the time stamp of its own file, and does not see that a function which it calls
from another one, or a constant, has changed.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from onboard.jit import kept


def stamped(world: Path, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorator of kernels that are kept under the state of all files of the folder `world`, and compiled by
    one of the processes that need them at the same time.

    Args:
        world: folder. options: of numba's njit.
    """
    digest = hashlib.sha256()
    for file in sorted(world.glob("*.py")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    state = digest.hexdigest()

    def compiled(function: Callable[..., Any]) -> Any:
        dispatcher: Any = kept(**options)(function)
        if dispatcher is not function:  # numba is not told to leave it to Python
            dispatcher._cache._cache_file._source_stamp = state  # numba has no public way to it
        return dispatcher

    return compiled
