"""Mutate the landing machine in C and see whether the reference's tests notice. Prints one JSON document.

    python -m tests.firmware.mutation [--sample N --seed S] [--jobs N] [--out DIR] [--again]

The tests of :mod:`onboard.landing` run on the machine in C (:mod:`tests.firmware.mutation.machine`). Those
that ask for more than ms and float32 fail on the code as it is; they are counted and set aside. Exit code 1:
a mutant survived. Results are kept in DIR; the same command goes on where it was stopped as long as code and
tests are the same.
"""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

from tests.mutation.environment import set_up


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.firmware.mutation")
    parser.add_argument("--sample", type=int, help="try only so many mutants, drawn from all")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="mutants tried at a time")
    parser.add_argument(
        "--out", type=Path, default=Path("mutation-run/landing-in-c"), help="folder of the results"
    )
    parser.add_argument(
        "--again", action="store_true", help="keep what was killed, though code or tests have changed"
    )
    return parser.parse_args()


def main() -> int:
    """Run and print; the exit code."""
    options = _options()
    with tempfile.TemporaryDirectory() as scratch:
        set_up(scratch)
        from tests.firmware.mutation.run import run

        document = run(
            options.sample,
            options.seed,
            options.jobs,
            Path(scratch),
            options.out,
            again=options.again,
        )
    sys.stdout.write(json.dumps(document, indent=1) + "\n")
    return 0 if document["passed"] else 1


if __name__ == "__main__":
    sys.exit(main())
