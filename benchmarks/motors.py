"""The tachometer and thrust fits against simulated truths: the acceptance figures of the bench notes 6.

    python benchmarks/motors.py [--seeds 200] [--jobs 2]

Rotors are integrated numerically and scales drift (``tests/tachometer``, ``tests/thrust_voltage``); the fits
share no formula with them. One JSON document goes to stdout. Errors of 63 % times are over their truth.
"""

import argparse
import dataclasses
import json
import os
import platform
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from calibration.bench.motors.analysis import analyse
from calibration.bench.motors.checks import check_edges
from calibration.bench.motors.clock import ClockFit, fit_clock
from calibration.bench.motors.propellers import propeller
from calibration.bench.motors.revolutions import mark_passages
from calibration.bench.motors.settling import time_to_share
from calibration.bench.thrust.analysis import questions
from calibration.bench.thrust.choose import choose, report_forms
from calibration.bench.thrust.law import VEHICLE_FORMS
from calibration.bench.thrust.raw_table import to_data
from calibration.measurement import Estimate
from tests.truth.bench.rotor import Motor, Sensor, edges, staircase, turn, windows
from tests.truth.bench.thrust_stand import GF, record, truth

STEPS = ((300.0, 2400.0), (1500.0, 2400.0), (0.0, 1500.0), (2000.0, 2200.0))
"""rad/s, up; down is the way back."""
HOVER = 0.0934
PROPELLER = propeller("bitcraze-2015")
CLOCK_SIGMA = 5e-5
SENSORS = {
    "clean": Sensor(),
    "sim": Sensor(missed=0.003, doubled=0.001),
    "bad": Sensor(missed=0.02, doubled=0.01),
}


def motor_of(rng: np.random.Generator) -> Motor:
    """A brushed motor of this size; its back electromotive force shows or does not."""
    return Motor(
        rng.uniform(0.5, 4.0), rng.uniform(3.5e-3, 5e-3), rng.uniform(0.2, 0.8), rng.uniform(1.5e-3, 2.2e-3)
    )


def tachometer_run(kind: str, seed: int) -> dict[str, Any]:
    """One motor, three repeats of six steps: errors, whether intervals hold the truth, processor seconds."""
    rng = np.random.default_rng(seed)
    motor = motor_of(rng)
    if kind == "windows":
        motor = dataclasses.replace(motor, a_up=0.0)
    motion = turn(motor, staircase(rng))
    clock = ClockFit(Estimate(1.0, "1", CLOCK_SIGMA), 60.0)
    if kind == "windows":
        recording, used = windows(motion, 0.051, rng), None
    else:
        recording, used = edges(motion, SENSORS[kind], rng, clock=1.0 + rng.normal(0.0, CLOCK_SIGMA)), clock
    begin = time.process_time()
    result = analyse([recording], PROPELLER, HOVER, clock=used)
    seconds = time.process_time() - begin
    relative, absolute, held, hover = [], [], {}, []
    for name, fit, a, b in (
        ("up", result.up, motor.a_up, motor.b_up),
        ("down", result.down, motor.a_down, motor.b_down),
    ):
        if fit is None:
            raise SystemExit(f"{kind}, seed {seed}: no step {name}")
        held[f"a_{name}"] = abs(fit.a.value - a) <= fit.a.u95
        held[f"b_{name}"] = abs(fit.b.value - b) <= fit.b.u95
        for number, step in enumerate(STEPS):
            start, end = step if name == "up" else step[::-1]
            expected, got = time_to_share(start, end, a, b), fit.time_63(start, end)
            relative.append(abs(got.value / expected - 1.0))
            absolute.append(abs(got.value - expected))
            held[f"time_63_{name}_{number}"] = abs(got.value - expected) <= got.u95
        at_hover = 1.0 / (a + 2.0 * b * PROPELLER.speed(HOVER))
        hover.append(abs(fit.local(PROPELLER.speed(HOVER)).value / at_hover - 1.0))
    accepted = [min(r / 0.01, s / 1e-3) <= 1.0 for r, s in zip(relative, absolute, strict=True)]
    return {
        "relative": max(relative),
        "absolute_s": max(absolute),
        "within": all(accepted),
        "hover": max(hover),
        "held": held,
        "seconds": seconds,
        "labelled": any(f.code == "low_resolution" for f in result.findings),
    }


def tachometer(kind: str, seeds: int, pool: ProcessPoolExecutor) -> dict[str, Any]:
    """Figures of one sensor over all seeds."""
    runs = list(pool.map(partial(tachometer_run, kind), range(seeds), chunksize=4))
    names = runs[0]["held"]
    return {
        "seeds": seeds,
        "largest_relative_error_of_63_percent_times": max(run["relative"] for run in runs),
        "relative_error_95th_percentile": float(np.quantile([run["relative"] for run in runs], 0.95)),
        "largest_absolute_error_s": max(run["absolute_s"] for run in runs),
        "runs_within_1_percent_or_1_ms": float(np.mean([run["within"] for run in runs])),
        "runs_within_8_percent": float(np.mean([run["relative"] <= 0.08 for run in runs])),
        "largest_relative_error_of_hover_constants": max(run["hover"] for run in runs),
        "coverage": float(np.mean([list(run["held"].values()) for run in runs])),
        "coverage_by_quantity": {n: float(np.mean([run["held"][n] for run in runs])) for n in names},
        "labelled_low_resolution": float(np.mean([run["labelled"] for run in runs])),
        "cpu_seconds_median": float(np.median([run["seconds"] for run in runs])),
    }


def blades_run(seed: int) -> dict[str, bool]:
    """Two blades said to be three, three to be two; and false alarms."""
    rng = np.random.default_rng(10_000 + seed)
    motion = turn(motor_of(rng), [0.0, 1500.0, 2400.0, 1500.0, 0.0])
    found: dict[str, bool] = {}
    for true, said in ((2, 3), (3, 2), (2, 2), (3, 3)):
        seen = edges(motion, dataclasses.replace(SENSORS["sim"], marks=true), rng)
        parts = [mark_passages(part) for part in seen.parts()]
        codes = {finding.code for finding in check_edges(seen, parts, said)}
        found[f"{true}_said_{said}"] = "blade_count" in codes
    return found


def clock_run(seed: int) -> float:
    """What is left of a resonator's error after 60 s of heartbeats with latencies."""
    rng = np.random.default_rng(20_000 + seed)
    off = 1.0 + rng.uniform(-5e-3, 5e-3)
    host = np.arange(0.0, 60.0, 0.1)
    late = host + 2e-3 + rng.exponential(3e-3, host.size) + (rng.random(host.size) < 0.02) * 0.3
    return abs(fit_clock(np.rint(host * off / 4e-6) * 4e-6, late).scale.value * off - 1.0)


def thrust_run(name: str, motors: int, seed: int) -> dict[str, Any]:
    """One table of 25 points: largest errors of the forms in gf, share of the curve inside the band."""
    rng = np.random.default_rng(30_000 + seed)
    data = to_data(record(name, rng, motors=motors))
    begin = time.process_time()
    reports = report_forms(data, VEHICLE_FORMS)
    chosen = choose(reports)
    seconds = time.process_time() - begin
    voltage = np.linspace(data.voltage.min(), data.voltage.max(), 41)
    expected = truth(name, voltage) / GF
    worst = {
        form: float(np.max(np.abs(one.fit.thrust_at(voltage) - expected))) for form, one in reports.items()
    }
    inside = np.abs(chosen.fit.thrust_at(voltage) - expected) <= chosen.band(voltage, list(reports.values()))
    return {
        "worst": worst,
        "chosen": chosen.name,
        "chosen_worst": worst[chosen.name],
        "inside": float(np.mean(inside)),
        "seconds": seconds,
    }


def thrust(name: str, motors: int, seeds: int, pool: ProcessPoolExecutor) -> dict[str, Any]:
    """Figures of one truth over all seeds."""
    runs = list(pool.map(partial(thrust_run, name, motors), range(seeds), chunksize=8))
    figures = {
        form: {
            "largest_gf": max(run["worst"][form] for run in runs),
            "median_of_largest_gf": float(np.median([run["worst"][form] for run in runs])),
            "tables_within_0_1_gf": float(np.mean([run["worst"][form] <= 0.1 for run in runs])),
        }
        for form in runs[0]["worst"]
    }
    return {
        "seeds": seeds,
        "motors_on_the_scale": motors,
        "forms": figures,
        "chosen": {form: sum(run["chosen"] == form for run in runs) for form in runs[0]["worst"]},
        "chosen_within_0_1_gf": float(np.mean([run["chosen_worst"] <= 0.1 for run in runs])),
        "coverage_of_band": float(np.mean([run["inside"] for run in runs])),
        "cpu_seconds_median": float(np.median([run["seconds"] for run in runs])),
    }


def units_run(seed: int) -> dict[str, bool]:
    """Whether each wrong unit is asked about, and nothing is when all are right."""
    rng = np.random.default_rng(40_000 + seed)
    name = ("L250", "T350", "P250", "DC")[seed % 4]
    run = record(name, rng, motors=4)
    wrong = {
        "none": run,
        "N_as_g": dataclasses.replace(run, scale=run.scale * GF),
        "g_as_N": dataclasses.replace(run, scale=run.scale / GF),
        "total_as_one_motor": dataclasses.replace(run, motors=np.ones(run.motors.size)),
        "divided_twice": dataclasses.replace(run, scale=run.scale / 4.0),
        "command_0_255": dataclasses.replace(run, command=np.floor(run.command / 256.0)),
        "mV_as_V": dataclasses.replace(run, supply=run.supply * 1e3, board=run.board * 1e3),
    }
    return {kind: any(f.code.startswith("unit_") for f in questions(one)) for kind, one in wrong.items()}


def shares(rows: list[dict[str, bool]]) -> dict[str, float]:
    """Share of the rows in which each name holds."""
    return {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}


def main() -> None:
    """Run everything and print the document."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    with ProcessPoolExecutor(options.jobs) as pool:
        document = {
            "benchmark": "motors",
            "python": platform.python_version(),
            "machine": f"{platform.machine()}, {os.cpu_count()} cores",
            "tachometer": {kind: tachometer(kind, options.seeds, pool) for kind in (*SENSORS, "windows")},
            "blades_flagged": shares(list(pool.map(blades_run, range(options.seeds), chunksize=8))),
            "clock_error_after_60_s": float(np.max(list(pool.map(clock_run, range(options.seeds))))),
            "thrust": {
                f"{name}_{motors}": thrust(name, motors, options.seeds, pool)
                for name in ("L250", "T350", "DC")
                for motors in (1, 4)
            },
            "unit_errors_asked_about": shares(list(pool.map(units_run, range(options.seeds), chunksize=8))),
        }
    print(json.dumps(document, indent=2))


if __name__ == "__main__":
    main()
