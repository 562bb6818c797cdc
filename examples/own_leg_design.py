"""Legs of your own: put them on a vehicle, and see how much of the approach space they land.

    python examples/own_leg_design.py [FOLDER]

Writes a vehicle file with longer, softer legs that lean further out, sweeps it and the paper's best design
over the same conditions, and prints the mean landing rate of each. The file is one like any other: `perchhw
learn all --vehicle own.toml` trains a policy for it, `perchhw sim lab --vehicle own.toml` serves it.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import perchhw
from onboard.vehicle import Quantity, vehicle_to_toml

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
folder.mkdir(parents=True, exist_ok=True)

vehicle = perchhw.load_vehicle("crazyflie21-upgraded", legs="semi-narrow-long")
assert vehicle.legs is not None
mine = "my own drawing"
legs = replace(
    vehicle.legs,
    design="own",
    angle_deg=Quantity(40.0, "deg", 1.0, mine),
    length=Quantity(0.085, "m", 0.5e-3, mine),
    stiffness=Quantity(0.06, "N m/rad", 0.02, mine),
)
own = folder / "own.toml"
own.write_text(vehicle_to_toml(replace(vehicle, name="own", legs=legs)), encoding="utf-8")

setups = {
    "semi-narrow-long": perchhw.LearningSetup(legs="semi-narrow-long"),
    "own": perchhw.LearningSetup(vehicle=str(own)),
}
for name, setup in setups.items():
    swept = perchhw.sweep(folder / name, [2.0, 2.5, 3.0], [40.0, 50.0, 60.0, 70.0], setup=setup)
    rates = [float(row["landing_rate"] or 0.0) for row in swept.rows]
    print(f"{name}: mean landing rate {sum(rates) / len(rates):.2f} over {len(rates)} conditions")
