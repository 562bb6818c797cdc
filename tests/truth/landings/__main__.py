"""Judge hidden legs over many seeds; one line of JSON each.

python -m tests.truth.landings none --count 8 --seeds 40
python -m tests.truth.landings authors-like --count 20 --seeds 3 --radio
"""

import argparse
import dataclasses
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from calibration.flights import open_flights
from calibration.gap.landings import LandingFindings, judge_landings
from onboard.vehicle import load_vehicle
from tests.truth.landings.campaign import CASES, write_campaign
from tests.truth.landings.radio import through_the_radio


def judged(case: str, count: int, seed: int, radio: bool) -> tuple[LandingFindings, float]:
    """Findings, and the processor time of the judgement (s)."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_campaign(case, count, seed, folder / "f", folder / "answer.json", every=4 if radio else 2)
        flights, _ = open_flights(sorted((folder / "f").glob("*.csv")))
    if radio:
        rng = np.random.default_rng(seed)
        flights = [through_the_radio(flight, rng) for flight in flights]
    begin = time.process_time()
    found = judge_landings(flights, load_vehicle("crazyflie21-upgraded-stored"), np.random.default_rng(seed))
    return found, time.process_time() - begin


def line(case: str, seed: int, found: LandingFindings, seconds: float) -> dict[str, Any]:
    return {
        "case": case,
        "seed": seed,
        "verdict": found.verdict,
        "findings": [dataclasses.asdict(finding) for finding in found.findings],
        "allowed": found.allowed,
        "misfit": found.misfit,
        "processor_s": round(seconds, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("case", choices=sorted(CASES))
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--radio", action="store_true")
    chosen = parser.parse_args()
    for seed in range(1, chosen.seeds + 1):
        found, seconds = judged(chosen.case, chosen.count, seed, chosen.radio)
        sys.stdout.write(json.dumps(line(chosen.case, seed, found, seconds)) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
