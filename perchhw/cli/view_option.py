"""``--view``: the live view of a verb that flies, as a process of its own beside it."""

import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from perchhw.screen.display import Display

_FLAG = "--view"
_BEGIN_S = 3600
"""How long a viewer waits for the first record: checks and questions come first, s."""
_LINGER_S = 600
"""How long it waits for the next one, or serves its page on, when one has ended, s."""

_OPENS_WITHIN_S = 10.0
"""How long a command that is over waits for a viewer's address, s."""


class ViewKind(StrEnum):
    """Where a live view is seen."""

    DESKTOP = "desktop"
    WEB = "web"


LiveView = Annotated[
    ViewKind | None,
    typer.Option(
        _FLAG, help="Show the flight in Rerun while it is flown: web for a browser; alone, a window."
    ),
]


def complete_view_option(arguments: Sequence[str]) -> list[str]:
    """The arguments with the kind of view after a ``--view`` that stands alone, which Typer cannot read."""
    limit = list(arguments).index("--") if "--" in arguments else len(arguments)
    completed: list[str] = []
    for place, argument in enumerate(arguments):
        completed.append(argument)
        following = arguments[place + 1] if place + 1 < limit else ""
        if place < limit and argument == _FLAG and following not in tuple(ViewKind):
            completed.append(ViewKind.DESKTOP)
    return completed


@contextmanager
def live_view(kind: ViewKind | None, folder: Path, display: "Display") -> Iterator[None]:
    """A viewer on the records in `folder` while the block flies; it goes on afterwards, to be looked at.

    The flight does not wait for it: the viewer reads the files. Its address, or why there is none, is told on
    the display. Where nothing was recorded it is ended.

    Raises:
        ViewError: Rerun is not installed.
    """
    if kind is None:
        yield
        return
    from perchhw.view.errors import require_rerun
    from perchhw.view.show import newest_run

    require_rerun()
    command = [sys.executable, "-m", "perchhw", "view", str(folder)]
    command += ["--wait", str(_BEGIN_S), "--linger", str(_LINGER_S)]
    command += ["--web"] if kind is ViewKind.WEB else []
    with tempfile.TemporaryFile() as complaints:
        viewer = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=complaints,
            start_new_session=True,
        )
        told = threading.Thread(target=_tell, args=(viewer, complaints, display), name="view", daemon=True)
        told.start()
        try:
            yield
            told.join(_OPENS_WITHIN_S)
        finally:
            if newest_run(folder) is None:
                viewer.terminate()
                viewer.wait()


def _tell(viewer: "subprocess.Popen[bytes]", complaints: IO[bytes], display: "Display") -> None:
    """Its one line, or what it complained of last."""
    assert viewer.stdout is not None
    with viewer.stdout:
        said = viewer.stdout.readline().decode().strip()
    if not said and viewer.wait() > 0:
        with suppress(ValueError):  # the command has ended, too
            complaints.seek(0)
            complaint = complaints.read().decode(errors="replace").strip().rpartition("\n")[2]
            said = f"no view: {complaint.removeprefix('error: ')}"
    if said:
        display.viewed(said)
