"""An effect of your own: describe it, write how it changes the physics, and see what it does to a landing.

    python examples/own_effect.py

Adds `propeller_guard`, a ring of some mass round the drone, in this process alone, and prints how long the
flip takes with and without it. docs/adding.md says where such pieces stand in the code for good.
"""

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import perchhw
from onboard.vehicle import EFFECTS, Effect, Quantity, vehicle_to_toml
from onboard.vehicle.effects import Domain, EffectDescription, EffectParameter
from sim_backend.physics.effects.registry import TERMS
from sim_backend.physics.effects.term import Acts, EffectTerm

NAME, RADIUS = "propeller_guard", 0.07  # m


def apply(p: Any, values: Mapping[str, float]) -> None:
    """Add a thin ring in the plane of the rotors to the record of parameters."""
    p["mass"] += values["mass"]
    p["inertia"] += values["mass"] * RADIUS**2 * np.array([0.5, 0.5, 1.0])


EFFECTS[NAME] = EffectDescription(
    name=NAME,
    domain=Domain.RIGID_BODY,
    equation="m -> m + mass, I -> I + mass r^2 diag(1/2, 1/2, 1), r = 70 mm",
    parameters={
        "mass": EffectParameter(
            unit="kg", low=0.0, high=0.02, typical=0.003, neutral=0.0, practical_minimum=5e-4,
            meaning="of the ring", source="engineering estimate: printed ring of 1 mm by 5 mm",
        )
    },
    revealed_by="a scale; then attitude doublets for the inertia",
    confused_with=("mass_error", "inertia_error"),
    reference="thin ring",
)  # fmt: skip
TERMS[NAME] = EffectTerm(NAME, Acts.ONCE, apply)

bare = perchhw.load_vehicle("crazyflie21-upgraded")
guard = Effect(name=NAME, parameters={"mass": Quantity(0.003, "kg", 0.0, "kitchen scale")})
file = Path(tempfile.mkdtemp()) / "guarded.toml"
file.write_text(vehicle_to_toml(replace(bare, name="guarded", effects=(guard,))), encoding="utf-8")

for vehicle in ("crazyflie21-upgraded", str(file)):
    setup = perchhw.LearningSetup(vehicle=vehicle, domain="none", sensing="perfect")
    flight = perchhw.simulate_approach(perchhw.load_policy(), 2.5, 52.5, setup=setup)
    up = 1.0 - 2.0 * (flight.data["qx"] ** 2 + flight.data["qy"] ** 2)
    assert flight.trigger is not None
    over = float(flight.t[np.argmax(up < -0.5)]) - flight.trigger.t
    print(f"{perchhw.load_vehicle(vehicle).name}: 120 deg over after {1e3 * over:.0f} ms")
