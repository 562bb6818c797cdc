"""Fresh landings of learned pairs with the factors that decide them: the rows of ``landings.csv``."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from onboard.jit import alone
from perchhw.learning.ephe import sample
from perchhw.learning.grid import Condition, generator
from perchhw.learning.setup import Recipe, prepared
from perchhw.learning.sweep_folder import Row, cell
from perchhw.learning.trial import Rules, TrialMemory, fly, new_bench, threshold_policy
from sim_backend.physics.landing_factors import FACTORS, landing_factors
from sim_backend.physics.outcome import classify

_PURPOSE = 4

ANGLES = ("tilt", "swing_angle", "window_low", "window_margin")
"""Factors that the table gives in degrees."""

FACTOR_COLUMNS = tuple(f"{name}_deg" if name in ANGLES else name for name in FACTORS.names or ())

COLUMNS = (
    "design", "speed_m_s", "angle_deg", "trial", "rollout", "outcome", "feet", "body_contact", "tau",
    "theta_x", "d_ceil", "a_rot", "impact_time", *FACTOR_COLUMNS,
)  # fmt: skip
"""Columns of ``landings.csv``, SI and deg. The cues are empty where nothing triggered, the factors where
nothing touched the ceiling, ``sufficiency`` also where gravity asks for nothing."""

Pair = tuple[float, float, int, float, float, float, float]
"""speed (m/s), angle (deg), repeat; mean and standard deviation of tau, then of the moment (EPHE's units)."""


def pair_of(row: Row) -> Pair:
    """The pair of a row of ``pairs.csv``."""
    names = ("mu_tau", "sigma_tau", "mu_moment_nmm", "sigma_moment_nmm")
    mu_tau, sigma_tau, mu_moment, sigma_moment = (float(row[name] or 0.0) for name in names)
    condition = float(row["speed_m_s"] or 0.0), float(row["angle_deg"] or 0.0), int(row["trial"] or 0)
    return *condition, mu_tau, sigma_tau, mu_moment, sigma_moment


@alone
def fly_pair(
    rng: Any, bench: TrialMemory, factors: Any, mu: Any, sigma: Any, speed: float, angle: float, rules: Rules
) -> None:
    """Attempts of a learned distribution into ``bench.outs``, and the factors of those that touched."""
    for k in range(len(factors)):
        policy = threshold_policy(sample(rng, mu, sigma, rules.ephe))
        fly(rng, bench, k, policy, speed, angle, rules)
        if bench.outs[k].contact:
            landing_factors(bench.state[0], bench.drawn[0], factors[k])


@dataclass(frozen=True)
class LandPair:
    """The work of a leg study on one pair, as an executor takes it."""

    recipe: Recipe
    rollouts: int

    def __call__(self, pair: Pair) -> tuple[Row, ...]:
        """The rows of one pair, without the design."""
        parameters, rules = prepared(self.recipe)
        speed, angle_deg, repeat, mu_tau, sigma_tau, mu_moment, sigma_moment = pair
        rng = generator(self.recipe.setup.seed, _PURPOSE, Condition(speed, angle_deg), repeat)
        bench, factors = new_bench(parameters, self.rollouts), np.zeros(self.rollouts, FACTORS)
        mu, sigma = np.array([mu_tau, mu_moment]), np.array([sigma_tau, sigma_moment])
        fly_pair(rng, bench, factors, mu, sigma, speed, math.radians(angle_deg), rules)
        condition: Row = {"speed_m_s": speed, "angle_deg": angle_deg, "trial": repeat}
        return tuple(
            {**condition, "rollout": k, **_result(bench.outs[k]), **_factors(bench.outs[k], factors[k])}
            for k in range(self.rollouts)
        )


def _result(out: Any) -> Row:
    feet, triggered = int(out["feet"]), bool(out["triggered"])
    row: Row = {
        "outcome": classify(feet, bool(out["body_contact"]), triggered).value,
        "feet": feet,
        "body_contact": int(out["body_contact"]),
        "impact_time": float(out["impact_time"]) if out["contact"] else None,
    }
    return row | {
        name: float(out[name]) if triggered else None for name in ("tau", "theta_x", "d_ceil", "a_rot")
    }


def _factors(out: Any, factors: Any) -> Row:
    if not out["contact"]:
        return dict.fromkeys(FACTOR_COLUMNS)
    row: Row = {}
    for name, column in zip(FACTORS.names or (), FACTOR_COLUMNS, strict=True):
        value = factors[name].item()
        if name in ANGLES:
            value = math.degrees(value)
        row[column] = value if math.isfinite(value) else None
    return row


def landings_text(rows: Sequence[Row]) -> str:
    """``landings.csv`` of rows with their design."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([cell(row[name]) for name in COLUMNS] for row in rows)
    return text.getvalue()
