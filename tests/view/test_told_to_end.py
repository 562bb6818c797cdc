"""A viewer that is told to end does so, also where Python drops the signal's exception."""

import gc
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from perchhw.cli.view import until_told_to_end
from perchhw.view.errors import ViewError
from perchhw.view.show import Show
from perchhw.view.viewer import Viewer
from tests.view.flown import record


@pytest.fixture(params=[signal.SIGTERM, signal.SIGINT])
def number(request: pytest.FixtureRequest) -> Iterator[signal.Signals]:
    before = {one: signal.getsignal(one) for one in (signal.SIGTERM, signal.SIGINT)}
    yield request.param
    for one, handler in before.items():
        signal.signal(one, handler)


class Finalized:
    """Gone, it lets a signal strike where nobody can catch its exception."""

    def __init__(self, number: signal.Signals) -> None:
        self.number = number
        self.itself = self

    def __del__(self) -> None:
        os.kill(os.getpid(), self.number)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_next_wait_ends_it_when_the_exception_was_lost(number: signal.Signals) -> None:
    wait = until_told_to_end()
    wait(0.0)
    Finalized(number)
    gc.collect()  # the exception is dropped here
    with pytest.raises(KeyboardInterrupt):
        wait(0.0)


def test_elsewhere_it_ends_at_once(number: signal.Signals) -> None:
    until_told_to_end()
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), number)


class NeverFlushed:
    """A stream to a viewer that took the connection and answers nothing: Rerun would wait for ever."""

    def __init__(self, *_: object, **__: object) -> None:
        pass

    def flush(self, *, timeout_sec: float = 1e38) -> None:
        assert timeout_sec < 10.0, "no signal is heard meanwhile"
        raise RuntimeError("timeout")

    def connect_grpc(self, *_: object, **__: object) -> None:
        pass

    def disconnect(self) -> None:
        pass

    def __getattr__(self, _: str) -> object:
        return lambda *_, **__: None


class NeverLetsGo(NeverFlushed):
    """As Rerun: a stream leaves a viewer that hangs only when that has died."""

    viewer: "subprocess.Popen[bytes]"

    def disconnect(self) -> None:
        self.viewer.wait(timeout=30.0)


@pytest.mark.parametrize("impatient", [False, True])
def test_a_viewer_that_hangs_is_closed_by_one_who_leaves(
    impatient: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rerun.RecordingStream", NeverLetsGo)
    monkeypatch.setattr("perchhw.view.show._LET_GO_WITHIN_S", 20.0 if impatient else 0.1)
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        monkeypatch.setattr(NeverLetsGo, "viewer", process, raising=False)

        def told(_: float) -> None:
            if impatient:  # a second Ctrl-C, while it waits for the viewer
                threading.Timer(0.3, os.kill, [os.getpid(), signal.SIGINT]).start()
            raise KeyboardInterrupt

        show = Show(record(tmp_path / "run"), Viewer("rerun+http://127.0.0.1:1/proxy", None, process), told)
        with pytest.raises(KeyboardInterrupt):
            show.run(0.0, 0.0)
        assert process.poll() == -signal.SIGKILL


@pytest.mark.parametrize("ended", [False, True])
def test_a_viewer_that_takes_nothing_keeps_nobody_from_ending(
    ended: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rerun.RecordingStream", NeverFlushed)
    code = "raise SystemExit(1)" if ended else "input()"
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE) as process:
        if ended:
            process.wait()

        def told(_: float) -> None:
            raise KeyboardInterrupt

        show = Show(record(tmp_path / "run"), Viewer("rerun+http://127.0.0.1:1/proxy", None, process), told)
        try:
            with pytest.raises(ViewError if ended else KeyboardInterrupt):
                show.run(0.0, 0.0)
        finally:
            process.kill()
