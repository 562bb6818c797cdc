"""Which stiffness and damping of the leg hinge, one for all designs, agrees best with what is known.

Nobody has measured the hinge: the paper's number cannot carry the vehicle, the authors' simulation has
0.08 N m/rad (paper errata 4). What is known are the paper's statements about six designs (section V.E) and
the authors' landing rates of one of them. Both come from their simulation, so their vehicles are flown here.

The score of a hinge is a log likelihood with two generous widths. A statement says that a difference d of
mean landing rates is positive; a plot shows differences of about VISIBLE, so it counts log Phi(d / VISIBLE).
The authors' rate of a band (best of the repeats) counts -((ours - theirs) / DISCREPANCY)^2 / 2, where the
discrepancy stands for all else that their simulation and ours do not share. How far the choice depends on the
conditions that were flown shows in a bootstrap over them.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.measurement import drawn_again
from onboard.arrays import FloatArray
from onboard.vehicle import known_leg_designs, vehicle_to_toml
from perchhw.learning.authors_models import authors_vehicle
from perchhw.learning.bands import FAST
from perchhw.learning.environment import versions
from perchhw.learning.errors import LearningInputError
from perchhw.learning.executor import ALL_CORES, Executor
from perchhw.learning.grid import Condition
from perchhw.learning.leg_trends import BEYOND, Pairs, rate_trends
from perchhw.learning.results import read_reference
from perchhw.learning.setup import LearningSetup, Recipe
from perchhw.learning.sweep import LearnTrial, SweepGrid
from perchhw.learning.sweep_folder import Key, Row, make_folder, write_document

SCHEMA = "perchhw.hinge_calibration/1"
HINGE_FILE = "hinge.json"

STIFFNESSES = (0.02, 0.03, 0.04, 0.055, 0.08, 0.11, 0.16, 0.23, 0.32)
"""N m/rad, about sqrt(2) apart, around the authors' 0.08."""

REFERENCE_DESIGN = "semi-narrow-long"
"""Design of the authors' sweep."""

IndexArray = NDArray[np.intp]

VISIBLE = 0.05
"""Difference of landing rates that a polar plot shows."""

DISCREPANCY = 0.1
"""Landing rate by which two simulations of the same thing may differ in a band."""

BANDS_DEG = ((30.0, 45.0), (45.0, 60.0), (60.0, 75.0), (75.0, BEYOND))


class Hinge(NamedTuple):
    """Stiffness (N m/rad) and damping (N m s/rad)."""

    stiffness: float
    damping: float


@dataclass(frozen=True)
class Rates:
    """Landing rates of all designs with one hinge.

    Attributes:
        conditions: flown. rates: (conditions, repeats) by design.
    """

    conditions: tuple[Condition, ...]
    rates: Mapping[str, FloatArray]


class HingeScore(NamedTuple):
    """Log likelihood (up to a constant) of the statements, and of the authors' rates."""

    statements: float
    reference: float

    @property
    def total(self) -> float:
        """Of both."""
        return self.statements + self.reference


@dataclass(frozen=True)
class HingeCalibration:
    """What a scan came to.

    Attributes:
        hinges: scanned. scores: of each. statements: numbers of the paper's statements of each.
        best: index of the highest total.
        picked: index that won in each bootstrap replicate.
    """

    hinges: tuple[Hinge, ...]
    scores: tuple[HingeScore, ...]
    statements: tuple[Mapping[str, float], ...]
    best: int
    picked: tuple[int, ...]

    def interval(self, coverage: float = 0.9) -> tuple[float, float]:
        """Range of stiffness (N m/rad) that holds the bootstrap's choice with this probability."""
        chosen = [self.hinges[index].stiffness for index in self.picked]
        low, high = np.quantile(chosen, [0.5 - 0.5 * coverage, 0.5 + 0.5 * coverage], method="nearest")
        return float(low), float(high)

    def as_good(self, within: float = 2.0) -> tuple[float, float]:
        """Range of stiffness (N m/rad) with a score, at its best damping, at most this below the highest."""
        floor = self.scores[self.best].total - within
        good = [h.stiffness for h, s in zip(self.hinges, self.scores, strict=True) if s.total >= floor]
        return min(good), max(good)


def hinge_recipe(setup: LearningSetup, design: str, hinge: Hinge) -> Recipe:
    """The setup with the authors' vehicle of a design on this hinge."""
    vehicle = authors_vehicle(setup.vehicle, design, hinge.stiffness, hinge.damping)
    return Recipe(dataclasses.replace(setup, legs=design), vehicle_to_toml(vehicle))


def hinge_rates(setup: LearningSetup, hinge: Hinge, grid: SweepGrid, executor: Executor = ALL_CORES) -> Rates:
    """Learn all designs with one hinge on a grid."""
    keys = list(grid.keys())
    rates: dict[str, FloatArray] = {}
    for design in known_leg_designs():
        work = LearnTrial(hinge_recipe(setup, design, hinge))
        done: dict[Key, Row] = dict(executor.spread(work, keys))
        values = np.array([float(done[key]["landing_rate"] or 0.0) for key in keys])
        rates[design] = values.reshape(-1, grid.repeats)
    return Rates(tuple(Condition(*key[:2]) for key in keys[:: grid.repeats]), rates)


def statement_numbers(rates: Rates, chosen: IndexArray) -> dict[str, float]:
    """Numbers of the paper's statements on the conditions with these indices (repetition allowed)."""
    repeats = next(iter(rates.rates.values())).shape[1]
    speed, angle = (np.repeat(np.array(rates.conditions)[chosen, axis], repeats) for axis in (0, 1))
    empty = np.full(len(speed), math.nan)
    designs = {
        design: Pairs(speed, angle, values[chosen].ravel(), empty, empty)
        for design, values in rates.rates.items()
    }
    return {
        f"{name}: {what}": value
        for name, trend in rate_trends(designs).items()
        for what, value in trend.numbers.items()
    }


def score(rates: Rates, chosen: IndexArray, reference: Mapping[Condition, float]) -> HingeScore:
    """Score of a hinge on the conditions with these indices (repetition allowed)."""
    from scipy.special import log_ndtr

    differences = np.array(list(statement_numbers(rates, chosen).values()))
    misfit = band_differences(rates, chosen, reference) / DISCREPANCY
    return HingeScore(float(np.sum(log_ndtr(differences / VISIBLE))), -0.5 * float(np.sum(misfit**2)))


def band_differences(rates: Rates, chosen: IndexArray, reference: Mapping[Condition, float]) -> FloatArray:
    """Best of the repeats, ours less theirs: mean over the conditions of each band that both have."""
    ours = rates.rates[REFERENCE_DESIGN].max(axis=1)
    bands: dict[tuple[float, bool], list[float]] = {}
    for index in chosen:
        condition = rates.conditions[index]
        if condition in reference:
            low = max(low for low, _ in BANDS_DEG if low <= condition.angle_deg)
            difference = float(ours[index]) - reference[condition]
            bands.setdefault((low, condition.speed >= FAST), []).append(difference)
    return np.array([np.mean(values) for values in bands.values()])


def calibrate(
    scanned: Mapping[Hinge, Rates],
    reference: Mapping[Condition, float],
    rng: np.random.Generator,
    replicates: int = 200,
) -> HingeCalibration:
    """Pick a hinge, and see how far the pick depends on the conditions.

    Args:
        scanned: rates of every hinge, on the same conditions.
        reference: the authors' best rate by condition.
        rng: for the bootstrap. replicates: of it.
    """
    hinges = tuple(scanned)
    count = len(scanned[hinges[0]].conditions)
    everything = np.arange(count)
    scores = tuple(score(scanned[hinge], everything, reference) for hinge in hinges)
    picked = []
    for drawn in np.sort(drawn_again(count, replicates, rng), axis=1):
        picked.append(int(np.argmax([score(scanned[hinge], drawn, reference).total for hinge in hinges])))
    return HingeCalibration(
        hinges=hinges,
        scores=scores,
        statements=tuple(statement_numbers(scanned[hinge], everything) for hinge in hinges),
        best=int(np.argmax([found.total for found in scores])),
        picked=tuple(picked),
    )


def run_hinge_calibration(
    setup: LearningSetup,
    hinges: Sequence[Hinge],
    grid: SweepGrid,
    reference: Path,
    folder: Path,
    *,
    executor: Executor = ALL_CORES,
    on_hinge: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Scan hinges and write ``hinge.json``; its content.

    Args:
        setup: of all rollouts; vehicle, legs and hinge are replaced by those of the scan.
        hinges: to scan. grid: trials of each design with each hinge.
        reference: table of the authors' landing rates of :data:`REFERENCE_DESIGN`.
        folder: for the result. executor: who does the work; the result does not depend on it.
        on_hinge: called with the number of hinges done and in all.

    Raises:
        LearningInputError: nothing to scan, or a table or folder that cannot be used.
    """
    if not hinges or min(min(hinge) for hinge in hinges) < 0.0 or min(h.stiffness for h in hinges) == 0.0:
        raise LearningInputError("give at least one stiffness above zero and one damping not below zero")
    theirs = read_reference(reference).rates
    make_folder(folder)
    scanned: dict[Hinge, Rates] = {}
    for hinge in hinges:
        on_hinge(len(scanned), len(hinges))
        scanned[hinge] = hinge_rates(setup, hinge, grid, executor)
    on_hinge(len(hinges), len(hinges))
    found = calibrate(scanned, theirs, np.random.default_rng(setup.seed))
    document = {
        "schema": SCHEMA,
        "settings": {**dataclasses.asdict(setup), **dataclasses.asdict(grid), "reference": reference.name},
        "versions": versions(),
        **_result(found),
    }
    write_document(folder / HINGE_FILE, document)
    return document


def _result(found: HingeCalibration) -> dict[str, Any]:
    best = found.hinges[found.best]
    return {
        "stiffness": {
            "value": best.stiffness,
            "unit": "N m/rad",
            "bootstrap_90": list(found.interval()),
            "within_2_of_the_best_score": list(found.as_good()),
        },
        "damping": {"value": best.damping, "unit": "N m s/rad"},
        "scan": [
            {
                **hinge._asdict(),
                "score": score.total,
                "score_statements": score.statements,
                "score_reference": score.reference,
                "picked": found.picked.count(index) / max(len(found.picked), 1),
                "statements": dict(numbers),
            }
            for index, (hinge, score, numbers) in enumerate(
                zip(found.hinges, found.scores, found.statements, strict=True)
            )
        ],
    }
