"""A sweep of approach conditions and the map of its landing rates, in ten lines.

    python examples/sweep_map.py FOLDER

Learns when and how hard to flip at 63 conditions, on all cores, in seconds once compiled; FOLDER must be new.
Prints the mean rate and where the picture is.
"""

import sys
from pathlib import Path

import perchhw
from perchhw.learning.results import read_results
from perchhw.report.rate_maps import rate_maps

folder = Path(sys.argv[1])
speeds, angles_deg = [1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0], [30, 37.5, 45, 52.5, 60, 67.5, 75, 82.5, 90]
swept = perchhw.sweep(folder, speeds, angles_deg)
rate_maps([read_results(folder).pair_rates()]).savefig(folder / "map.png")
mean = sum(float(row["landing_rate"] or 0.0) for row in swept.rows) / len(swept.rows)
print(f"{len(swept.rows)} conditions, mean landing rate {mean:.2f}, map: {folder / 'map.png'}")
