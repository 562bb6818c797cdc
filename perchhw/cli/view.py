"""``perchhw view``: a flight in the Rerun viewer, while it is flown or afterwards."""

import math
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from perchhw.cli.output import emit

app = typer.Typer(add_completion=False)

_NICE = 10
"""What is looked at yields to what flies."""


@app.command()
def view(
    run: Annotated[
        Path, typer.Argument(help="A run folder, or a folder whose newest run is meant, as of a campaign.")
    ] = Path("runs"),
    web: Annotated[
        bool, typer.Option("--web", help="Serve it to a browser on this machine instead of opening a window.")
    ] = False,
    port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="With --web: port of the page, 0 for a free one; default: 9090, or a free one.",
        ),
    ] = None,
    save: Annotated[
        Path | None, typer.Option(help="Write a recording (.rrd) instead, to be opened with `rerun FILE`.")
    ] = None,
    wait: Annotated[float, typer.Option(help="How long the run may take to begin, s.")] = 0.0,
    linger: Annotated[
        float | None,
        typer.Option(
            help="How long to wait for the next run, or serve on, when one has ended, s. "
            "Default: with --web until interrupted, else 0."
        ),
    ] = None,
) -> int:
    """Show a run in Rerun: the room, the optical-flow space, cues, motors, health and what happened.

    A run that is being flown is followed as its record grows; drone and flight do not notice. Everything is
    served on 127.0.0.1 only.
    """
    from onboard.record.growing_run import GrowingRun
    from perchhw.view.errors import ViewError, require_rerun
    from perchhw.view.show import Show, newest_run, write_rrd
    from perchhw.view.viewer import open_desktop_viewer, web_viewer

    require_rerun()
    if save is not None:
        if web or port is not None:
            raise ViewError("--save writes a file, --web serves a page: give one of them")
        folder = newest_run(run) or run
        emit({"run": str(folder), "file": str(write_rrd(folder, save))}, str(save))
        return 0
    if newest_run(run) is None and wait <= 0.0:
        raise ViewError(f"{run}: no run here to show; give a run folder, or --wait for one")
    if (shown := newest_run(run)) is not None:
        GrowingRun(shown).look()  # what is damaged is told before anything opens
    os.nice(_NICE)
    wait_or_end = until_told_to_end()
    with web_viewer(port) if web else nullcontext(open_desktop_viewer()) as viewer:
        emit({"run": str(run), "url": viewer.page}, f"view: {viewer.address or 'opened'}")
        sys.stdout.flush()
        Show(run, viewer, wait_or_end).run(wait, linger if linger is not None else (math.inf if web else 0.0))
    return 0


def until_told_to_end() -> Callable[[float], None]:
    """A wait (s) that Ctrl-C and SIGTERM end, so that no page is left behind.

    Python drops a signal's exception where it strikes a callback of Rerun's or a finalizer; the next wait
    raises it again.
    """
    told = threading.Event()

    def end(number: int, frame: object) -> None:
        told.set()
        raise KeyboardInterrupt

    def wait(seconds: float) -> None:
        if told.wait(seconds):
            raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, end)
    return wait
