"""One landing on the ceiling: upload a policy, fly the approach under supervision, label what came of it.

    python examples/one_landing.py [--speed 2.5] [--angle 52.5] [--out FOLDER]

Prints the outcome, the state in which the policy fired on the drone, and the folder of the record. In your
laboratory give `perchhw.fly` your lab file in place of the simulated lab.
"""

import argparse
from pathlib import Path

import perchhw

parser = argparse.ArgumentParser(description="Fly one landing in a simulated lab.")
parser.add_argument("--speed", type=float, default=2.5, help="on the approach line, m/s")
parser.add_argument("--angle", type=float, default=52.5, help="of that line above the horizon, deg")
parser.add_argument("--out", type=Path, default=Path("runs"), help="folder for the record")
asked = parser.parse_args()

with perchhw.SimulatedLab() as lab:
    result = perchhw.fly(lab, asked.speed, asked.angle, out=asked.out)

print(f"outcome: {result.outcome}")
if result.trigger is not None:
    seen = result.trigger
    print(f"fired {seen['d_ceil']:.2f} m below the ceiling, tau {seen['tau']:.3f} s")
rates = perchhw.read_run(result.record).series["rates"]
print(f"fastest pitch: {abs(rates.numbers('gy')).max():.0f} rad/s")
print(f"record: {result.record}")
