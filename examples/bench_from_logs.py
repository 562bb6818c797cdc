"""A moment of inertia from logged swings: what the bench's fits give without the wizard.

    python examples/bench_from_logs.py [SWING.csv ...]

Takes recordings of the gyro while the drone turns between two strings (docs/bench_inertia.md); without any it
makes five. Prints the inertia with its 95 % interval and what the checks found.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.inertia import inertia_about_axis
from calibration.bench.inertia.recordings import OWN_HEADER, read_swing
from calibration.bench.inertia.rig import Rig, measured

PERIOD, DAMPING = 0.92, 0.004  # s, and ratio, of the swings that are made here


def make_swing(file: Path, rng: np.random.Generator) -> None:
    """A recording of 20 s at 100 Hz about z: small turns, some air, noise of the gyro."""
    t = np.arange(0.0, 20.0, 0.01)
    rate = 2.0 * np.pi / (PERIOD * (1.0 + 5e-4 * rng.standard_normal()))
    gyro = 5e-3 * rng.standard_normal((t.size, 3))
    gyro[:, 2] += np.radians(8.0) * rate * np.exp(-DAMPING * rate * t) * np.cos(rate * t)
    table = np.column_stack([np.round(1e3 * t), gyro])
    np.savetxt(file, table, delimiter=",", header=",".join(OWN_HEADER[:4]), comments="")


files = [Path(name) for name in sys.argv[1:]]
if not files:
    folder, rng = Path(tempfile.mkdtemp()), np.random.default_rng(1)
    files = [folder / f"swing-{number}.csv" for number in range(1, 6)]
    for file in files:
        make_swing(file, rng)

rig = Rig(
    mass=measured([38.1e-3], half_width=2e-5, unit="kg"),
    top=measured([0.0600, 0.0601, 0.0600], half_width=1e-4, unit="m"),
    bottom=measured([0.0600, 0.0600, 0.0599], half_width=1e-4, unit="m"),
    length=measured([0.6002, 0.6004, 0.6001], half_width=5e-4, unit="m"),
)
fits = [fit_swing(read_swing(file, axis=(0.0, 0.0, 1.0))) for file in files]
result = inertia_about_axis(fits, rig)
inertia = result.inertia
print(f"inertia_zz {1e9 * inertia.value:.0f} +- {1e9 * inertia.u95:.0f} g mm2 (95 %)")
for finding in [*(one for fit in fits for one in fit.findings), *result.findings]:
    print(f"{finding.severity.name.lower()}: {finding.text}")
