"""How true landings are to life, from the shared data. Prints one JSON document.

    python benchmarks/landings_reality.py --data ../shared/data [--draws 200] [--rollouts 100] [--repeats 6]

The gap on the authors' flights before (`crazyflie21-upgraded-stored`) and now, what is missing in either
file, what to expect of more flights; the policy that they flew from the conditions of their approaches, real
and simulated; our policies as real approaches scatter; agreement with their sweeps of three leg designs. Each
part is a command of docs/gap_landings_authors.md or docs/learning.md; ten minutes on two cores.
"""

import argparse
import csv
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calibration.gap.landings.outcomes.labels import CLASS_NAMES, LABELS_FILE, landing_class
from onboard.outcome import Outcome
from onboard.policy.files import Policy, import_authors_policy
from perchhw.attempt import DEFAULT_VEHICLE, STORED_VEHICLE
from perchhw.learning.as_flown import fly_policy
from perchhw.learning.grid import Condition
from perchhw.learning.setup import MEASURED, LearningSetup
from perchhw.learning.sweep_folder import Row
from perchhw.learning.validate import validate_policy
from sim_backend.engine_name import usable_engine

GRID = ("--domain", "none", "--speeds", "1.5:3.5:0.25", "--angles", "30:90:5", "--seed", "7")
SWEEPS = {
    "NL": ("--legs", "semi-narrow-long", "--reward", "flown", "--gains", "gazebo"),
    "WS": ("--legs", "wide-short", "--reward", "later", "--gains", "authors"),
    "NS": ("--legs", "semi-narrow-short", "--reward", "later", "--gains", "gazebo"),
}
"""What each of the authors' sweeps had (docs/learning.md)."""
POLICIES = ("default", "pads", "measured")


def told(*arguments: object) -> dict[str, Any]:
    """The document of a perchhw command."""
    command = [sys.executable, "-m", "perchhw", "--json", *map(str, arguments)]
    found = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    assert isinstance(found, dict)
    return found


def gap(flights: Path, draws: int) -> dict[str, Any]:
    """What `gap landings --search` says of both vehicle files."""
    kept = ("verdict", "says", "score", "expectation", "launch", "search")
    found = {}
    for vehicle in (STORED_VEHICLE, DEFAULT_VEHICLE):
        asked = ("--data", flights, "--vehicle", vehicle, "--draws", draws, "--search")
        document = told("gap", "landings", *asked)
        found[vehicle] = {key: document[key] for key in kept}
    return found


def flown_policy(flights: Path, policy: Policy, rollouts: int) -> dict[str, dict[str, float]]:
    """The authors' classified approaches with their policy: shares that really happened, and simulated."""
    with (flights / LABELS_FILE).open(encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["outcome"]]
    outcomes = [Outcome(row["outcome"]) for row in rows]
    classes = [landing_class(outcome) for outcome in outcomes]
    bodies = {Outcome.FOUR_LEG_BODY_CONTACT, Outcome.TWO_LEG_BODY_CONTACT}
    real = {name: float(np.mean([one == k for one in classes])) for k, name in enumerate(CLASS_NAMES)}
    real |= {
        "clean_four": float(np.mean([outcome is Outcome.FOUR_LEG for outcome in outcomes])),
        "body_contact": float(np.mean([outcome in bodies for outcome in outcomes])),
    }
    approaches = [Condition(float(row["speed_m_s"]), float(row["angle_deg"])) for row in rows]
    found = {"real": real}
    grid = tuple(dict.fromkeys(approaches))
    for sensing in (MEASURED, "realistic", "perfect"):
        setup = LearningSetup(sensing=sensing, domain="none", seed=3)
        rows = validate_policy(policy, setup, grid, rollouts=rollouts)
        found[sensing] = shares(approaches, dict(zip(grid, rows, strict=True)))
    setup = LearningSetup(domain="none", seed=3)
    rows = fly_policy(policy, setup, grid, flights=rollouts, engine=usable_engine(None))
    found["as_flown"] = shares(approaches, dict(zip(grid, rows, strict=True)))
    return found


def shares(approaches: Sequence[Condition], flown: Mapping[Condition, Row]) -> dict[str, float]:
    """Mean rates over the approaches."""
    named = {
        "triggers": "trigger_rate", "four": "four_leg_rate", "clean_four": "landing_rate",
        "two": "two_leg_rate", "body_contact": "body_contact_rate",
    }  # fmt: skip
    return {
        name: float(np.mean([float(flown[one][column] or 0.0) for one in approaches]))
        for name, column in named.items()
    }


def policies(folder: Path, rollouts: int) -> dict[str, Any]:
    """`learn validate` of our policies."""
    found = {}
    for name in POLICIES:
        out = ("--rollouts", rollouts, "--out", folder / name)
        document = told("learn", "validate", "--policy", name, *GRID, *out)
        kept = ("measured", "real_rate", "four_leg_rate", "two_leg_rate", "trigger_rate")
        found[name] = {key: document[key] for key in kept}
    return found


def agreements(sweeps: Path, folder: Path, repeats: int) -> dict[str, Any]:
    """`learn agreement` with each sweep of the authors, without and with their launch."""
    found = {}
    for letters, settings in SWEEPS.items():
        for launch in ("gazebo", "gazebo-launch"):
            sensing = launch if letters == "NL" else f"{launch}-later"
            asked = ("--reference", sweeps / f"{letters}_LR_Trials.csv", *settings, "--sensing", sensing)
            out = ("--repeats", repeats, "--out", folder / f"{letters}-{launch}")
            found[f"{letters}, {sensing}"] = told("learn", "agreement", *asked, *out)["median_of_sweeps"]
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Ask for all, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path, required=True, help="the shared data, with habas2022/ in it")
    parser.add_argument("--draws", type=int, default=200, help="simulated landings a flight")
    parser.add_argument("--rollouts", type=int, default=100, help="attempts at each condition of a policy")
    parser.add_argument("--repeats", type=int, default=6, help="of the sweeps; a multiple of 3")
    chosen = parser.parse_args(arguments)
    authors = chosen.data / "habas2022"
    policy = import_authors_policy(authors / "policy" / "flown_policy.json", "flown")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        document = {
            "benchmark": "landings_reality",
            "gap": gap(authors / "flights", chosen.draws),
            "flown_policy": flown_policy(authors / "flights", policy, chosen.rollouts),
            "policies": policies(folder, chosen.rollouts),
            "agreement": agreements(authors / "sweeps", folder, chosen.repeats),
        }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
