"""Show a run, or the newest below a folder and the next after it: in a viewer, or into a file."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from onboard.record.folder import OutputFolderError, make_folder, utc_now
from onboard.record.growing_run import GrowingRun
from onboard.record.run_record import EVENTS_FILE, RUN_FILE, SERIES_FILE, RunFolderError, is_run_folder
from perchhw.view.blueprint import make_blueprint
from perchhw.view.errors import ViewError, require_rerun
from perchhw.view.flight_view import LOOK_PERIOD_S, follow
from perchhw.view.viewer import Viewer

if TYPE_CHECKING:
    import rerun

APPLICATION = "perchhw"
_HEARD_EVERY_S, _TAKEN_WITHIN_S, _LET_GO_WITHIN_S = 1.0, 60.0, 5.0
QUIET_S = 60.0
"""A record that was not closed and has not grown for so long has lost its writer, s."""


def write_rrd(folder: Path, out: Path) -> Path:
    """Write a run as a Rerun recording; one that grows until its end.

    Args:
        folder: the run.
        out: the file to write (``.rrd``).

    Raises:
        ViewError: rerun-sdk is not installed, or `out` cannot be written.
        RunFolderError: the record cannot be read.
    """
    require_rerun()
    run = GrowingRun(folder)
    try:
        make_folder(out.parent)
    except OutputFolderError as error:
        raise ViewError(f"{out.parent}: cannot be written ({error.reason}); give a file elsewhere") from error
    try:
        stream = _recording(folder)
        try:
            stream.save(out, default_blueprint=make_blueprint())
            follow(run, stream, time.sleep, lambda: not _is_written(folder), stream.flush)
        finally:
            stream.disconnect()
    except RuntimeError as error:  # Rerun's, when the disk takes no more
        raise ViewError(f"{out}: cannot be written ({error}); make room, or give another file") from error
    return out


@dataclass
class Show:
    """Feeds a viewer.

    Args:
        root: a run, or a folder whose newest run is meant.
        viewer: what it is shown in.
        wait: waits for so long, s.
    """

    root: Path
    viewer: Viewer
    wait: Callable[[float], object] = time.sleep

    def run(self, first_s: float, next_s: float) -> None:
        """Show what there is and what comes, until nothing has come for `next_s`, or the viewer is closed.

        Args:
            first_s: how long the first run may take to begin, s.
            next_s: after the end of one: for how long the next is waited for, or a viewer kept open, s.

        Raises:
            RunFolderError: there is no run, or one is damaged.
            ViewError: the viewer failed.
        """
        shown: Path | None = None
        while (folder := self._next(shown, next_s if shown else first_s)) is not None:
            self._show(folder)
            shown = folder

    def _next(self, shown: Path | None, patience_s: float) -> Path | None:
        """The newest run, once it is another than the one `shown`; None when it does not come."""
        deadline = time.monotonic() + patience_s
        while True:
            newest = newest_run(self.root)
            if newest is not None and newest != shown:
                return newest
            if self.viewer.closed or time.monotonic() >= deadline:
                if shown is None:
                    raise RunFolderError(f"{self.root}: no run here to show; give a run folder")
                return None
            self.wait(LOOK_PERIOD_S)

    def _show(self, folder: Path) -> None:
        def over() -> bool:
            return self.viewer.closed or newest_run(self.root) != folder or not _is_written(folder)

        stream = _recording(folder)
        try:
            stream.connect_grpc(self.viewer.feed, default_blueprint=make_blueprint())
            follow(GrowingRun(folder), stream, self.wait, over, lambda: self._taken(stream))
        except RuntimeError as error:  # Rerun's, when what is sent does not arrive
            if not self.viewer.closed:
                raise ViewError(f"the viewer takes nothing any more ({error}); open it again") from error
        finally:
            self._let_go(stream)

    def _taken(self, stream: "rerun.RecordingStream") -> None:
        """Wait until the viewer has what was sent. Rerun waits for a dead one for ever, and hears no signal
        meanwhile: every second one is heard here, and whether the viewer lives is asked.

        Raises:
            RuntimeError: it takes nothing. ViewError: it failed.
        """
        until = time.monotonic() + _TAKEN_WITHIN_S
        while True:
            try:
                stream.flush(timeout_sec=_HEARD_EVERY_S)
            except RuntimeError:
                if self.viewer.closed or time.monotonic() > until:
                    raise
                self.wait(0.0)
            else:
                return

    def _let_go(self, stream: "rerun.RecordingStream") -> None:
        """Disconnect. Rerun waits for a viewer that hangs for ever, here and when Python ends: such a one is
        closed, also where somebody does not want to wait for it."""
        gone = threading.Event()  # a join that a signal interrupts leaves a thread that says it has ended

        def leave() -> None:
            try:
                stream.disconnect()
            finally:
                gone.set()

        threading.Thread(target=leave, name="disconnect", daemon=True).start()
        try:
            gone.wait(_LET_GO_WITHIN_S)
        finally:
            if not gone.is_set():
                self.viewer.close()
                gone.wait(_LET_GO_WITHIN_S)


def newest_run(root: Path) -> Path | None:
    """The run itself, or the newest below a folder, whose names begin with the time; None: there is none."""
    if is_run_folder(root):
        return root
    runs = (path.parent for path in root.rglob(RUN_FILE))
    return max((run for run in runs if is_run_folder(run)), key=lambda run: run.name, default=None)


def _is_written(folder: Path) -> bool:
    """Whether somebody has put something into the record lately."""
    files = [folder / name for name in (RUN_FILE, SERIES_FILE, EVENTS_FILE)]
    newest = max((file.stat().st_mtime for file in files if file.exists()), default=0.0)
    return utc_now().timestamp() - newest < QUIET_S


def _recording(folder: Path) -> "rerun.RecordingStream":
    import rerun as rr

    return rr.RecordingStream(APPLICATION, recording_id=folder.resolve().name)
