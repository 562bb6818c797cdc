"""How landings end where pads have a limit: tables with ``labels.csv``, by the independent landings.

The limit of a landing's pads is drawn apart from everything else: landings of one seed are the same up to the
first touch, whatever is hidden.
"""

import csv
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from tests.truth.landings.campaign import DECIMALS
from tests.truth.landings.drone import Drone
from tests.truth.landings.flight import COLUMNS, Attempt, Noise, fly

RECKONED = 0.02
"""m: the drone believes the ceiling this much too low."""

_EVERY = 2  # rows of the log: 100 a second
_MORE = ("triggered", "a_rot", "d_ceil")


@dataclass(frozen=True)
class Landing:
    """One landing: its log by column, and the feet that held in the end."""

    log: Mapping[str, np.ndarray]
    feet: int

    @property
    def outcome(self) -> str:
        """As ``labels.csv`` has it."""
        return "four_leg" if self.feet >= 3 else "two_leg" if self.feet else "failure"


def attempts(count: int, seed: int) -> list[Attempt]:
    """Commanded approaches: about as the paper's, slow ones and steep ones too."""
    rng = np.random.default_rng([seed, 2])
    return [
        Attempt(
            speed=rng.uniform(1.75, 3.0),
            angle=np.radians(rng.uniform(30.0, 70.0)),
            tau=rng.uniform(0.205, 0.245),
            moment=-rng.uniform(0.0055, 0.008),
            before=0.5,
            after=0.8,
        )
        for _ in range(count)
    ]


def land(drone: Drone, attempt: Attempt, seed: int, number: int, pads: int = 0) -> Landing:
    """One attempt with the pads of its own; other `pads` are drawn anew, for the same landing."""
    deviate = np.random.default_rng([seed, 1, number, pads]).standard_normal()
    own = replace(drone, capture=drone.capture + drone.capture_spread * deviate)
    log = fly(own, attempt, Noise(), np.random.default_rng([seed, 0, number]))
    feet, trigger = int(log.pop("feet")), float(log.pop("trigger"))
    for name in ("hull", "touch"):
        del log[name]
    count = log["t"].size
    log["triggered"] = (log["t"] >= trigger).astype(float)
    log["a_rot"] = np.full(count, attempt.moment)
    log["d_ceil"] = np.full(count, attempt.ceiling - RECKONED) - log["z"]
    return Landing(log, feet)


def write_outcomes(drone: Drone, count: int, seed: int, folder: Path, answer: Path, pads: int = 0) -> None:
    """Fly `count` landings into `folder`, with their labels; what was hidden goes to the file `answer`."""
    folder.mkdir(parents=True, exist_ok=True)
    labels = []
    for number, attempt in enumerate(attempts(count, seed)):
        landing = land(drone, attempt, seed, number, pads)
        name = f"landing-{number:02d}.csv"
        _write(folder / name, landing.log)
        labels.append([name, landing.outcome])
    with (folder / "labels.csv").open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([["file", "outcome"], *labels])
    answer.write_text(json.dumps(asdict(drone), indent=1), encoding="utf-8")


def _write(path: Path, log: Mapping[str, np.ndarray]) -> None:
    names = (*COLUMNS, *_MORE)
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(names)
        for row in range(0, log["t"].size, _EVERY):
            writer.writerow([f"{log[name][row]:.{DECIMALS.get(name, 5)}f}" for name in names])
