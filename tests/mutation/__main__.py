"""Mutate the safety code and see whether the tests notice. Prints one JSON document.

    python -m tests.mutation [FILE ...] [--sample N --seed S] [--jobs N] [--out DIR] [--again]

Kernels are interpreted (NUMBA_DISABLE_JIT=1). Exit code 1: a mutant survived, or the list of equivalent
mutants (allowed.toml) does not fit any more. Results are kept in DIR; the same command goes on where it was
stopped as long as code and tests are the same.
"""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

from tests.mutation.environment import set_up


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", help="only files whose path begins so, e.g. onboard/landing")
    parser.add_argument("--sample", type=int, help="try only so many mutants, drawn from all")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="mutants tried at a time")
    parser.add_argument("--out", type=Path, default=Path("mutation-run"), help="folder of the results")
    parser.add_argument(
        "--again", action="store_true", help="keep what was killed, though code or tests have changed"
    )
    return parser.parse_args()


def main() -> int:
    """Run and print; the exit code."""
    options = _options()
    with tempfile.TemporaryDirectory() as scratch:
        set_up(scratch)
        from tests.mutation.run import run

        document = run(
            options.files, options.sample, options.seed, options.jobs, options.out, again=options.again
        )
    sys.stdout.write(json.dumps(document, indent=1) + "\n")
    return 0 if document["passed"] else 1


if __name__ == "__main__":
    sys.exit(main())
