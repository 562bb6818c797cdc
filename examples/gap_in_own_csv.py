"""Find what a model lacks in flights of your own: a CSV with columns and units of your own.

    python examples/gap_in_own_csv.py [FOLDER]

FOLDER has your CSV files; without it three flights are simulated, of a drone with a drag that its vehicle
file knows nothing of. Reading is one function, `load`. Prints the verdict and each effect that is missing.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import perchhw
from calibration.flights import FORMATS, Flight, PoseSource
from calibration.flights.flight import finite_masks
from calibration.flights.flight_format import FlightFormat
from calibration.gap.suggest.simulate import fly_course
from onboard.manoeuvres import manoeuvre
from onboard.room import RoomGeometry
from onboard.vehicle import Effect, Quantity

HEADER = "ms,x_mm,y_mm,z_mm,qx,qy,qz,qw,p_deg,q_deg,r_deg,ax_g,ay_g,az_g,m1,m2,m3,m4,volt"
NOISE = np.repeat([0.0, 0.1, 0.0, 0.5, 0.005, 0.0, 0.002], [1, 3, 4, 3, 3, 4, 1])


def load(path: Path) -> Flight:
    """Your columns as channels in SI (docs/records.md): this is what you change."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    data = {name: table[name] for name in ("qx", "qy", "qz", "qw")} | {"vbat": table["volt"]}
    for axis, turn in zip("xyz", "pqr", strict=True):
        data[axis] = 1e-3 * table[f"{axis}_mm"]
        data[f"g{axis}"] = np.radians(table[f"{turn}_deg"])
        data[f"a{axis}"] = 9.80665 * table[f"a{axis}_g"]
    data |= {name: 65535.0 * table[name] for name in ("m1", "m2", "m3", "m4")}  # duty to PWM
    time, valid = 1e-3 * table["ms"], finite_masks(data)
    return Flight(path.stem, path, "mine", PoseSource.MOCAP, time, data, valid)


def simulate(folder: Path) -> None:
    """Three flights in the columns above, of a drone with a hidden drag."""
    rng, room = np.random.default_rng(1), RoomGeometry(ceiling_z=10.0)
    drag = Effect(name="rotor_drag", parameters={"coefficient": Quantity(3e-6, "kg/rad", 0.0, "hidden")})
    for kind in ("circles", "straight_laps", "attitude_doublets"):
        f = fly_course(
            replace(vehicle, effects=(drag,)), manoeuvre(kind).course({"repeats": 1}, room), room, rng, kind
        )
        assert f is not None
        assert f.specific_force is not None
        columns = (1e3 * f.t, 1e3 * f.position, f.attitude, np.degrees(f.rate), f.specific_force / 9.80665)
        table = np.column_stack((*columns, f.duty, np.asarray(f.voltage)))
        table += NOISE * rng.standard_normal(table.shape)
        np.savetxt(folder / f"{kind}.csv", table, delimiter=",", header=HEADER, comments="")


vehicle = perchhw.load_vehicle("crazyflie21-stock")
FORMATS["mine"] = FlightFormat(lambda path: path.suffix == ".csv", load)
folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
if len(sys.argv) == 1:
    simulate(folder)
flights, unusable = perchhw.open_flights(folder, format="mine")
report = perchhw.find_gap(flights, vehicle).report
print(f"{len(flights)} flights, {len(unusable)} unusable: {report.verdict}")
for effect in report.effects:
    values = ", ".join(f"{name} {p.value:.3g} {p.unit}" for name, p in effect.parameters.items())
    print(f"{effect.name}: {values}")
