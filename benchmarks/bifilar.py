"""Bifilar inertia against a pendulum that shares no formula with the fit. Prints one JSON document.

    python benchmarks/bifilar.py [--seeds 200] [--runs 500] [--seed 0] [--data FOLDER]

`fits`: error of the inertia (twice that of the period at zero amplitude), per case, over `seeds` recordings
of random hangs (``tests/truth/bench/pendulum.py``). `measurements`: whole ones, five trials each, with every
input drawn from its stated distribution, with and without the air's share: error and coverage of the 95 %
interval. `fuzzed`: damaged recordings. `logs`: the authors' logs, where the data are at hand.
"""

import argparse
import json
import math
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from calibration.bench.inertia.errors import UnusableSwingError
from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.geometry import small_period
from calibration.bench.inertia.inertia import inertia_about_axis
from calibration.bench.inertia.paper import peak_period
from calibration.bench.inertia.recordings import read_swing
from calibration.bench.inertia.rig import Rig, measured
from calibration.measurement import Estimate
from tests.bifilar.damage import damaged
from tests.truth.bench.pendulum import Hang, record

LIMITS = {"jig": (0.1e-3, 0.5e-3, 0.02e-3), "ruler": (0.5e-3, 1e-3, 0.05e-3)}
"""Half widths of distance (m), length (m) and mass (kg) by kind of instrument."""

CASES: dict[str, dict[str, Any]] = {
    "5 to 15 deg, 5 % loss, 0.4 s gap": {"degrees": (5.0, 15.0), "loss": 0.05, "gap": 0.4},
    "25 deg, 5 % loss, 0.4 s gap": {"degrees": (25.0, 25.0), "loss": 0.05, "gap": 0.4},
    "host, 30 Hz, 10 ms jitter, 9 cycles, the authors' rig": {
        "degrees": (17.0, 17.0),
        "rate_hz": 30.0,
        "jitter": 0.010,
        "cycles": 9.0,
        "rig": (0.030, 0.594),
    },
    "host, 30 Hz, 10 ms jitter, 9 cycles, random hangs": {
        "degrees": (5.0, 20.0),
        "rate_hz": 30.0,
        "jitter": 0.010,
        "cycles": 9.0,
    },
    "10 % swing": {"degrees": (5.0, 15.0), "swing": 0.10},
    "30 % swing": {"degrees": (5.0, 15.0), "swing": 0.30},
}


def random_hang(rng: np.random.Generator, swing: float = 0.0, rig: tuple[float, float] | None = None) -> Hang:
    """Of a drone of 15 to 50e-6 kg m2; string distance and length random, or as in `rig` (m).

    The torsion keeps away from the swing, as the planner has it.
    """
    while True:
        hang = Hang(
            inertia=rng.uniform(15e-6, 50e-6),
            mass=rng.uniform(0.030, 0.040),
            top=(distance := rig[0] if rig else rng.uniform(0.055, 0.09)),
            bottom=distance,
            length=rig[1] if rig else rng.uniform(0.5, 0.8),
            linear=rng.uniform(0.004, 0.02),
            quadratic=rng.uniform(0.0, 0.05),
            swing=swing,
        )
        ratio = hang.period / (math.tau * math.sqrt(hang.length / hang.gravity))
        if all(not low <= ratio <= high for low, high in ((0.45, 0.55), (0.9, 1.1), (1.9, 2.1))):
            return hang


def exact_rig(hang: Hang) -> Rig:
    """A rig that was measured without error."""
    top, bottom, length = (Estimate(value, "m", 0.0) for value in (hang.top, hang.bottom, hang.length))
    return Rig(Estimate(hang.mass, "kg", 0.0), top, bottom, length)


def fit_case(seeds: int, seed: int, case: dict[str, Any]) -> dict[str, Any]:
    """Errors of the inertia in %, and what was found."""
    settings = dict(case)
    low, high = settings.pop("degrees")
    swing, rig = settings.pop("swing", 0.0), settings.pop("rig", None)
    errors, fits, seconds = [], [], []
    for k in range(seeds):
        rng = np.random.default_rng([seed, k])
        hang = random_hang(rng, swing, rig)
        recording = record(hang, rng, rng.uniform(low, high), **settings)
        begin = time.process_time()
        fits.append(fit_swing(recording))
        seconds.append(time.process_time() - begin)
        errors.append(100.0 * ((small_period(fits[-1], exact_rig(hang)) / hang.period) ** 2 - 1.0))
    flagged = [any(finding.code == "swing" for finding in fit.findings) for fit in fits]
    kept = [abs(error) for error, fit in zip(errors, fits, strict=True) if not fit.rejected]
    return {
        "bias_percent": round(float(np.mean(errors)), 5),
        "sd_percent": round(float(np.std(errors)), 5),
        "worst_percent": round(float(np.max(np.abs(errors))), 5),
        "worst_percent_of_those_kept": round(max(kept), 5) if kept else None,
        "rejected": len(errors) - len(kept),
        "swing_flagged": sum(flagged),
        "two_modes_fitted": sum(fit.second_mode for fit in fits),
        "seconds_median": round(float(np.median(seconds)), 3),
        "seconds_worst": round(float(np.max(seconds)), 3),
    }


def whole_run(rng: np.random.Generator) -> dict[str, tuple[float, float]]:
    """Error and half interval (%, of the truth) of one measurement of five trials, by kind of instruments."""
    truth = rng.uniform(15e-6, 50e-6)
    tilt = math.radians(rng.normal(0.0, 1.0))
    swung = truth * (1.0 + (rng.uniform(0.55, 1.8) - 1.0) * math.sin(tilt) ** 2)
    air = rng.uniform(0.0, 0.002)
    hang = Hang(inertia=swung, length=0.6, gravity=rng.normal(9.803, 0.01), offset=rng.normal(0.0, 0.5e-3))
    fits = []
    for _ in range(5):
        rehung = hang.changed(inertia=swung * (1.0 + rng.normal(0.0, 0.001)) ** 2)
        fits.append(fit_swing(record(rehung, rng, rng.uniform(5.0, 12.0), rate_hz=50.0, loss=0.02)))
    found = {}
    for kind, limits in LIMITS.items():
        result = inertia_about_axis(fits, read_rig(hang, rng, *limits), truth).inertia
        for name, weight in ((f"{kind}, no air", truth), (f"{kind}, air", truth / (1.0 + air))):
            found[name] = (100.0 * (result.value / weight - 1.0), 100.0 * result.u95 / weight)
    return found


def read_rig(hang: Hang, rng: np.random.Generator, distance: float, length: float, mass: float) -> Rig:
    """The rig as read three times with instruments of these half widths, a tenth of which scatters."""
    ruler = rng.uniform(-distance, distance)  # one ruler: the same at top and bottom

    def read(value: float, limit: float, error: float, unit: str) -> Estimate:
        return measured([value + error + rng.normal(0.0, 0.1 * limit) for _ in range(3)], limit, unit)

    return Rig(
        read(hang.mass, mass, rng.uniform(-mass, mass), "kg"),
        read(hang.top, distance, ruler, "m"),
        read(hang.bottom, distance, ruler, "m"),
        read(hang.length, length, rng.uniform(-length, length), "m"),
    )


def measurements(runs: int, seed: int) -> dict[str, dict[str, float]]:
    """Errors and coverage of whole measurements, by kind of instruments and whether air moves along."""
    found = [whole_run(np.random.default_rng([seed, k])) for k in range(runs)]
    report = {}
    for name in found[0]:
        error, half = np.array([one[name] for one in found]).T
        report[name] = {
            "bias_percent": round(float(np.mean(error)), 4),
            "error_95_percent": round(float(np.quantile(np.abs(error), 0.95)), 4),
            "within_1_percent": round(float(np.mean(np.abs(error) <= 1.0)), 4),
            "within_2.5_percent": round(float(np.mean(np.abs(error) <= 2.5)), 4),
            "mean_half_interval_percent": round(float(np.mean(half)), 4),
            "coverage": round(float(np.mean(np.abs(error) <= half)), 4),
        }
    return report


def fuzz(count: int, seed: int) -> dict[str, Any]:
    """Damaged recordings: fitted or refused with a message; anything else ends the benchmark."""
    outcome: dict[str, int] = defaultdict(int)
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        whole = record(
            random_hang(rng), rng, rng.uniform(1.0, 30.0), cycles=rng.uniform(1.0, 15.0), rate_hz=50.0
        )
        try:
            fit = fit_swing(damaged(whole, rng))
            outcome["rejected" if fit.rejected else "warned" if fit.findings else "clean"] += 1
        except UnusableSwingError:
            outcome["refused"] += 1
    return {"recordings": count, **outcome}


def real_logs(folder: Path) -> dict[str, Any]:
    """Mean period and spread of each group of the authors' logs, and the paper's estimator on them."""
    groups: dict[str, list[float]] = defaultdict(list)
    wrong = []
    paths = [*folder.glob("bifilar_2022/*_I??_Log-?.csv"), *folder.glob("bifilar_2024/*.csv")]
    for path in sorted(path for path in paths if "Exp_Logs" not in path.name):
        swing = read_swing(path)
        period = fit_swing(swing).period.value
        groups[path.stem.rsplit("-", 1)[0] if "2022" in str(path) else path.stem].append(period)
        if abs(peak_period(swing) / period - 1.0) > 0.1:
            wrong.append(path.stem)
    report: dict[str, Any] = {
        name: {
            "mean_s": round(float(np.mean(periods)), 4),
            "sd_percent": round(100.0 * float(np.std(periods, ddof=1) / np.mean(periods)), 3)
            if len(periods) > 1
            else None,
        }
        for name, periods in groups.items()
    }
    return {**report, "paper_estimator_wrong_by_more_than_10_percent": wrong}


def main() -> None:
    """Run all parts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--fuzzed", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--data", type=Path, help="folder habas2022 of the shared data")
    options = parser.parse_args()
    report: dict[str, Any] = {
        "seed": options.seed,
        "seeds": options.seeds,
        "runs": options.runs,
        "fits": {name: fit_case(options.seeds, options.seed, case) for name, case in CASES.items()},
        "measurements": measurements(options.runs, options.seed),
        "fuzzed": fuzz(options.fuzzed, options.seed),
    }
    if options.data is not None:
        report["logs"] = real_logs(options.data)
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
