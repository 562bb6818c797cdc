"""The Rerun viewer as a process of its own, on the desktop or for a browser; it listens on loopback only."""

import importlib.util
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from onboard.user_cache import user_cache
from perchhw.view.errors import ViewError
from perchhw.view.page import LOOPBACK, guarded_page

WEB_PORT = 9090
_START_S = 60.0
_LOOK_S = 0.05
_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
"""Any of them names a screen, on Linux."""


@dataclass(frozen=True)
class Viewer:
    """A viewer that takes recordings.

    Attributes:
        feed: where recordings are sent to.
        page: what a browser opens, whole; None on the desktop.
        process: the viewer.
    """

    feed: str
    page: str | None
    process: "subprocess.Popen[bytes]"

    @property
    def closed(self) -> bool:
        """Whether somebody has closed it.

        Raises:
            ViewError: it ended by itself.
        """
        code = self.process.poll()
        if code:
            raise ViewError(
                f"the Rerun viewer has failed (code {code}); without a screen use --web or --save"
            )
        return code is not None

    def close(self) -> None:
        """End it at once, also where it hangs."""
        self.process.kill()
        self.process.wait()

    @property
    def address(self) -> str | None:
        """The page's address to read and to type: a browser that opens it gets the page."""
        return None if self.page is None else self.page.partition("?")[0]


def open_desktop_viewer() -> Viewer:
    """Open the viewer's window; it stays open when this process ends.

    Raises:
        ViewError: it does not start, for example without a screen.
    """
    _require_screen()
    port = _free_port()
    process = _start(["--port", str(port), "--expect-data-soon"], (port,), "without a screen use --web")
    return Viewer(_feed(port), None, process)


def _require_screen() -> None:
    """The viewer takes connections before it finds that no window can open: look for a screen first.

    Raises:
        ViewError: there is none.
    """
    if sys.platform.startswith("linux") and not any(map(os.environ.get, _SCREENS)):
        raise ViewError(
            "no screen here for a window: fly with --view web, look with perchhw view RUN --web, or write "
            "a file (perchhw view RUN --save FILE.rrd)"
        )


@contextmanager
def web_viewer(port: int | None = None) -> Iterator[Viewer]:
    """Serve the viewer to a browser on this machine until the end of the block.

    Args:
        port: of the page; 0: a free one; None: 9090, or a free one where that is taken.

    Raises:
        ViewError: it does not start.
    """
    feed, original = _free_port(), _free_port()
    if port is None:
        port = WEB_PORT if _is_free(WEB_PORT) else _free_port()
    elif port == 0:
        port = _free_port()
    elif not _is_free(port):
        raise ViewError(f"--port {port}: taken by another program; give another one")
    arguments = ["--serve-web", "--port", str(feed), "--web-viewer-port", str(original)]
    process = _start(arguments, (feed, original), "see above")
    try:
        with guarded_page(port, original, _feed(feed), feed) as page:
            yield Viewer(_feed(feed), page, process)
    finally:
        _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """Close a viewer."""
    process.terminate()
    with suppress(subprocess.TimeoutExpired):
        process.wait(timeout=5.0)
        return
    process.kill()
    process.wait()


def _start(arguments: Sequence[str], ports: Sequence[int], remedy: str) -> "subprocess.Popen[bytes]":
    """Start the viewer, and wait until it takes connections on `ports`."""
    process = subprocess.Popen(
        [program(), "--bind", LOOPBACK, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=sys.stderr.fileno(),
        env=_quiet_environment(),
        start_new_session=True,
    )
    deadline = time.monotonic() + _START_S
    while not all(_answers(port) for port in ports):
        if process.poll() is not None:
            raise ViewError(f"the Rerun viewer ended at once (code {process.returncode}): {remedy}")
        if time.monotonic() > deadline:
            process.kill()
            raise ViewError(f"the Rerun viewer did not start within {_START_S:g} s: {remedy}")
        time.sleep(_LOOK_S)
    return process


def program() -> str:
    """The viewer that came with rerun-sdk, itself: a wrapper around it would leave it behind when ended.

    Raises:
        ViewError: there is none.
    """
    package = importlib.util.find_spec("rerun_cli")
    if package is not None and package.origin is not None:
        bundled = Path(package.origin).parent / "rerun"
        if bundled.is_file():
            return str(bundled)
    found = shutil.which("rerun")
    if found is None:
        raise ViewError("the program rerun is not found: pip install 'perchhw[view]'")
    return found


def _quiet_environment() -> dict[str, str]:
    """The environment with a configuration in which Rerun tells nobody that it is used (on Linux)."""
    environment = {**os.environ, "XDG_CONFIG_HOME": str(user_cache() / "rerun"), "RUST_LOG": "error"}
    quiet = [program(), "analytics", "disable"]
    subprocess.run(quiet, env=environment, capture_output=True, check=False, timeout=_START_S)
    return environment


def _feed(port: int) -> str:
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
    return True


def _answers(port: int) -> bool:
    with suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=1.0):
        return True
    return False
