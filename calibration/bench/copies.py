"""Recordings that are given twice: by their numbers, not by the names of their files.

How much repeats differ is what the intervals of the bench rest on, and a copy does not differ.
"""

from collections.abc import Iterable
from pathlib import Path

from calibration.errors import CalibrationError
from onboard.arrays import FloatArray
from onboard.errors import InputError


class CopiedRecordingError(CalibrationError, InputError):
    """Two recordings hold the same numbers; the message names both."""


def refuse_copies(recordings: Iterable[tuple[Path, tuple[FloatArray, ...]]]) -> None:
    """See that no recording is a copy of another.

    Args:
        recordings: file, and what was measured in it.

    Raises:
        CopiedRecordingError: one is.
    """
    known: dict[bytes, Path] = {}
    for file, columns in recordings:
        numbers = b"".join(column.tobytes() for column in columns)
        if numbers in known:
            raise CopiedRecordingError(
                f"{file} is the same recording as {known[numbers]}: give it once, for repeats say how much "
                "measurements differ, and a copy does not"
            )
        known[numbers] = file
