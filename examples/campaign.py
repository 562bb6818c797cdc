"""A campaign: a grid of approaches, flown one after another, that goes on where it was stopped.

    python examples/campaign.py FOLDER [--repeats 1] [--speeds 2.25 2.5 2.75]

Writes a campaign file, flies it in a simulated lab, and prints the outcomes and where the report is. The same
file flies with `perchhw campaign run`. After Ctrl-C run it again with the same FOLDER: what was flown stays.
"""

import argparse
from collections import Counter
from pathlib import Path

import perchhw

parser = argparse.ArgumentParser(description="Fly a campaign in a simulated lab.")
parser.add_argument("folder", type=Path)
parser.add_argument("--repeats", type=int, default=1, help="attempts at each condition")
parser.add_argument("--speeds", type=float, nargs="+", default=[2.25, 2.5, 2.75], help="m/s")
asked = parser.parse_args()

asked.folder.mkdir(parents=True, exist_ok=True)
file = asked.folder / "campaign.toml"
file.write_text(
    f"""schema = "perchhw.campaign/1"
name = "example"
seed = 1

[grid]
speeds = {asked.speeds}
angles_deg = [52.5]
repeats = {asked.repeats}
""",
    encoding="utf-8",
)

with perchhw.SimulatedLab() as lab:
    # Between two attempts somebody takes the drone off the ceiling: `input` would ask you.
    rows = perchhw.fly_campaign(lab, file, asked.folder / "flown", confirm=print, resume=True)

for outcome, count in Counter(row.outcome for row in rows if row.state == "done").items():
    print(f"{outcome}: {count} of {len(rows)}")
print(f"report: {asked.folder / 'flown' / 'report.html'}")
