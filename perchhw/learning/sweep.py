"""The sweep: a learning trial for every approach condition and repeat, kept in a folder that survives a kill.

A row is appended to ``pairs.csv`` as soon as its trial is done; a resumed sweep goes on with the settings in
``sweep.json``, which gets the counts and times at the end.
"""

import math
import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from onboard.clock import Clock
from perchhw.learning.environment import versions
from perchhw.learning.errors import LearningInputError
from perchhw.learning.executor import ALL_CORES, Executor
from perchhw.learning.grid import Condition, conditions
from perchhw.learning.one_trial import not_finite_rollouts, run_trial
from perchhw.learning.setup import LearningSetup, Recipe, prepared
from perchhw.learning.sweep_folder import (
    SCHEMA,
    SWEEP_FILE,
    Key,
    Row,
    append_rows,
    not_finite_report,
    open_folder,
    read_settings,
    write_pairs,
    write_settings,
)


@dataclass(frozen=True)
class SweepGrid:
    """Which trials a sweep has."""

    speeds: tuple[float, ...]
    angles_deg: tuple[float, ...]
    repeats: int

    def keys(self) -> Iterator[Key]:
        """(speed, angle, repeat) of every trial.

        Raises:
            LearningInputError: the grid has no attempt.
        """
        if self.repeats < 1:
            raise LearningInputError(f"--repeats {self.repeats} makes no attempt: give at least 1")
        for condition in conditions(self.speeds, self.angles_deg):
            for repeat in range(self.repeats):
                yield (*condition, repeat)


@dataclass(frozen=True)
class SweepSummary:
    """What a finished sweep came to.

    Attributes:
        rows: all rows of ``pairs.csv``, sorted.
        new_trials, new_rollouts, new_steps: of this run. seconds: of this run.
    """

    rows: tuple[Row, ...]
    new_trials: int
    new_rollouts: int
    new_steps: float
    seconds: float


@dataclass(frozen=True)
class LearnTrial:
    """The work of a sweep on one trial, as an executor takes it."""

    recipe: Recipe

    def __call__(self, key: Key) -> Row:
        """The row of one trial."""
        parameters, rules = prepared(self.recipe)
        speed, angle_deg, repeat = key
        trial = run_trial(parameters, rules, self.recipe.setup.seed, Condition(speed, angle_deg), repeat)
        record = trial.record
        return _row(key, record, not_finite_rollouts(trial.bench.outs[: int(record["rollouts"])]))


def run_sweep(
    setup: LearningSetup,
    grid: SweepGrid,
    folder: Path,
    *,
    executor: Executor = ALL_CORES,
    resume: bool = False,
    on_trial: Callable[[Row, int, int], None] = lambda row, done, total: None,
    clock: Clock = time.monotonic,
) -> SweepSummary:
    """Learn all trials of a grid.

    Args:
        setup: what the rollouts run on.
        grid: the trials.
        folder: where ``pairs.csv`` and ``sweep.json`` go.
        executor: who does the work; the result does not depend on it.
        resume: go on with a sweep that was stopped; its rows stay.
        on_trial: called with the row, the number done and the number in all.
        clock: monotonic, s.

    Raises:
        LearningInputError: grid or settings cannot be used, the folder holds another sweep, or holds one and
            `resume` was not asked for.
    """
    keys = list(grid.keys())
    work = LearnTrial(setup.recipe())
    prepared(work.recipe)  # what cannot be used is refused before the folder is touched
    document = _document(setup, grid)
    rows = open_folder(folder, document, set(keys), resume)
    todo = [key for key in keys if key not in rows]
    total = len(todo) + len(rows)
    started = clock()
    new: list[Row] = []
    with append_rows(folder) as append:
        for key, row in executor.spread(work, todo):
            append(row)
            rows[key] = row
            new.append(row)
            on_trial(row, len(rows), total)
    summary = SweepSummary(
        rows=tuple(rows[key] for key in sorted(rows)),
        new_trials=len(new),
        new_rollouts=sum(int(row["rollouts"] or 0) for row in new),
        new_steps=sum(float(row["steps"] or 0) for row in new),
        seconds=clock() - started,
    )
    write_pairs(folder, summary.rows)
    if new or "result" not in read_settings(folder / SWEEP_FILE):
        write_settings(folder, {**document, "result": _result(summary, setup.seed, executor)})
    return summary


def _document(setup: LearningSetup, grid: SweepGrid) -> dict[str, Any]:
    """What ``sweep.json`` says before the first trial."""
    settings = {
        **setup.describe(),
        "speeds": list(grid.speeds),
        "angles_deg": list(grid.angles_deg),
        "repeats": grid.repeats,
    }
    return {"schema": SCHEMA, "settings": settings, "versions": versions()}


def _result(summary: SweepSummary, seed: int, executor: Executor) -> dict[str, Any]:
    """Counts of all rows; speed and memory of the last run."""
    seconds = max(summary.seconds, 1e-9)
    return {
        "trials": len(summary.rows),
        "rollouts": sum(int(row["rollouts"] or 0) for row in summary.rows),
        "not_finite": sum(int(row["not_finite"] or 0) for row in summary.rows),
        "not_finite_rollouts": [
            not_finite_report(row, seed) for row in summary.rows if row["not_finite_rollouts"]
        ],
        "pairs_at_0.8": sum(float(row["landing_rate"] or 0) >= 0.8 for row in summary.rows),
        "seconds": summary.seconds,
        "rollouts_per_second": summary.new_rollouts / seconds,
        "steps_per_second": summary.new_steps / seconds,
        "executor": executor.describe(),
        "peak_memory_mb": _peak_memory_mb(),
    }


def _peak_memory_mb() -> float:
    """Most memory that this process ever held, MB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)  # bytes there, kB elsewhere


def _row(key: Key, trial: Any, not_finite: tuple[int, ...]) -> Row:
    """A row of ``pairs.csv``; cues are None where no rollout triggered."""
    cues = {name: float(trial[name]) for name in ("tau", "theta_x", "d_ceil", "a_rot")}
    return {
        "speed_m_s": key[0],
        "angle_deg": key[1],
        "trial": key[2],
        **{name: value if math.isfinite(value) else None for name, value in cues.items()},
        **{
            name: float(trial[name])
            for name in ("landing_rate", "four_leg_rate", "body_contact_rate", "reward", "two_leg_rate")
        },
        **{name: int(trial[name]) for name in ("rollouts", "converged", "episodes", "not_finite")},
        "mu_tau": float(trial["mu"][0]),
        "sigma_tau": float(trial["sigma"][0]),
        "mu_moment_nmm": float(trial["mu"][1]),
        "sigma_moment_nmm": float(trial["sigma"][1]),
        "steps": float(trial["steps"]),
        "not_finite_rollouts": " ".join(str(index) for index in not_finite) or None,
    }
