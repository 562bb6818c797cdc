"""The pairs that the authors' sweeps ended with, flown in our simulation: landings without learning.

    python benchmarks/authors_pairs.py --sweeps ../shared/data/habas2022/sweeps [--every 1] [--stand-in]

A landing rate that a sweep ends with is what physics and learning made of it together. Their tables hold the
distribution (tau, moment) that each trial ended with: flown as often as they did (18 times), it says what the
physics alone is off by, trial by trial, best of three against best of three. Their sensor of tau sits 12 mm
above their body link; how much earlier besides a flip of ours has to begin (`lead_ms`) is chosen for each
sweep by the correlation over trials, not by the rates. Velocities at the trigger are compared with theirs,
too, where at least half of a trial landed. `--stand-in` begins the approaches as `learn agreement` does
unless told otherwise: at exactly the weight's thrust, with an error of the cues in place of the launch's
scatter. Prints one JSON document.
"""

import argparse
import csv
import json
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from onboard.arrays import FloatArray
from perchhw.learning.ephe import TAU_SCALE
from perchhw.learning.setup import LearningSetup
from perchhw.learning.trial import TRIAL, learn_pair, new_bench, rollouts_most

SWEEPS: dict[str, tuple[str, Mapping[str, str]]] = {
    "NL": ("NL_LR_Trials.csv", {"legs": "semi-narrow-long", "gains": "gazebo", "sensing": "gazebo-launch"}),
    "NL without randomisation": (
        "NL_LR_Trials_NDR.csv",
        {
            "legs": "semi-narrow-long",
            "gains": "authors",
            "sensing": "gazebo-launch-later",
            "domain": "none",
        },
    ),
    "NS": (
        "NS_LR_Trials.csv",
        {"legs": "semi-narrow-short", "gains": "gazebo", "sensing": "gazebo-launch-later"},
    ),
    "WS": ("WS_LR_Trials.csv", {"legs": "wide-short", "gains": "authors", "sensing": "gazebo-launch-later"}),
}
"""File and what their simulation did then (docs/learning.md, Agreement)."""

SENSOR, HIP = 0.012, -0.005
"""m, of their sensor and of the hips from the origin of their body link."""

LEADS = (0.0, 0.004, 0.008, 0.012, 0.016, 0.020)
"""s."""

SLOWEST = 1.75
"""m/s: slower conditions are of an earlier session (docs/learning.md)."""


def numbers(text: str) -> list[float]:
    """A vector as numpy prints it."""
    return [float(part) for part in text.strip("[]").split()]


def flown(
    trials: Sequence[Mapping[str, str]], setup: LearningSetup, lead: float
) -> tuple[FloatArray, FloatArray]:
    """Landing rates (n,) of the trials' last distributions, evaluated as theirs were, and mean velocities
    (n, 2) (m/s: v_z, v_x) at the trigger."""
    parameters, rules = setup.load()
    legs = setup.load_vehicle().legs
    sensor = SENSOR + (legs.hip_z.value - HIP if legs is not None else 0.0)  # above the centre of mass
    bench = new_bench(parameters, rollouts_most(rules.ephe))
    rng = np.random.default_rng(setup.seed)
    rates, velocities = np.zeros(len(trials)), np.full((len(trials), 2), np.nan)
    for number, trial in enumerate(trials):
        (tau, moment), (sigma_tau, sigma_moment) = numbers(trial["Mu"]), numbers(trial["Sigma"])
        speed, angle = float(trial["Vel_d"]), math.radians(float(trial["Phi_d"]))
        as_it_ended = rules.ephe._replace(
            episodes=0, moment_low=moment, moment_high=moment, sigma_tau=sigma_tau, sigma_moment=sigma_moment
        )
        start = tau / TAU_SCALE + sensor / (speed * math.sin(angle)) + lead
        record = np.zeros(1, dtype=TRIAL)[0]
        learn_pair(rng, bench, speed, angle, start, rules._replace(ephe=as_it_ended), record, -1)
        rates[number] = record["landing_rate"]
        fired = bench.outs[: record["rollouts"]]
        fired = fired[fired["triggered"] == 1]
        if len(fired) > 0:
            velocities[number] = fired["velocity_z"].mean(), fired["velocity_x"].mean()
    return rates, velocities


def best(trials: Sequence[Mapping[str, str]], rates: FloatArray) -> float:
    """Mean over the conditions of the best rate of their trials."""
    found: defaultdict[tuple[str, str], float] = defaultdict(float)
    for trial, rate in zip(trials, rates, strict=True):
        key = trial["Vel_d"], trial["Phi_d"]
        found[key] = max(found[key], float(rate))
    return float(np.mean(list(found.values())))


def compared(folder: Path, name: str, every: int, seed: int, stand_in: bool) -> dict[str, Any]:
    """One sweep: each lead, and what the best correlated one leaves of the bias."""
    file, settings = SWEEPS[name]
    with (folder / file).open(encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if float(row["Vel_d"]) > SLOWEST]
    wanted = list(dict.fromkeys((row["Vel_d"], row["Phi_d"]) for row in rows))[::every]
    trials = [row for row in rows if (row["Vel_d"], row["Phi_d"]) in set(wanted)]
    theirs = np.array([float(row["LR_4Leg"]) for row in trials])
    at_trigger = np.array(
        [[float(row[name] or "nan") for name in ("Vz_trg_mean", "Vx_trg_mean")] for row in trials]
    )
    landed = theirs >= 0.5
    if stand_in:
        settings = {**settings, "sensing": settings["sensing"].replace("-launch", "")}
    setup = LearningSetup(vehicle="crazyflie21-gazebo", seed=seed, **settings)
    leads = []
    for lead in LEADS:
        ours, velocities = flown(trials, setup, lead)
        off = np.nanmean((velocities - at_trigger)[landed], axis=0)
        leads.append(
            {
                "lead_ms": 1e3 * lead,
                "correlation": float(np.corrcoef(ours, theirs)[0, 1]),
                "bias_of_trials": float(np.mean(ours - theirs)),
                "bias_of_best": best(trials, ours) - best(trials, theirs),
                "velocity_z_off_m_s": float(off[0]),
                "velocity_x_off_m_s": float(off[1]),
            }
        )
    chosen = max(leads, key=lambda one: one["correlation"])
    return {"trials": len(trials), "mean_rate_theirs": float(theirs.mean()), "chosen": chosen, "leads": leads}


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--sweeps", type=Path, required=True, help="folder of the authors' tables")
    parser.add_argument("--every", type=int, default=1, help="take every so-many-th condition")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--stand-in", action="store_true", help="exact launch, scattered cues")
    asked = parser.parse_args()
    found = {name: compared(asked.sweeps, name, asked.every, asked.seed, asked.stand_in) for name in SWEEPS}
    print(json.dumps({"benchmark": "authors_pairs", "stand_in": asked.stand_in, "sweeps": found}, indent=1))


if __name__ == "__main__":
    main()
