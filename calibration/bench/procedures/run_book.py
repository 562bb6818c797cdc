"""The book of one calibration run: a folder in which each finished step and each recording is kept.

``state.json`` is replaced as a whole after every step, recordings are written, flushed and hashed before the
step that made them counts; a crash or an interruption loses the running step and nothing else. Before the
first of either nothing is written: a run that never began leaves no trace.
"""

import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from calibration.bench.procedures.operator import Operator, StepAgain, StepBack, StepSkipped
from calibration.errors import CalibrationError
from onboard.errors import InputError
from onboard.json_file import parsed, write_json_atomically
from onboard.record.folder import OutputFolderError, require_writable
from onboard.schema import schema_problem

STATE_FILE = "state.json"
RAW_FOLDER = "raw"
SCHEMA = "perchhw.calibration-run/1"

Json = dict[str, Any]


class RunBookError(CalibrationError, InputError):
    """A run folder that cannot be used: another kind of run, or a file that is damaged."""


class RunBook:
    """Steps and recordings of one run.

    Attributes:
        folder: of the run.
        operator: who carries out the steps.
    """

    def __init__(self, folder: Path, kind: str, settings: Json, operator: Operator) -> None:
        """Open the book in `folder`, or begin it: with the first step or recording something is written.

        Args:
            folder: of the run; made with what is first written.
            kind: of calibration ("bifilar").
            settings: what must be the same when a run goes on (vehicle, number of trials).
            operator: who carries out the steps.

        Raises:
            RunBookError: the folder holds another kind of run, or one with other settings.
        """
        self.folder = folder
        self.operator = operator
        self._path = folder / STATE_FILE
        fresh: Json = {"schema": SCHEMA, "kind": kind, "settings": settings, "steps": {}}
        self._state: Json = self._read(kind, settings) if self._path.is_file() else fresh
        self._begun = 0

    def _read(self, kind: str, settings: Json) -> Json:
        try:
            state: Json = parsed(self._path.read_text(encoding="utf-8"))
            problem = schema_problem(state.get("schema"), SCHEMA)
            if problem is not None:
                raise RunBookError(f"{self._path}: schema {problem}; give another folder with --out")
            same_kind, kept = state["kind"] == kind, state["settings"]
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise RunBookError(
                f"{self._path}: is damaged ({error}); move the folder away, recordings in "
                f"{RAW_FOLDER}/ can be read with --from-log"
            ) from error
        if not same_kind:
            raise RunBookError(f"{self._path}: is a {state['kind']} run; give another folder with --out")
        different = [key for key in {*kept, *settings} if kept.get(key) != settings.get(key)]
        if different:
            said = ", ".join(f"{key} was {kept.get(key)!r}" for key in sorted(different))
            raise RunBookError(f"{self._path}: was begun otherwise ({said}); say the same, or a new --out")
        return state

    @property
    def steps(self) -> dict[str, Json]:
        """Results of the finished steps by key, oldest first."""
        return {key: entry["result"] for key, entry in self._state["steps"].items()}

    @property
    def skipped(self) -> list[str]:
        """Steps that the operator left out."""
        return [key for key, entry in self._state["steps"].items() if entry.get("skipped")]

    def step(self, key: str, title: str, work: Callable[[], Json]) -> Json:
        """The result of a step: from the book when it is done, else worked out and written down.

        Raises:
            StepBack: the operator wants the step before: it is forgotten, run the wizard from its start.
            OutputFolderError: its result cannot be kept; where that can be known, before anybody works.
        """
        self._begun += 1
        entry = self._state["steps"].get(key)
        if entry is not None:
            result: Json = entry["result"]
            return result
        require_writable(self.folder)
        self.operator.begin(title, self._begun)
        while True:
            try:
                return self._write(key, {"result": work()})
            except StepAgain:
                continue
            except StepSkipped:
                return self._write(key, {"result": {}, "skipped": True})
            except StepBack:
                self._forget_last()
                raise

    def _write(self, key: str, entry: Json) -> Json:
        self._state["steps"][key] = entry
        self._save()
        result: Json = entry["result"]
        return result

    def _forget_last(self) -> None:
        if self._state["steps"]:
            self._state["steps"].popitem()
            self._save()

    def forget(self, *keys: str) -> None:
        """Take steps back, whose results cannot be used; their recordings stay."""
        for key in keys:
            self._state["steps"].pop(key, None)
        self._save()

    def restart(self) -> None:
        """Count the steps from one again, before a wizard runs from its start."""
        self._begun = 0

    def keep_raw(self, stem: str, write: Callable[[Path], None], suffix: str = ".csv.gz") -> Json:
        """Keep a recording as ``raw/STEM-N.csv.gz`` with a number that is free.

        Args:
            stem: what it is.
            write: writes the file it is given.
            suffix: of its name.

        Returns:
            ``{file, sha256}``, once the file is on the disk.

        Raises:
            OutputFolderError: it cannot be written.
        """
        with self._kept():
            (self.folder / RAW_FOLDER).mkdir(parents=True, exist_ok=True)
            number = 1 + len(list((self.folder / RAW_FOLDER).glob(f"{stem}-*{suffix}")))
            name = f"{RAW_FOLDER}/{stem}-{number}{suffix}"
            path = self.folder / name
            write(path)
            with path.open("rb+") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
                os.fsync(stream.fileno())
        return {"file": name, "sha256": digest}

    def _save(self) -> None:
        with self._kept():
            self.folder.mkdir(parents=True, exist_ok=True)
            write_json_atomically(self._path, self._state)

    @contextmanager
    def _kept(self) -> Iterator[None]:
        """What the disk does not take, as an error of ours."""
        try:
            yield
        except OSError as error:
            raise OutputFolderError(self.folder, error.strerror) from error
