"""What is kept of a rehearsal: the verdict, and the drone's ring as a table."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from onboard.ring import SECOND_SAMPLE_MS, Ring
from perchhw.record.folder import OutputFolderError, new_run_folder

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


def save_rehearsal(parent: Path, ring: Ring, document: dict[str, Any]) -> Path:
    """Write verdict and ring to a new folder in `parent`, and give it.

    Raises:
        OutputFolderError: it cannot be written.
    """
    folder = new_run_folder(parent, "rehearsal")
    try:
        (folder / VERDICT_FILE).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
        with (folder / RING_FILE).open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([COLUMNS, *ring_rows(ring)])
    except OSError as error:
        raise OutputFolderError(folder, error.strerror) from error
    return folder
