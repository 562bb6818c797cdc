"""What is kept of a rehearsal: the verdict, and the drone's ring as a table."""

import csv
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from onboard.ring import SECOND_SAMPLE_MS, Ring
from perchhw.record.folder import OutputFolderError, new_run_folder

if TYPE_CHECKING:
    from perchhw.rehearsal.session import Rehearsed

VERDICT_FILE, RING_FILE = "verdict.json", "ring.csv"

COLUMNS = (
    *("tick_ms", "tau", "theta_x", "d_ceil", "trigger_value", "a_rot", "x", "y", "z", "vx", "vy", "vz"),
    *("qx", "qy", "qz", "qw", "gx", "gy", "gz", "own_qx", "own_qy", "own_qz", "own_qw", "voltage"),
    *("thrust_1", "thrust_2", "thrust_3", "thrust_4"),
)
"""Of a step of the law; the policy's are those of the same period."""


def ring_rows(ring: Ring) -> list[list[float]]:
    """The steps of the law in their order: `COLUMNS`, SI."""
    rows = []
    for tick, period in zip(ring.ticks, ring.periods, strict=True):
        policy = [*period["cues"].tolist(), float(period["trigger_value"]), float(period["a_rot"])]
        for law, at in zip(period["law"], (0, SECOND_SAMPLE_MS), strict=True):
            numbers = np.concatenate([*law["estimate"].tolist(), law["own_attitude"]]).tolist()
            rows.append([int(tick) + at, *policy, *numbers, float(law["voltage"]), *law["thrusts"].tolist()])
    return rows


def verdict_document(rehearsal: "Rehearsed") -> dict[str, Any]:
    """The verdict for a script; a difference that is no finite number is null, and `failures` says so."""
    verdict = rehearsal.verdict
    away = verdict.input_difference
    return {
        "pass": verdict.passed,
        "failures": list(verdict.failures),
        "on": rehearsal.physics,
        "engine": rehearsal.engine,
        "policy_crc32": rehearsal.policy_crc32,
        "reason": verdict.reason.name.lower(),
        "trigger_sample_difference": verdict.trigger_sample_difference,
        "trigger_value_difference": _finite(verdict.trigger_value_difference),
        "a_rot_difference_n_m": _finite(verdict.a_rot_difference_n_m),
        "force_difference_n": _finite(verdict.force_difference_n),
        "input_difference": None if away is None else {name: _finite(value) for name, value in away.items()},
        "loop_us": None if rehearsal.loop is None else asdict(rehearsal.loop),
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def save_rehearsal(parent: Path, rehearsal: "Rehearsed", folder: Path | None = None) -> Path:
    """Write verdict and ring to `folder`, or to a new one in `parent`, and give it.

    Raises:
        OutputFolderError: it cannot be written.
    """
    folder = folder or new_run_folder(parent, "rehearsal")
    document = json.dumps(verdict_document(rehearsal), indent=2, allow_nan=False)
    try:
        (folder / VERDICT_FILE).write_text(document + "\n", encoding="utf-8")
        with (folder / RING_FILE).open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([COLUMNS, *ring_rows(rehearsal.ring)])
    except OSError as error:
        raise OutputFolderError(folder, error.strerror) from error
    return folder
