"""``python -m tests.truth.hidden_effects --case rotor_drag --size weak --seed 1 --out DIR --answer FILE``."""

import argparse
from pathlib import Path

from tests.truth.hidden_effects.campaign import VEHICLE, make_flights
from tests.truth.hidden_effects.cases import CASES
from tests.truth.hidden_effects.effects import SIZES


def main() -> None:
    """Write one campaign."""
    parser = argparse.ArgumentParser(prog="python -m tests.truth.hidden_effects", description=__doc__)
    parser.add_argument("--case", required=True, choices=CASES)
    parser.add_argument("--size", default="medium", choices=SIZES)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--flights", type=int, default=20)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--answer", type=Path, required=True, help="file outside --out")
    parser.add_argument(
        "--defects", action="store_true", help="second tier: clocks, radio gaps, tilt, slow torque"
    )
    parser.add_argument("--vehicle", default=VEHICLE)
    given = parser.parse_args()
    make_flights(**vars(given))


if __name__ == "__main__":
    main()
