"""The sweep: a learning trial for every approach condition and repeat, kept in a folder that survives a kill.

A row is appended to ``pairs.csv`` as soon as its trial is done; a resumed sweep goes on with the settings in
``sweep.json``, which gets the counts and times at the end.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from onboard.clock import Clock
from perchhw.learning.ephe import START_TAU
from perchhw.learning.errors import LearningInputError
from perchhw.learning.grid import Condition, conditions, generator, spread
from perchhw.learning.setup import LearningSetup, versions
from perchhw.learning.sweep_folder import (
    PAIRS_FILE,
    SCHEMA,
    SWEEP_FILE,
    Key,
    Row,
    csv_line,
    open_folder,
    read_settings,
    write_pairs,
    write_settings,
)
from perchhw.learning.trial import TRIAL, Rules, learn_pair, new_bench

_PURPOSE = 1


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
        new_trials, new_rollouts: of this run. seconds: of this run.
    """

    rows: tuple[Row, ...]
    new_trials: int
    new_rollouts: int
    new_steps: float
    seconds: float


def run_sweep(
    setup: LearningSetup,
    grid: SweepGrid,
    folder: Path,
    *,
    workers: int,
    resume: bool = False,
    on_trial: Callable[[Row, int, int], None] = lambda row, done, total: None,
    clock: Clock = time.monotonic,
) -> SweepSummary:
    """Learn all trials of a grid.

    Args:
        setup: what the rollouts run on.
        grid: the trials.
        folder: where ``pairs.csv`` and ``sweep.json`` go.
        workers: threads; the result does not depend on it.
        resume: go on with a sweep that was stopped; its rows stay.
        on_trial: called with the row, the number done and the number in all.
        clock: monotonic, s.

    Raises:
        LearningInputError: grid or settings cannot be used, the folder holds another sweep, or holds one and
            `resume` was not asked for.
    """
    keys = list(grid.keys())
    parameters, rules = setup.load()
    document = _document(setup, grid)
    rows = open_folder(folder, document, resume)
    todo = [key for key in keys if key not in rows]
    total = len(todo) + len(rows)
    started = clock()
    new: list[Row] = []
    with (folder / PAIRS_FILE).open("a", encoding="utf-8", newline="") as file:
        for key, row in spread(partial(_learn, setup.seed, parameters, rules), todo, workers):
            file.write(csv_line(row))
            file.flush()
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
        write_settings(folder, {**document, "result": _result(summary)})
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


def _learn(seed: int, parameters: Any, rules: Rules, key: Key) -> Row:
    """One trial, on benches and a generator of its own."""
    speed, angle_deg, repeat = key
    trial = np.zeros(1, TRIAL)[0]
    bench = new_bench(parameters, rules.ephe.rollouts * rules.ephe.evaluation_episodes)
    rng = generator(seed, _PURPOSE, Condition(speed, angle_deg), repeat)
    start_tau = START_TAU[repeat % len(START_TAU)]
    learn_pair(rng, bench, speed, math.radians(angle_deg), start_tau, rules, trial)
    return _row(key, trial)


def _result(summary: SweepSummary) -> dict[str, Any]:
    """Counts of all rows, and the speed of the last run."""
    seconds = max(summary.seconds, 1e-9)
    return {
        "trials": len(summary.rows),
        "rollouts": sum(int(row["rollouts"] or 0) for row in summary.rows),
        "not_finite": sum(int(row["not_finite"] or 0) for row in summary.rows),
        "pairs_at_0.8": sum(float(row["landing_rate"] or 0) >= 0.8 for row in summary.rows),
        "seconds": summary.seconds,
        "rollouts_per_second": summary.new_rollouts / seconds,
        "steps_per_second": summary.new_steps / seconds,
    }


def _row(key: Key, trial: Any) -> Row:
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
    }
