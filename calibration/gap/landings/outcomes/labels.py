"""Real outcomes of flights: ``labels.csv`` beside the files, columns ``file`` and ``outcome``."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from calibration.errors import CalibrationError
from calibration.gap.data.record import NotUsed
from onboard.arrays import FloatArray, IntArray
from onboard.csv_file import read_csv
from onboard.errors import InputError
from onboard.outcome import Outcome

LABELS_FILE = "labels.csv"

FOUR, TWO, NONE = 0, 1, 2
"""Classes that a score counts: three or four legs, one or two, none."""

CLASS_NAMES = ("four", "two", "none")

_LISTED = 3
"""Names in a message."""

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


def classes_of(feet: IntArray) -> IntArray:
    """Classes (n,) of landings, from how many feet held in each (n,)."""
    return np.where(feet >= 3, FOUR, np.where(feet == 0, NONE, TWO))


def shares_of(feet: IntArray) -> FloatArray:
    """Shares (3,) of the classes among landings, from how many feet held in each (n,)."""
    classes = classes_of(feet)
    return np.array([np.mean(classes == one) for one in (FOUR, TWO, NONE)])


def read_labels(sources: Iterable[Path]) -> dict[Path, Outcome]:
    """Outcomes by flight file, from the tables beside these files; flights without one are left out.

    Raises:
        LabelsFileError: a table is broken, or all of its names are spelt otherwise than the files.
    """
    files = list(sources)
    known: dict[Path, Outcome] = {}
    for table in _tables(files):
        own = _read(table)
        if own and not any(file.exists() for file in own):
            beside = [file.name for file in files if file.parent == table.parent]
            raise LabelsFileError(
                f"{table}: none of the flights that it names is beside it ({_listed([*own])}); those that "
                f"are there are called {_listed(beside)}: write them so in the column file, with their "
                "ending, or take the table away"
            )
        known |= own
    return {file: known[file] for file in files if file in known}


def lost_labels(sources: Iterable[Path]) -> tuple[NotUsed, ...]:
    """Tables beside these files that name flights which are not there: a name that is spelt otherwise; and
    tables a folder above flights that have none beside them.

    Raises:
        LabelsFileError: a table is broken.
    """
    files, found = list(sources), []
    tables = _tables(files)
    for table in tables:
        lost = [file for file in _read(table) if not file.exists()]
        if lost:
            reason = f"names flights that are not beside it: {_listed(lost)}"
            found.append(NotUsed(str(table), reason))
    folders = dict.fromkeys(file.parent.resolve() for file in files)
    read = {table.resolve() for table in tables}
    for folder in folders:
        above = folder.parent / LABELS_FILE
        if folder / LABELS_FILE not in read and above not in read and above.is_file():
            reason = f"is not beside the flights, and so not read: put it into {folder}"
            found.append(NotUsed(str(above), reason))
    return tuple(found)


def _listed(files: Sequence[Path | str]) -> str:
    more = f" and {len(files) - _LISTED} more" if len(files) > _LISTED else ""
    return ", ".join(Path(file).name for file in files[:_LISTED]) + more


def _tables(files: Iterable[Path]) -> list[Path]:
    folders = dict.fromkeys(file.parent for file in files)
    return [folder / LABELS_FILE for folder in folders if (folder / LABELS_FILE).is_file()]


def _read(table: Path) -> dict[Path, Outcome]:
    rows = read_csv(table, LabelsFileError)
    found: dict[Path, Outcome] = {}
    for row, name, text in zip(rows.rows, rows.text("file"), rows.text("outcome"), strict=True):
        if not text:
            continue  # a flight that nobody classified
        if table.parent / name in found:
            raise rows.problem(row, "file", f"{name} was classified in a row above; leave one")
        try:
            found[table.parent / name] = Outcome(text)
        except ValueError:
            raise rows.problem(row, "outcome", f"{text!r} is none of {', '.join(Outcome)}") from None
    return found
