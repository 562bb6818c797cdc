"""The flips of the authors' flights, predicted by motors and rigid body without any fitted number.

Method and limits: notes of the authors' data, "Flip check": front motors head for |My| / (4 arm), rear motors
for zero, from the thrusts of the last row before the trigger in which all four run; compared over 0.24 s,
until the motors are cut or the first contact. |mean| <= 2.5 and RMS <= 3 rad/s pass.
"""

import csv
import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_backend.physics.reset import approaching
from sim_backend.physics.step import step_thrust

GRAM_FORCE = 9.80665e-3  # N
FRONT_LEFT, REAR_LEFT, REAR_RIGHT, FRONT_RIGHT = (f"M{n}_thrust" for n in (1, 2, 3, 4))  # authors' numbering

Row = dict[str, str]


def _flip_start(rows: list[Row]) -> int | None:
    """First row of the flip: the flag rises and the moment is that of a flip."""
    for i in range(1, len(rows)):
        fresh = rows[i]["flip_flag"] == "True" and rows[i - 1]["flip_flag"] == "False"
        if fresh and float(rows[i]["My"]) < -4.0:
            return i
    return None


def _running(row: Row) -> bool:
    return all(float(row[f"M{n}_thrust"]) > 0.5 for n in (1, 2, 3, 4))


def _gyro(rows: list[Row], start: int) -> list[tuple[float, float]]:
    """(time since the trigger, w_y) until 0.24 s, the cut or the first contact."""
    t0, samples = float(rows[start]["t"]), []
    before = float(rows[start]["wy"])
    for row in rows[start + 1 :]:
        t, rate = float(row["t"]) - t0, float(row["wy"])
        if t > 0.24 or float(row[FRONT_LEFT]) == 0.0 or rate - before > 0.5:
            break
        if samples and (t <= samples[-1][0] or rate == before):
            continue  # the same radio block again
        samples.append((t, rate))
        before = rate
    return samples


def _predict(parameters: Any, rows: list[Row], start: int, times: list[float]) -> list[float]:
    running = next(row for row in reversed(rows[:start]) if _running(row))
    state = approaching(parameters, np.array([0.0, 0.0, 100.0]), np.zeros(3))
    state["thrust"] = [
        GRAM_FORCE * float(running[name]) for name in (FRONT_RIGHT, REAR_RIGHT, REAR_LEFT, FRONT_LEFT)
    ]
    state["omega"] = [0.0, float(rows[start]["wy"]), 0.0]
    front = abs(float(rows[start]["My"])) * 1e-3 / (4.0 * float(parameters["arm_x"]))
    rates = []
    for t in times:
        while state["time"] < t - 5e-4:
            step_thrust(state, parameters, (front, 0.0, 0.0, front), 1e-3)
        rates.append(float(state["omega"][1]))
    return rates


@pytest.fixture
def errors(open_sky: Any, shared_data: Path) -> list[np.ndarray]:
    """Model minus gyro (rad/s), an array a flight with at least seven usable samples."""
    found = []
    for path in sorted((shared_data / "habas2022" / "flights").glob("*.csv.gz")):
        with gzip.open(path, "rt", encoding="utf-8") as file:
            rows = [row for row in csv.DictReader(file) if row["Error"] == "--"]
        start = _flip_start(rows)
        if start is None:
            continue
        samples = _gyro(rows, start)
        if len(samples) >= 7:
            predicted = _predict(open_sky, rows, start, [t for t, _ in samples])
            found.append(np.array(predicted) - np.array([rate for _, rate in samples]))
    return found


def test_recorded_flips_are_predicted(errors: list[np.ndarray]) -> None:
    assert len(errors) >= 20
    together = np.concatenate(errors)
    assert abs(together.mean()) <= 2.5
    assert np.sqrt(np.mean(together**2)) <= 3.0
