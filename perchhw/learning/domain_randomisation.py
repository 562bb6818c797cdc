"""Domain randomisation: another vehicle for every rollout.

Two ways, which add up. The paper's draws mass and pitch inertia from a normal distribution for every rollout.
Any other quantity of the vehicle file is drawn into a pool of vehicles once (:mod:`vehicle_pool`), of which
every rollout takes one at random.
"""

from typing import Any, NamedTuple

import numpy as np

from onboard.jit import kernel
from perchhw.learning.errors import LearningInputError
from sim_backend.physics.parameters import PARAMETERS


class DomainRandomisation(NamedTuple):
    """Standard deviations of the normal distributions around the nominal vehicle, and the pool.

    Attributes:
        mass: kg. inertia_yy: kg m2, about the flip axis.
        pool: (n,) parameter records to choose from, empty for the nominal vehicle alone.
    """

    mass: float
    inertia_yy: float
    pool: Any = np.empty(0, PARAMETERS)


PAPER = DomainRandomisation(mass=0.5e-3, inertia_yy=1.5e-6)
"""Paper, section "Simulation to Real-World Transfer"; the authors' code agrees (paper errata 11)."""

NONE = DomainRandomisation(mass=0.0, inertia_yy=0.0)

VEHICLE = "vehicle"
"""Name of the preset that draws every quantity of the vehicle file by its sigma, all from the pool."""

PRESETS = {"paper": PAPER, "none": NONE, VEHICLE: NONE}

LEAST = 0.5
"""Share of the nominal value below which no draw goes."""


def domain_randomisation(name: str) -> DomainRandomisation:
    """The preset of that name, without a pool.

    Raises:
        LearningInputError: there is none.
    """
    if name not in PRESETS:
        raise LearningInputError(
            f"domain randomisation {name!r} is not known: choose one of {', '.join(PRESETS)}"
        )
    return PRESETS[name]


@kernel
def draw_vehicle(rng: Any, nominal: Any, domain: DomainRandomisation, drawn: Any) -> None:
    """Write the vehicle of one rollout into ``drawn[0]``; `nominal` and `drawn` are (1,) records."""
    if len(domain.pool) > 0:
        drawn[0] = domain.pool[rng.integers(0, len(domain.pool))]
    else:
        drawn[0] = nominal[0]
    mass = drawn[0].mass + domain.mass * rng.standard_normal()
    inertia = drawn[0].inertia[1] + domain.inertia_yy * rng.standard_normal()
    drawn[0].mass = max(mass, LEAST * nominal[0].mass)
    drawn[0].inertia[1] = max(inertia, LEAST * nominal[0].inertia[1])
