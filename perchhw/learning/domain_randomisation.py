"""Domain randomisation: another vehicle for every rollout."""

from typing import Any, NamedTuple

from numba import njit

from perchhw.learning.errors import LearningInputError


class DomainRandomisation(NamedTuple):
    """Standard deviations of the normal distributions around the nominal vehicle.

    Attributes:
        mass: kg. inertia_yy: kg m2, about the flip axis.
    """

    mass: float
    inertia_yy: float


PAPER = DomainRandomisation(mass=0.5e-3, inertia_yy=1.5e-6)
"""Paper, section "Simulation to Real-World Transfer"; the authors' code agrees (paper errata 11)."""

NONE = DomainRandomisation(mass=0.0, inertia_yy=0.0)

PRESETS = {"paper": PAPER, "none": NONE}

LEAST = 0.5
"""Share of the nominal value below which no draw goes."""


def domain_randomisation(name: str) -> DomainRandomisation:
    """The preset of that name.

    Raises:
        LearningInputError: there is none.
    """
    if name not in PRESETS:
        raise LearningInputError(
            f"domain randomisation {name!r} is not known: choose one of {', '.join(PRESETS)}"
        )
    return PRESETS[name]


@njit(cache=True)
def draw_vehicle(rng: Any, nominal: Any, domain: DomainRandomisation, drawn: Any) -> None:
    """Write the mass and inertia of one rollout into the parameter record `drawn`, a copy of `nominal`."""
    mass = nominal.mass + domain.mass * rng.standard_normal()
    inertia = nominal.inertia[1] + domain.inertia_yy * rng.standard_normal()
    drawn.mass = max(mass, LEAST * nominal.mass)
    drawn.inertia[1] = max(inertia, LEAST * nominal.inertia[1])
