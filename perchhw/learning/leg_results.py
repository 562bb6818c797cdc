"""What the folder of a leg study holds, read back for its report."""

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import BoolArray, FloatArray
from onboard.outcome import Outcome
from perchhw.learning.bands import best_per_condition
from perchhw.learning.errors import LearningInputError
from perchhw.learning.results import RateMap
from perchhw.learning.sweep_folder import PAIRS_FILE, read_pairs

SCHEMA = "perchhw.leg_study/1"
LANDINGS_FILE, STUDY_FILE = "landings.csv", "study.json"

SWING, GRAVITY, MOMENTUM, WINDOW = "swing_distance", "gravity_energy", "swing_rate", "window_margin_deg"
"""Columns of ``landings.csv`` that stand for the four factors of the paper's section V.E."""

_NUMBERS = ("angle_deg", SWING, GRAVITY, MOMENTUM, WINDOW)


@dataclass(frozen=True)
class Landings:
    """Fresh landings of all designs; all arrays are (n,).

    Attributes:
        design: name of each.
        angle_deg: commanded approach angle.
        success: four legs without contact of body or propellers.
        factors: by column; NaN where nothing touched the ceiling.
    """

    design: NDArray[np.str_]
    angle_deg: FloatArray
    success: BoolArray
    factors: dict[str, FloatArray]


@dataclass(frozen=True)
class LegResults:
    """A leg study.

    Attributes:
        folder: where it is.
        study: ``study.json``.
        maps: best landing rate of the pairs at each condition, by design.
        landings: ``landings.csv``.
    """

    folder: Path
    study: dict[str, Any]
    maps: dict[str, RateMap]
    landings: Landings

    def bands_deg(self) -> list[tuple[float, float]]:
        """Bands of the approach angle that the study uses, right border outside except for 90 deg."""
        bands = {
            tuple(band["angles_deg"]) for design in self.study["designs"].values() for band in design["bands"]
        }
        return sorted((float(low), float(high)) for low, high in bands)


def is_leg_study(folder: Path) -> bool:
    """Whether a folder is one of ``perchhw learn legs``."""
    return (folder / STUDY_FILE).is_file()


def read_leg_study(folder: Path) -> LegResults:
    """Read the folder of a leg study.

    Raises:
        LearningInputError: naming the file and what is wrong with it.
    """
    study = _read_study(folder / STUDY_FILE)
    maps = {}
    for design in study["designs"]:
        rows = tuple(read_pairs(folder / design / PAIRS_FILE).values())
        if not rows:
            raise LearningInputError(f"{folder / design / PAIRS_FILE}: has no trial: run the study again")
        maps[design] = RateMap(design, best_per_condition(rows))
    return LegResults(folder, study, maps, _read_landings(folder / LANDINGS_FILE))


def _read_study(path: Path) -> dict[str, Any]:
    try:
        study = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LearningInputError(f"{path}: cannot be read ({error}): run perchhw learn legs") from error
    if not isinstance(study, dict) or study.get("schema") != SCHEMA or not study.get("designs"):
        raise LearningInputError(f"{path}: is not a leg study of this version ({SCHEMA}): run it again")
    return study


def _read_landings(path: Path) -> Landings:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise LearningInputError(f"{path}: cannot be read ({error}): run the study again") from error
    missing = {"design", "outcome", *_NUMBERS} - (rows[0].keys() if rows else set())
    if missing:
        raise LearningInputError(f"{path}: lacks {', '.join(sorted(missing))}: run the study again")
    numbers = {
        name: np.array([_number(row[name], path, k, name) for k, row in enumerate(rows)]) for name in _NUMBERS
    }
    return Landings(
        design=np.array([row["design"] for row in rows]),
        angle_deg=numbers.pop("angle_deg"),
        success=np.array([row["outcome"] == Outcome.FOUR_LEG.value for row in rows]),
        factors=numbers,
    )


def _number(cell: str | None, path: Path, index: int, column: str) -> float:
    try:
        return float(cell) if cell else float("nan")
    except ValueError as error:
        where = f"{path}: line {index + 2}: {column} is {cell!r}, not a number"
        raise LearningInputError(f"{where}: run the study again") from error
