"""A peer's benchmark as a subprocess that takes turns with ours, so that both see the same machine."""

import json
import shutil
import statistics
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any

PEERS = Path(__file__).resolve().parent / "peers"


class PeerProcess:
    """One script of `benchmarks/peers` in a Python that has its packages.

    Use as a context manager. Attributes:
        reason: why there is nothing to measure; None while the peer runs.
        versions: of the peer's packages.
    """

    def __init__(self, python: str | None, script: str, seconds: float) -> None:
        self._python, self._script, self._seconds = python, script, seconds
        self._process: subprocess.Popen[str] | None = None
        self._turns: list[dict[str, Any]] = []
        self.reason: str | None = "no --peers PYTHON given" if python is None else None
        self.versions: dict[str, str] = {}

    def __enter__(self) -> "PeerProcess":
        if self._python is None:
            return self
        self._folder = tempfile.TemporaryDirectory()  # peers leave logs where they run
        self._complaints = (Path(self._folder.name) / "stderr.txt").open("w+", encoding="utf-8")
        python = shutil.which(self._python)
        command = [
            str(Path(python).absolute()) if python else self._python,
            str(PEERS / self._script),
            str(self._seconds),
        ]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._complaints,
                cwd=self._folder.name,
                text=True,
            )
        except OSError as error:
            self.reason = f"{self._python} does not start: {error}"
            return self
        answer = self._answer()
        if answer is not None:
            self.versions = answer["ready"]["versions"]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
            self._process.wait()
        if self._python is not None:
            self._complaints.close()
            self._folder.cleanup()

    def _answer(self) -> dict[str, Any] | None:
        assert self._process is not None
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):  # the peers' libraries print there as well
                return dict(json.loads(line))
        self._process.wait()
        self._complaints.seek(0)
        last = self._complaints.read().strip().splitlines()[-1:]
        self.reason = f"{self._script} ended with {self._process.returncode}: {''.join(last)}"
        return None

    def turn(self) -> None:
        """Let the peer do one repeat of its cases."""
        if self.reason is not None or self._process is None or self._process.stdin is None:
            return
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        answer = self._answer()
        if answer is not None:
            self._turns.append(answer)

    def result(self) -> dict[str, Any]:
        """Rates of every case (see :func:`rates`), or why there are none."""
        if self.reason is not None:
            return {"measured": False, "reason": self.reason}
        cases = {name: rates([turn[name] for turn in self._turns]) for name in self._turns[0]}
        return {"measured": True, "versions": self.versions, "steps_per_s": cases}


def rates(repeats: list[dict[str, float]]) -> dict[str, float]:
    """Steps a second of wall time and of processor time from repeats of steps, wall_s and cpu_s."""
    wall = [repeat["steps"] / repeat["wall_s"] for repeat in repeats]
    processor = [repeat["steps"] / repeat["cpu_s"] for repeat in repeats]
    return {
        "median": statistics.median(wall),
        "best": max(wall),
        "median_per_cpu_s": statistics.median(processor),
    }
