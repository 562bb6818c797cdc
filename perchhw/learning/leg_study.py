"""The leg study: a sweep for each leg design, fresh landings of its pairs, and why they succeed or fail.

``DIR/<design>/`` is the folder of a sweep, ``DIR/landings.csv`` has one row a fresh landing with its factors
(:mod:`sim_backend.physics.landing_factors`), ``DIR/study.json`` the rates and medians by band and the paper's
trends as numbers (docs/leg_study.md).
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from onboard.outcome import Outcome
from onboard.vehicle import known_leg_designs
from perchhw.learning.bands import FAST
from perchhw.learning.environment import versions
from perchhw.learning.errors import LearningInputError
from perchhw.learning.executor import ALL_CORES, Executor
from perchhw.learning.leg_landings import FACTOR_COLUMNS, LandPair, landings_text, pair_of
from perchhw.learning.leg_results import LANDINGS_FILE, SCHEMA, STUDY_FILE, is_leg_study, read_study
from perchhw.learning.leg_trends import ALL_ANGLES, BEYOND, pairs_of, trends
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid, run_sweep
from perchhw.learning.sweep_folder import Row, make_folder, write_document, write_file
from sim_backend.physics.landing_factors import window_low

BANDS_DEG = ((30.0, 50.0), (50.0, 65.0), (65.0, 80.0), (80.0, BEYOND))
"""Bands of the approach angle (right border outside) at the borders that the paper names, 50 and 65 deg."""

SPEED_BANDS = ((0.0, FAST), (FAST, math.inf))

OnTrial = Callable[[Row, int, int], None]
"""Called with the row of a trial, the number done and the number in all."""

_RATES = ("landing_rate", "four_leg_rate", "two_leg_rate", "body_contact_rate")


def _nothing(row: Row, done: int, total: int) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True)
class LegStudy:
    """What a study came to.

    Attributes:
        document: of ``study.json``.
        pairs: rows of ``pairs.csv`` by design. landings: rows of ``landings.csv``.
    """

    document: dict[str, Any]
    pairs: Mapping[str, tuple[Row, ...]]
    landings: tuple[Row, ...]


def run_leg_study(
    setup: LearningSetup,
    designs: Sequence[str],
    grid: SweepGrid,
    folder: Path,
    *,
    rollouts: int = 6,
    executor: Executor = ALL_CORES,
    resume: bool = False,
    on_design: Callable[[str], AbstractContextManager[OnTrial]] = lambda design: nullcontext(_nothing),
) -> LegStudy:
    """Sweep every design, land its pairs, and write the study.

    Args:
        setup: of all designs; its legs are replaced by each of them in turn.
        designs: names of leg designs.
        grid: trials of each sweep.
        folder: for the results.
        rollouts: fresh landings of each pair.
        executor: who does the work; the result does not depend on it.
        resume: go on with a study that was stopped.
        on_design: called with each design, gives what is called with its trials while they are learned.

    Raises:
        LearningInputError: settings, designs or grid cannot be used, or the folder holds another study.
    """
    _check(setup, designs, rollouts)
    make_folder(folder)
    if resume:
        _keep_every_design(designs, folder)
    pairs: dict[str, tuple[Row, ...]] = {}
    landings: list[Row] = []
    for design in designs:
        legged = dataclasses.replace(setup, legs=design)
        with on_design(design) as on_trial:
            summary = run_sweep(
                legged, grid, folder / design, executor=executor, resume=resume, on_trial=on_trial
            )
        pairs[design] = summary.rows
        landings += _land(legged, design, summary.rows, rollouts, executor)
    document = _document(setup, pairs, landings, rollouts)
    write_file(folder / LANDINGS_FILE, landings_text(landings))
    write_document(folder / STUDY_FILE, document)
    return LegStudy(document, pairs, tuple(landings))


def _check(setup: LearningSetup, designs: Sequence[str], rollouts: int) -> None:
    known = known_leg_designs()
    for design in designs:
        if design not in known:
            raise LearningInputError(f"leg design {design!r} is not known: choose from {', '.join(known)}")
    if not designs or len(set(designs)) < len(designs):
        raise LearningInputError("name at least one leg design, and each of them once")
    if rollouts < 1:
        raise LearningInputError(f"--rollouts {rollouts} makes no landing: give at least 1")
    if setup.leg_angle_deg is not None or setup.leg_length_m is not None:
        raise LearningInputError("a leg study takes whole designs: leave angle and length of the legs out")


def _keep_every_design(designs: Sequence[str], folder: Path) -> None:
    """Refuse to write a study without designs that it has."""
    if not is_leg_study(folder):
        return
    left_out = [design for design in read_study(folder)["designs"] if design not in designs]
    if left_out:
        raise LearningInputError(
            f"{folder} is a study of {', '.join(left_out)} too: name all of its designs to go on with it, or "
            "another folder with --out"
        )


def _land(
    setup: LearningSetup, design: str, rows: Sequence[Row], rollouts: int, executor: Executor
) -> list[Row]:
    """Fresh landings of all pairs, in the order of the pairs."""
    tasks = [pair_of(row) for row in rows]
    done = dict(executor.spread(LandPair(setup.recipe(), rollouts), tasks))
    return [{"design": design, **landing} for task in tasks for landing in done[task]]


def _document(
    setup: LearningSetup,
    pairs: Mapping[str, Sequence[Row]],
    landings: Sequence[Row],
    rollouts: int,
) -> dict[str, Any]:
    found = trends({design: pairs_of(rows) for design, rows in pairs.items()})
    return {
        "schema": SCHEMA,
        "settings": {**dataclasses.asdict(setup), "legs": list(pairs), "rollouts": rollouts},
        "versions": versions(),
        "designs": {
            design: _design(setup, design, rows, [row for row in landings if row["design"] == design])
            for design, rows in pairs.items()
        },
        "trends": {
            name: {"says": trend.says, "holds": trend.holds(), "numbers": trend.numbers}
            for name, trend in found.items()
        },
    }


def _design(
    setup: LearningSetup, design: str, rows: Sequence[Row], landings: Sequence[Row]
) -> dict[str, Any]:
    parameters, _ = dataclasses.replace(setup, legs=design).load()
    bands = [_band(rows, landings, angles, speeds) for angles in BANDS_DEG for speeds in SPEED_BANDS]
    return {
        "impact_window_deg": [math.degrees(window_low(parameters)), 180.0],
        **_means(rows),
        "bands": [band for band in bands if band["trials"]],
        "all": _band(rows, landings, ALL_ANGLES, (0.0, math.inf)),
    }


def _means(rows: Sequence[Row]) -> dict[str, Any]:
    return {
        "trials": len(rows),
        **{name: _mean([float(row[name] or 0.0) for row in rows]) for name in _RATES},
    }


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _band(
    rows: Sequence[Row], landings: Sequence[Row], angles: tuple[float, float], speeds: tuple[float, float]
) -> dict[str, Any]:
    """Rates of the trials in a band, and the factors of its fresh landings by success and failure."""
    inside = [row for row in landings if _within(row, angles, speeds)]
    good = [row for row in inside if row["outcome"] == Outcome.FOUR_LEG.value]
    bad = [row for row in inside if row["outcome"] != Outcome.FOUR_LEG.value]
    return {
        "angles_deg": [angles[0], min(angles[1], 90.0)],
        "speeds_m_s": [speeds[0], None if math.isinf(speeds[1]) else speeds[1]],
        **_means([row for row in rows if _within(row, angles, speeds)]),
        "successes": _factors(good),
        "failures": _factors(bad),
    }


def _within(row: Row, angles: tuple[float, float], speeds: tuple[float, float]) -> bool:
    angle, speed = float(row["angle_deg"] or 0.0), float(row["speed_m_s"] or 0.0)
    return angles[0] <= angle < angles[1] and speeds[0] <= speed < speeds[1]


def _factors(landings: Sequence[Row]) -> dict[str, Any]:
    """Number of landings, outcomes, and medians of the factors.

    A landing where gravity asks for nothing counts as infinitely sufficient; such a median is None.
    """
    outcomes = [str(row["outcome"]) for row in landings]
    medians: dict[str, float | None] = {}
    for name in FACTOR_COLUMNS:
        empty = math.inf if name == "sufficiency" else math.nan
        touched = [row for row in landings if row["tilt_deg"] is not None]
        values = [empty if row[name] is None else float(row[name] or 0.0) for row in touched]
        median = float(np.median(values)) if values else math.nan
        medians[name] = median if math.isfinite(median) else None
    return {
        "landings": len(landings),
        "outcomes": {outcome: outcomes.count(outcome) for outcome in sorted(set(outcomes))},
        "medians": medians,
    }
