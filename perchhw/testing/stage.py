"""The process that serves one lab after another (:mod:`sim_backend.stage`), as its parent holds it."""

import json
import os
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from typing import Any, Self

from perchhw.errors import FlightStackError

NO_COMPILATION = {"NUMBA_DISABLE_JIT": "1"}
"""Environment of a process whose drones never fly: nothing in it is worth a compilation."""


class StageFailed(FlightStackError):
    """The process did not start, ended, or refused a command; the message says why."""


class StageProcess:
    """Started by :meth:`open`; :meth:`ask` may be called from any thread.

    Args:
        parked: its drones never fly, and nothing is compiled.
    """

    def __init__(self, parked: bool = False) -> None:
        self._parked = parked
        self._lock = threading.Lock()
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 # closed with the process

    def open(self) -> Self:
        """Start it, and wait until it takes commands; the first start on a machine compiles.

        Raises:
            StageFailed: it ended.
        """
        arguments = ["parked"] if self._parked else []
        self._process = subprocess.Popen(
            [sys.executable, "-m", "sim_backend.stage", *arguments],
            stdin=subprocess.PIPE,  # it ends with this process, however that ends
            stdout=subprocess.PIPE,
            stderr=self._said,
            env={**os.environ, **(NO_COMPILATION if self._parked else {})},
            text=True,
            start_new_session=True,
        )
        self._answer()
        return self

    def ask(self, do: str, **values: Any) -> dict[str, Any]:
        """Send one command and give its answer.

        Raises:
            StageFailed: it was refused, or the process has ended.
        """
        with self._lock:
            if self._process.stdin is None:
                raise StageFailed("the simulated lab's process takes no commands")
            try:
                self._process.stdin.write(json.dumps({"do": do, **values}) + "\n")
                self._process.stdin.flush()
            except BrokenPipeError:
                raise self._ended() from None
            answer = self._answer()
        if "error" in answer:
            raise StageFailed(answer["error"])
        return answer

    def _answer(self) -> dict[str, Any]:
        line = "" if self._process.stdout is None else self._process.stdout.readline()
        if not line:
            raise self._ended()
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _ended(self) -> StageFailed:
        code = self._process.wait()
        self._said.seek(0)
        words = self._said.read().decode("utf-8", "replace").strip()[-2000:]
        return StageFailed(
            f"the simulated lab's process ended with code {code}; it said: {words or 'nothing'}"
        )

    @property
    def alive(self) -> bool:
        """Whether it still runs."""
        return self._process.poll() is None

    def close(self) -> None:
        """End the process."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(BrokenPipeError):  # it has ended, with a command unread
                    pipe.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._said.close()

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(self, *_: object) -> None:
        self.close()
