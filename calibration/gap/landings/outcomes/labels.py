"""Real outcomes of flights: ``labels.csv`` beside the files, columns ``file`` and ``outcome``."""

import csv
from collections.abc import Iterable
from pathlib import Path

from calibration.errors import CalibrationError
from onboard.errors import InputError
from onboard.outcome import Outcome

LABELS_FILE = "labels.csv"

FOUR, TWO, NONE = 0, 1, 2
"""Classes that a score counts: three or four legs, one or two, none."""

CLASS_NAMES = ("four", "two", "none")

_CLASSES = {
    Outcome.FOUR_LEG: FOUR,
    Outcome.FOUR_LEG_BODY_CONTACT: FOUR,
    Outcome.TWO_LEG: TWO,
    Outcome.TWO_LEG_BODY_CONTACT: TWO,
    Outcome.FAILURE: NONE,
}


class LabelsFileError(CalibrationError, InputError):
    """A table of outcomes is broken; the message names file, row and column."""


def landing_class(outcome: Outcome) -> int | None:
    """The class of an outcome; None where nothing was to land (no trigger, aborted)."""
    return _CLASSES.get(outcome)


def read_labels(sources: Iterable[Path]) -> dict[Path, Outcome]:
    """Outcomes by flight file, from the tables beside these files; flights without one are left out.

    Raises:
        LabelsFileError: a table is broken.
    """
    files = list(sources)
    known: dict[Path, Outcome] = {}
    for folder in dict.fromkeys(file.parent for file in files):
        table = folder / LABELS_FILE
        if table.is_file():
            known |= _read(table)
    return {file: known[file] for file in files if file in known}


def _read(table: Path) -> dict[Path, Outcome]:
    with table.open(encoding="utf-8", newline="") as stream:
        reader = csv.DictReader(stream)
        for column in ("file", "outcome"):
            if column not in (reader.fieldnames or ()):
                raise LabelsFileError(f"{table}: no column {column!r}; a table of outcomes has file, outcome")
        found = {}
        for number, row in enumerate(reader, start=2):
            name, text = row["file"], row["outcome"]
            if not text:
                continue  # a flight that nobody classified
            try:
                found[table.parent / name] = Outcome(text)
            except ValueError:
                known = ", ".join(outcome.value for outcome in Outcome)
                raise LabelsFileError(
                    f"{table} row {number} column 'outcome': {text!r} is none of {known}"
                ) from None
        return found
