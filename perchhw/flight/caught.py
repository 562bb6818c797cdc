"""The one place where errors of every kind are caught: in flight, none may end what lands the drone."""

from collections.abc import Callable
from types import TracebackType
from typing import Self


class Caught:
    """Hands an error of the block to `tell` and goes on after the block. Only what ends a process passes.

    ``SystemExit`` ends none here: a library's way to give up (a console whose pipe has closed) is an error.

    Args:
        tell: what becomes of the error; it must not be lost.
    """

    def __init__(self, tell: Callable[[BaseException], None]) -> None:
        self._tell = tell

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if not isinstance(error, (Exception, SystemExit)):
            return False
        self._tell(error)
        return True
