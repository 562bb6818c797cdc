"""Energy never grows without power: throws at ceiling and floor in any attitude, for every kind of contact.

What is left at 1 kHz is an error of the integrator: it is small beside the energy of the throw, and goes away
with the step. A contact that made energy would keep it at any step.
"""

import math
from typing import Any

import numpy as np
import pytest

from sim_backend.physics.reset import approaching
from sim_backend.physics.state import FootMode
from sim_backend.physics.step import step_thrust
from tests.physics.energy import mechanical_energy
from tests.tiers import some

OFF = (0.0, 0.0, 0.0, 0.0)
STOP = math.radians(10.0)

HELD, TORN, PRESSED = {FootMode.ATTACHED}, {FootMode.ATTACHED, FootMode.RELEASED}, {FootMode.PRESSING_CEILING}

CONTACTS: dict[str, tuple[dict[str, float], set[FootMode]]] = {
    "adhering": ({}, HELD),
    "adhering, no dampers": ({"hinge_damping": 0.0, "axial_damping": 0.0}, HELD),
    "adhering, stiff": (
        {"hinge_stiffness": 2.0, "hinge_limit_stiffness": 20.0, "axial_stiffness": 2e4},
        HELD,
    ),
    "adhering, on the hinge's stop": ({"hinge_limit": STOP, "hinge_limit_cosine": math.cos(STOP)}, HELD),
    "adhering, stiff sideways": ({"sideways_stiffness": 24.0, "sideways_damping": 9.0}, HELD),
    "adhering, loose sideways": ({"sideways_stiffness": -1.0, "sideways_damping": -1.0}, HELD),
    "sliding, stiff sideways": (
        {"sideways_stiffness": 24.0, "sideways_damping": 9.0, "minimum_preload": 1e3},
        PRESSED,
    ),
    "tearing off": ({"adhesion_strength": 0.3}, TORN),
    "pressed until it adheres": ({"minimum_preload": 0.5}, HELD | PRESSED),
    "sliding on the ceiling": ({"minimum_preload": 1e3}, PRESSED),
    "too slow to stick": ({"capture_speed": 100.0}, PRESSED),
    "sticking where fast enough": ({"capture_speed": 1.5}, HELD | PRESSED),
    "adhering with pads that resist a turn": ({"pad_damping": 1e-3}, HELD),
    "sliding on the floor": ({}, {FootMode.PRESSING_FLOOR}),
}
"""What is changed in the parameters, and what feet then do."""


def _thrown(parameters: Any, floor: bool, rng: np.random.Generator) -> Any:
    """A vehicle with dead motors, thrown at ceiling or floor in any attitude."""
    up = rng.uniform(1.5, 3.0)
    velocity = np.array([rng.uniform(0.0, 3.0), rng.uniform(-0.5, 0.5), -up if floor else up])
    state = approaching(parameters, np.array([0.0, 0.0, 0.15 if floor else 1.95]), velocity)
    q = rng.normal(size=4)
    state["thrust"], state["quaternion"], state["omega"] = 0.0, q / np.linalg.norm(q), rng.uniform(-20, 20, 3)
    return state


def _growth(parameters: Any, floor: bool, rng: np.random.Generator, dt: float) -> tuple[float, set[int]]:
    """Largest rise of the energy above its lowest so far, as a share of the throw's; modes that feet had."""
    state = _thrown(parameters, floor, rng)
    mass, inertia = float(parameters["mass"]), parameters["inertia"]
    thrown = 0.5 * mass * np.sum(state["velocity"] ** 2) + 0.5 * np.sum(inertia * state["omega"] ** 2)
    lowest, growth, modes = math.inf, 0.0, set()
    for _ in range(round(0.45 / dt)):
        energy = float(mechanical_energy(state, parameters))
        lowest = min(lowest, energy)
        growth = max(growth, energy - lowest)
        modes.update(state["foot_mode"].tolist())
        step_thrust(state, parameters, OFF, dt)
    assert np.isfinite(lowest)
    return growth / float(thrown), modes


@pytest.mark.parametrize("name", some(CONTACTS, 8))
def test_energy_never_grows_without_power(parameters: Any, rng: np.random.Generator, name: str) -> None:
    changes, expected = CONTACTS[name]
    floor = FootMode.PRESSING_FLOOR in expected
    for changed, value in changes.items():
        parameters[changed] = value
    coarse = [_growth(parameters, floor, rng, 1e-3) for _ in range(16)]
    fine = [_growth(parameters, floor, rng, 1e-3 / 8) for _ in range(2)]
    touched = set.union(*(modes for _, modes in coarse)) - {FootMode.FREE}
    assert touched == expected
    assert max(growth for growth, _ in coarse) < 2e-2
    assert max(growth for growth, _ in fine) < 2e-4


@pytest.mark.parametrize(
    "law", some([{"pad_impulse": 0.01}, {"pad_angle": 0.6}, {"minimum_preload": 5.0}], 3)
)
def test_feet_that_take_hold_late_give_no_energy(
    parameters: Any, rng: np.random.Generator, law: dict[str, float]
) -> None:
    """In the middle of a push, with a bent leg: at 8 kHz as little as where feet hold from the touch on."""
    for name, value in law.items():
        parameters[name] = value
    thrown = [_growth(parameters, False, rng, 1e-3 / 8) for _ in range(4)]
    assert {FootMode.PRESSING_CEILING, FootMode.ATTACHED} <= set.union(*(modes for _, modes in thrown))
    assert max(growth for growth, _ in thrown) < 2e-4


@pytest.mark.parametrize("stiffness", some([1e7, 1e5], 2))
def test_rods_of_any_stiffness_give_no_energy_to_the_body(
    parameters: Any, rng: np.random.Generator, stiffness: float
) -> None:
    """Twenty times to two thousand times as stiff as the legs', at 1 kHz: motion and height never gain."""
    parameters["axial_stiffness"], parameters["axial_damping"] = stiffness, 0.0
    mass, inertia, g = float(parameters["mass"]), parameters["inertia"], float(parameters["gravity"])

    def energy(state: Any) -> float:
        motion = 0.5 * mass * np.sum(state["velocity"] ** 2) + 0.5 * np.sum(inertia * state["omega"] ** 2)
        return float(motion + mass * g * state["position"][2])

    held = 0
    for _ in range(12):
        state = _thrown(parameters, False, rng)
        start = energy(state)
        for _ in range(450):
            step_thrust(state, parameters, OFF, 1e-3)
            assert energy(state) < start * (1.0 + 1e-6)
        held += int(state["foot_attached"].sum() > 0)
    assert held >= 3
