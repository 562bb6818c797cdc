"""How far long work is, on stderr: a line or bar that changes on a terminal, a line per change elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from perchhw.consoles import progress_console

if TYPE_CHECKING:
    from rich.console import Console

_TENTHS = 10


@contextmanager
def activity(first: str) -> Iterator[Callable[[str], None]]:
    """Tells what is being done, beginning with `first`."""
    screen = progress_console()
    if screen.is_terminal:
        with screen.status(first) as status:
            yield status.update
        return

    def tell(what: str) -> None:
        screen.print(what, markup=False, soft_wrap=True)

    tell(first)
    yield tell


@contextmanager
def share_done(what: str, screen: "Console | None" = None) -> Iterator[Callable[[float, float], None]]:
    """Tells how much of `what` is done, by calls with how much is and how much there is in all.

    Args:
        what: is being done.
        screen: where; on a terminal whoever prints beside a bar must do so through its console.
    """
    screen = progress_console() if screen is None else screen
    if screen.is_terminal:
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
        with Progress(*columns, console=screen) as bar:
            task = bar.add_task(what, total=None)
            yield lambda done, total: bar.update(task, completed=done, total=total)
        return
    told = 0

    def tell(done: float, total: float) -> None:
        nonlocal told
        tenths = int(_TENTHS * done / total + 1e-9) if total else 0
        if tenths > told:
            told = tenths
            screen.print(f"{what}: {100 * tenths // _TENTHS} %", markup=False, soft_wrap=True)

    yield tell
