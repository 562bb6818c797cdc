"""Judge the probability that the gap finder gives to its names: of those claimed with 0.9, are 9 in 10 right?

    python benchmarks/gap_reliability.py --table FILE [--first SEED] [--picture FILE.png]

The table is that of `gap_random.py`, of sets that the probabilities were not counted on (those of 875224649,
875224849, 1734762763, 1911831171 and 1911831371 on were: `calibration/gap/report/confidence.py`; for names
beside a gap those of 1540545265, 1540545465, 3993213141 and 3993213341 on); `--first` leaves out those before
a seed. The probability is that of today for a name's clearness and the verdict. A name is right that was
hidden, or that the report says could also be what was. One JSON document goes to stdout; with `--picture` the
diagram is drawn: share right, with Wilson's interval of 95 %, against the probability that was claimed.
"""

import argparse
import itertools
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from drawn_sets import share, wilson

sys.path.insert(0, str(Path(__file__).parents[1]))


class Claimed(NamedTuple):
    """Names that had the same probability, and which of them were right."""

    probability: float
    right: list[bool]


def claims(runs: Sequence[dict[str, Any]]) -> list[Claimed]:
    """The names of all runs by their probability, the least first."""
    from calibration.gap.report.confidence import probability

    names = sorted(
        (round(probability(clear, one["verdict"] != "unexplained_gap"), 3), name not in one["false_names"])
        for one in runs
        if not one["crash"] and "refused" not in one
        for name, clear in one["clearness"].items()
    )
    return [
        Claimed(claimed, [right for _, right in group])
        for claimed, group in itertools.groupby(names, key=lambda pair: pair[0])
    ]


def draw(claimed: Sequence[Claimed], path: Path) -> None:
    """The reliability diagram: a name on the dashed line is as sure as it says."""
    from calibration.report_style import BLUE, MUTED, RASTER_DPI, new_figure

    figure = new_figure(4.2, 3.4)
    axes = figure.subplots()
    axes.plot([0.0, 1.0], [0.0, 1.0], "--", lw=1.4, color=MUTED, label="as claimed")
    for one in claimed:
        low, high = wilson(one.right)
        found = sum(one.right) / len(one.right)
        around = [[found - low], [high - found]]
        axes.errorbar(one.probability, found, around, fmt="o", ms=5, lw=1.6, capsize=4, color=BLUE)
        text = f"{sum(one.right)} of {len(one.right)}"
        axes.annotate(
            text, (one.probability + 0.008, low - 0.01), ha="right", va="top", rotation=60, fontsize=8.5
        )
    axes.set(xlim=(0.45, 1.02), ylim=(0.45, 1.02), xlabel="probability claimed", ylabel="share right")
    axes.legend(fontsize=8.5, loc="upper left", frameon=False)
    figure.savefig(path, dpi=RASTER_DPI)


def main() -> None:
    """Parse, count, print, draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, required=True)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--picture", type=Path)
    asked = parser.parse_args()
    runs = [json.loads(line) for line in asked.table.read_text().splitlines()]
    runs = [one for one in runs if one["seed"] >= asked.first]
    claimed = claims(runs)
    if asked.picture:
        draw(claimed, asked.picture)
    expected = sum(one.probability * len(one.right) for one in claimed)
    print(
        json.dumps(
            {
                "sets": len(runs),
                "right_of_claimed": {str(one.probability): share(one.right) for one in claimed},
                "right": share([right for one in claimed for right in one.right]),
                "expected_right": round(expected, 1),
            },
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
