"""Landings over speeds and angles as table files in one folder, and what was hidden in a file of another."""

import csv
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tests.truth.landings.drone import Drone
from tests.truth.landings.flight import COLUMNS, Attempt, Noise, fly

DECIMALS = {"t": 4, **dict.fromkeys("xyz", 5), **{f"q{a}": 6 for a in "xyzw"}, **{f"g{a}": 4 for a in "xyz"}}

CASES: dict[str, Drone] = {
    "none": Drone(),
    "stiffness-0.3": Drone(stiffness=0.3 * 0.08),
    "stiffness-0.5": Drone(stiffness=0.5 * 0.08),
    "stiffness-2": Drone(stiffness=2.0 * 0.08),
    "damping-3": Drone(damping=3.0 * 6.788e-5),
    "damping-10": Drone(damping=10.0 * 6.788e-5),
    "slip-3N": Drone(adhesion=3.0),
    "slip-2N": Drone(adhesion=2.0),
    "soft-damped": Drone(stiffness=0.5 * 0.08, damping=5.0 * 6.788e-5),
    "authors-like": Drone(stiffness=1.5 * 0.08, damping=8.0 * 6.788e-5),
}
"""What may be hidden; the filed hinge has 0.08 N m/rad and 6.788e-5 N m s/rad."""


def write_campaign(
    case: str, count: int, seed: int, folder: Path, answer: Path, noise: Noise | None = None, every: int = 1
) -> None:
    """Fly `count` landings of a case into `folder`; the answer goes to the file `answer`.

    `every`: keeps one row of so many (1: 200 rows a second).
    """
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    outcomes = []
    for number in range(count):
        attempt = Attempt(
            speed=rng.uniform(2.0, 3.2),
            angle=np.radians(rng.uniform(30.0, 65.0)),
            tau=rng.uniform(0.215, 0.245),
            moment=-rng.uniform(0.0055, 0.008),
        )
        log = fly(CASES[case], attempt, noise or Noise(), rng)
        outcomes.append({name: float(log.pop(name)) for name in ("feet", "hull", "touch")})
        del log["trigger"]  # these tables leave it to the reader
        _write(folder / f"landing-{number:02d}.csv", log, every)
    sealed = {"case": case, "drone": asdict(CASES[case]), "outcomes": outcomes}
    answer.write_text(json.dumps(sealed, indent=1), encoding="utf-8")


def _write(path: Path, log: dict[str, np.ndarray], every: int) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        for row in range(0, log["t"].size, every):
            writer.writerow([f"{log[name][row]:.{DECIMALS.get(name, 3)}f}" for name in COLUMNS])
