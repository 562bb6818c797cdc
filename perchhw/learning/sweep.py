"""The sweep: a learning trial for every approach condition and repeat, kept in a folder that survives a kill.

``pairs.csv`` has one row a trial, appended as soon as the trial is done; ``sweep.json`` has the settings, so
that a resumed sweep goes on with the same ones, and at the end the counts and times.
"""

import csv
import io
import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from onboard.clock import Clock
from perchhw.learning.ephe import START_TAU
from perchhw.learning.errors import LearningInputError
from perchhw.learning.grid import Condition, conditions, generator, spread
from perchhw.learning.setup import LearningSetup, versions
from perchhw.learning.trial import TRIAL, learn_pair, new_bench

SCHEMA = "perchhw.sweep/1"
PAIRS_FILE, SWEEP_FILE = "pairs.csv", "sweep.json"
_PURPOSE = 1

COLUMNS = (
    "speed_m_s", "angle_deg", "trial", "tau", "theta_x", "d_ceil", "a_rot", "landing_rate", "four_leg_rate",
    "body_contact_rate", "reward", "rollouts", "converged", "two_leg_rate", "episodes", "mu_tau", "sigma_tau",
    "mu_moment_nmm", "sigma_moment_nmm", "steps", "not_finite",
)  # fmt: skip
"""Columns of ``pairs.csv``: SI, a_rot in N m (negative = nose up), mu and sigma in the units of EPHE."""

Row = dict[str, float | int | None]
Key = tuple[float, float, int]


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
    todo = list(grid.keys())
    parameters, rules = setup.load()
    document = {
        "schema": SCHEMA,
        "settings": {
            **setup.describe(),
            "speeds": list(grid.speeds),
            "angles_deg": list(grid.angles_deg),
            "repeats": grid.repeats,
        },
        "versions": versions(),
    }
    rows = _open_folder(folder, document, resume)
    todo = [key for key in todo if key not in rows]
    total = len(todo) + len(rows)
    started = clock()

    def learn(key: Key) -> Row:
        condition = Condition(key[0], key[1])
        trial = np.zeros(1, TRIAL)[0]
        bench = new_bench(parameters, rules.ephe.rollouts * rules.ephe.evaluation_episodes)
        start_tau = START_TAU[key[2] % len(START_TAU)]
        rng = generator(setup.seed, _PURPOSE, condition, key[2])
        angle = math.radians(condition.angle_deg)
        learn_pair(rng, bench, condition.speed, angle, start_tau, rules, trial)
        return _row(key, trial)

    new: list[Row] = []
    with (folder / PAIRS_FILE).open("a", encoding="utf-8", newline="") as file:
        for key, row in spread(learn, todo, workers):
            file.write(_csv_line(row))
            file.flush()
            rows[key] = row
            new.append(row)
            on_trial(row, len(rows), total)
    seconds = clock() - started
    summary = SweepSummary(
        rows=tuple(rows[key] for key in sorted(rows)),
        new_trials=len(new),
        new_rollouts=sum(int(row["rollouts"] or 0) for row in new),
        new_steps=sum(float(row["steps"] or 0) for row in new),
        seconds=seconds,
    )
    _write_pairs(folder, summary.rows)
    if new or "result" not in _read_settings(folder / SWEEP_FILE):
        document["result"] = _result(summary)
        _replace(folder / SWEEP_FILE, json.dumps(document, indent=1) + "\n")
    return summary


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


def _csv_line(row: Row) -> str:
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(
        ["" if row[name] is None else repr(row[name]) for name in COLUMNS]
    )
    return line.getvalue()


def _open_folder(folder: Path, document: dict[str, Any], resume: bool) -> dict[Key, Row]:
    """Make or check the folder; the rows that it already holds."""
    settings_path, pairs_path = folder / SWEEP_FILE, folder / PAIRS_FILE
    if not pairs_path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        _replace(settings_path, json.dumps(document, indent=1) + "\n")
        _write_pairs(folder, ())
        return {}
    if not resume:
        raise LearningInputError(
            f"{folder} already holds a sweep: add --resume to go on, or choose another --out"
        )
    before = _read_settings(settings_path)
    for part in ("settings", "versions"):
        for name, value in document[part].items():
            if before.get(part, {}).get(name) != value:
                raise LearningInputError(
                    f"{settings_path}: {name} is {before.get(part, {}).get(name)!r} there and {value!r} now: "
                    "resume with the same settings and versions, or choose another --out"
                )
    rows = read_pairs(pairs_path, cut_tail=True)
    _write_pairs(folder, tuple(rows.values()))
    return rows


def _read_settings(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LearningInputError(f"{path}: cannot be read ({error}): choose another --out") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise LearningInputError(f"{path}: is not a sweep of this version ({SCHEMA}): choose another --out")
    return document


def read_pairs(path: Path, cut_tail: bool = False) -> dict[Key, Row]:
    """Rows of a ``pairs.csv`` by (speed, angle, trial).

    Args:
        path: the file.
        cut_tail: leave out an unfinished last line, as a killed process leaves it.

    Raises:
        LearningInputError: naming file, line and column.
    """
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    if not lines or lines[0].strip() != ",".join(COLUMNS):
        raise LearningInputError(f"{path}: line 1: the columns are not those of this version")
    if cut_tail and not lines[-1].endswith("\n"):
        lines.pop()
    rows: dict[Key, Row] = {}
    for number, line in enumerate(lines[1:], start=2):
        cells = line.rstrip("\n").split(",")
        if len(cells) != len(COLUMNS):
            raise LearningInputError(f"{path}: line {number}: {len(cells)} values, not {len(COLUMNS)}")
        row: Row = {}
        for name, cell in zip(COLUMNS, cells, strict=True):
            try:
                row[name] = None if cell == "" else float(cell) if _is_real(name) else int(cell)
            except ValueError as error:
                raise LearningInputError(
                    f"{path}: line {number}: {name} is {cell!r}, not a number"
                ) from error
        rows[(float(row["speed_m_s"] or 0), float(row["angle_deg"] or 0), int(row["trial"] or 0))] = row
    return rows


def _is_real(column: str) -> bool:
    return column not in ("trial", "rollouts", "converged", "episodes", "not_finite")


def _write_pairs(folder: Path, rows: tuple[Row, ...]) -> None:
    _replace(folder / PAIRS_FILE, ",".join(COLUMNS) + "\n" + "".join(_csv_line(row) for row in rows))


def _replace(path: Path, text: str) -> None:
    """Write a file so that a kill leaves either the old or the new one."""
    draft = path.with_name(path.name + ".part")
    draft.write_text(text, encoding="utf-8")
    draft.replace(path)
