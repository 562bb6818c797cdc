"""Landing rates by rollouts, and learning a policy anew."""

from pathlib import Path
from typing import Any

import numpy as np

from onboard.policy.files import Policy, policy_crc32, save_policy
from perchhw.learning.grid import Condition, conditions
from perchhw.learning.refine import refine_action
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid, run_sweep
from perchhw.learning.sweep_folder import PAIRS_FILE
from perchhw.learning.train import train_policy
from perchhw.learning.training_set import load_training_set
from perchhw.learning.validate import validate_policy

POLICY_FILE = "relearned.policy.json"

RATE_GRID: tuple[Condition, ...] = conditions((2.0, 2.25, 2.5, 2.75, 3.0), (40.0, 45.0, 50.0, 55.0, 60.0))
"""Conditions at which landing rates are counted by rollouts."""

ROLLOUTS = 36
"""Of each condition: standard error of a mean rate over the grid below 0.02."""

SENSING = ("realistic", "late")
"""Cues of 0 to 15 ms of age, and of always 15 ms (docs/learning.md)."""

SWEEP = SweepGrid(
    tuple(round(1.8 + 0.1 * k, 1) for k in range(15)), tuple(37.5 + 2.5 * k for k in range(12)), 3
)
"""What is learned anew: the grid of the rates and a margin around it."""


def landing_rates(policy: Policy, vehicle: str, seed: int) -> dict[str, dict[str, float]]:
    """Mean rates of a policy on a vehicle over :data:`RATE_GRID`, by kind of sensing.

    Returns:
        ``clean`` (four legs, no contact of the body), ``four_leg``, ``body_contact`` and ``trigger`` rates.
    """
    columns = {
        "clean": "landing_rate",
        "four_leg": "four_leg_rate",
        "body_contact": "body_contact_rate",
        "trigger": "trigger_rate",
    }
    rates = {}
    for sensing in SENSING:
        setup = LearningSetup(vehicle=vehicle, sensing=sensing, seed=seed)
        rows = validate_policy(policy, setup, RATE_GRID, rollouts=ROLLOUTS)
        rates[sensing] = {
            name: float(np.mean([float(row[column] or 0.0) for row in rows]))
            for name, column in columns.items()
        }
    return rates


def learn_again(folder: Path, vehicle: str, seed: int) -> dict[str, Any]:
    """Sweep, train and refine a policy for a vehicle; an interrupted sweep goes on.

    Returns:
        ``policy`` (its file), ``crc32`` and ``pairs``.
    """
    setup = LearningSetup(vehicle=vehicle, seed=seed)
    run_sweep(setup, SWEEP, folder, resume=True)
    pairs = load_training_set(folder / PAIRS_FILE, landing_rate_min=0.8)
    trained = train_policy(pairs, name="relearned", seed=seed).policy
    policy = refine_action(trained, setup, conditions(SWEEP.speeds, SWEEP.angles_deg))
    path = folder / POLICY_FILE
    save_policy(policy, path)
    return {"policy": str(path), "crc32": policy_crc32(policy), "pairs": len(pairs.a_rot)}
