"""What the folder of a leg study holds, read back for its report."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import BoolArray, FloatArray
from onboard.csv_file import read_csv
from onboard.json_file import parsed
from onboard.outcome import Outcome
from onboard.schema import schema_problem
from perchhw.learning.bands import best_per_condition
from perchhw.learning.errors import LearningInputError
from perchhw.learning.results import RateMap
from perchhw.learning.sweep_folder import PAIRS_FILE, read_pairs

SCHEMA = "perchhw.leg_study/1"
LANDINGS_FILE, STUDY_FILE = "landings.csv", "study.json"

SWING, GRAVITY, MOMENTUM, WINDOW = "swing_distance", "gravity_energy", "swing_rate", "window_margin_deg"
"""Columns of ``landings.csv`` that stand for the four factors of the paper's section V.E."""


@dataclass(frozen=True)
class LegLandings:
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
    landings: LegLandings

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
    study = read_study(folder)
    maps = {}
    for design in study["designs"]:
        rows = tuple(read_pairs(folder / design / PAIRS_FILE).values())
        if not rows:
            raise LearningInputError(f"{folder / design / PAIRS_FILE}: has no trial: run the study again")
        maps[design] = RateMap(design, best_per_condition(rows))
    return LegResults(folder, study, maps, _read_landings(folder / LANDINGS_FILE))


def read_study(folder: Path) -> dict[str, Any]:
    """``study.json`` of the folder of a leg study.

    Raises:
        LearningInputError: naming the file and what is wrong with it.
    """
    path = folder / STUDY_FILE
    try:
        study = parsed(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LearningInputError(f"{path}: cannot be read ({error}): run perchhw learn legs") from error
    if not isinstance(study, dict):
        raise LearningInputError(f"{path}: is no leg study: run it again")
    problem = schema_problem(study.get("schema"), SCHEMA)
    if problem is not None:
        raise LearningInputError(f"{path}: schema {problem}; run the study again")
    if not study.get("designs"):
        raise LearningInputError(f"{path}: has no designs: run the study again")
    return study


def _read_landings(path: Path) -> LegLandings:
    table = read_csv(path, LearningInputError)
    return LegLandings(
        design=np.array(table.text("design")),
        angle_deg=table.column("angle_deg"),
        success=np.array(table.text("outcome")) == Outcome.FOUR_LEG.value,
        factors={name: table.column(name) for name in (SWING, GRAVITY, MOMENTUM, WINDOW)},
    )
