"""The simulated lab as a child process, reached only by the URIs that it prints."""

import json
import queue
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from perchhw.errors import FlightStackError

FREE_PORTS = ("--drone-port", "0", "--vicon-port", "0", "--vicon-udp-port", "0")
"""Arguments for a lab that takes the ports that are free."""
LOCKSTEP = ("--pace", "lockstep")
"""Arguments for a lab that waits for those who fly in it."""


class LabNotReady(FlightStackError):
    """The simulated lab did not start."""


class SimulatedLab:
    """``perchhw sim lab`` (or another part), stopped on exit.

    Args:
        part: ``lab``, ``drone``, ``room`` or ``bench``.
        arguments: further arguments of ``perchhw sim PART``; default: a lab on free ports, in lock step.
        timeout_s: how long the start may take (the first one compiles the physics), s.

    Attributes:
        ready: the lab's ready line.
        drones: URIs of its drones.
        mocap: URIs of its mocap streams.
    """

    def __init__(
        self,
        part: str = "lab",
        arguments: Sequence[str] = (*FREE_PORTS, *LOCKSTEP),
        timeout_s: float = 300.0,
    ) -> None:
        self._command = [sys.executable, "-m", "perchhw", "sim", part, "--with-parent", *arguments]
        self._timeout_s = timeout_s
        self._process: subprocess.Popen[str] | None = None
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._errors: deque[str] = deque(maxlen=20)
        self._readers: tuple[threading.Thread, ...] = ()
        self.ready: dict[str, Any] = {}

    @property
    def drones(self) -> list[str]:
        """URIs of the simulated drones."""
        return list(self.ready.get("drones", []))

    @property
    def mocap(self) -> list[str]:
        """URIs of the simulated mocap streams, Vicon DataStream first."""
        return list(self.ready.get("mocap", []))

    @property
    def lab_file(self) -> Path:
        """The lab file of its room.

        Raises:
            LabNotReady: it has none yet or any more, or is a part that has no room with a drone.
        """
        if self._process is not None and self._process.poll() is not None:
            raise LabNotReady("no lab file: the simulated lab was closed, or has ended: open another")
        if "lab" not in self.ready:
            raise LabNotReady(
                "no lab file: the simulated lab is not running, or not a whole one: open it first"
            )
        return Path(self.ready["lab"])

    @property
    def pid(self) -> int:
        """Process id of the lab."""
        if self._process is None:
            raise LabNotReady("the simulated lab is not running: open it first")
        return self._process.pid

    def open(self) -> Self:
        """Start the lab and wait for its ready line.

        Raises:
            LabNotReady: it ended or stayed silent; the message has what it said.
        """
        process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,  # ends with this process, however that ends
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self._process = process
        self._readers = (
            threading.Thread(target=_drain, args=(process.stdout, self._lines.put), daemon=True),
            threading.Thread(target=_drain, args=(process.stderr, self._keep_error), daemon=True),
        )
        for reader in self._readers:
            reader.start()
        try:
            line = self._lines.get(timeout=self._timeout_s)
        except queue.Empty:
            line = None
        except BaseException:
            self.close()
            raise
        if line is None:
            self.close()
            said = "".join(self._errors).strip() or "nothing"
            raise LabNotReady(
                f"`perchhw {' '.join(self._command[3:])}` did not become ready; it said: {said}"
            )
        self.ready = json.loads(line)
        return self

    def _keep_error(self, line: str | None) -> None:
        if line is not None:
            self._errors.append(line)

    def close(self) -> None:
        """Interrupt the lab and wait until it is gone; kill it when it does not go."""
        process = self._process
        if process is None:
            return
        process.send_signal(signal.SIGINT)  # does nothing when it has already ended
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdin is not None:
            process.stdin.close()
        for reader in self._readers:
            reader.join()

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _drain(stream: IO[str] | None, take: Callable[[str | None], None]) -> None:
    """Give each line of a child's pipe to `take`, then ``None`` at its end."""
    if stream is not None:
        with stream:
            for line in stream:
                take(line)
    take(None)
