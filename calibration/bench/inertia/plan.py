"""Before the hang: which string distance and length, what period to expect, how good it will be."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from calibration.bench.inertia.errors import RigError
from calibration.bench.inertia.inertia import expected_uncertainty
from calibration.bench.inertia.rig import Rig, measured
from calibration.measurement import Estimate

FORBIDDEN_RATIOS = ((0.45, 0.55), (0.9, 1.1), (1.9, 2.1))
"""Of the torsion's period over that of the swing: near these the two exchange energy or look alike."""

PERIODS = (0.7, 3.5)  # s
_MARGIN = 0.03  # kept from the forbidden ratios, for an inertia that is not yet known
_GOOD_ENOUGH = 1.25  # times the smallest uncertainty: longer strings gain little and swing wider
# Handiest first.
_DISTANCES_MM = (60, 80, 70, 90, 50, 100, 40, 110, 120)
_LENGTHS_MM = (600, 800, 700, 500, 900, 400, 1000)


@dataclass(frozen=True, slots=True)
class Instruments:
    """What will measure the hang: half widths (SI), `trial_spread` relative of the period.

    The usual values are a printed jig and a balance of 20 mg.
    """

    distance: float = 0.1e-3
    length: float = 0.5e-3
    mass: float = 0.02e-3
    trial_spread: float = 0.001
    trials: int = 5


@dataclass(frozen=True, slots=True)
class HangPlan:
    """A proposed hang.

    Attributes:
        distance: m, of the strings, top and bottom. length: m.
        period: s, of small turns.
        uncertainty: expected relative standard uncertainty of the inertia.
    """

    distance: float
    length: float
    period: float
    uncertainty: float


def plan_hang(inertia: float, mass: float, instruments: Instruments | None = None) -> HangPlan:
    """The handiest hang that comes near the smallest expected uncertainty, outside :data:`FORBIDDEN_RATIOS`.

    Args:
        inertia: expected, kg m2, about the axis that hangs vertical.
        mass: of all that hangs, kg.
        instruments: that will be used; by default jig and fine balance.

    Raises:
        RigError: no usual distance and length gives a good period; the message says what would.
    """
    if not (inertia > 0.0 and mass > 0.0):
        raise RigError(f"an inertia of {inertia:g} kg m2 and a mass of {mass:g} kg cannot be planned for")
    tools = instruments or Instruments()
    plans = list(_plans(inertia, mass, tools))
    if not plans:
        raise RigError(
            f"no distance of 40 to 120 mm with strings of 0.4 to 1.0 m suits {inertia:.3g} kg m2 and "
            f"{1e3 * mass:.1f} g; check both (kg m2, kg)"
        )
    best = min(plan.uncertainty for plan in plans)
    return next(plan for plan in plans if plan.uncertainty <= _GOOD_ENOUGH * best)


def swing_ratio(inertia: float, mass: float, distance: float) -> float:
    """Period of the torsion over that of swinging: radius of gyration over half the string distance."""
    return math.sqrt(inertia / mass) / (0.5 * distance)


def ratio_allowed(ratio: float, margin: float = 0.0) -> bool:
    """Whether a swing ratio stays out of the forbidden bands by `margin`."""
    return all(not low - margin <= ratio <= high + margin for low, high in FORBIDDEN_RATIOS)


def _plans(inertia: float, mass: float, tools: Instruments) -> Iterator[HangPlan]:
    for distance in (1e-3 * mm for mm in _DISTANCES_MM):
        ratio = swing_ratio(inertia, mass, distance)
        if not ratio_allowed(ratio, _MARGIN):
            continue
        for length in (1e-3 * mm for mm in _LENGTHS_MM):
            rig = _rig(mass, distance, length, tools)
            swing = math.tau * math.sqrt(length / rig.gravity.value)
            period = ratio * swing
            if not PERIODS[0] <= period <= PERIODS[1]:
                continue
            sigma = tools.trial_spread * period / math.sqrt(tools.trials)
            share = expected_uncertainty(rig, Estimate(period, "s", sigma, tools.trials - 1.0))
            yield HangPlan(distance, length, period, share)


def _rig(mass: float, distance: float, length: float, tools: Instruments) -> Rig:
    def known(value: float, half_width: float, unit: str) -> Estimate:
        return measured([value], half_width, unit)

    separation = known(distance, tools.distance, "m")
    return Rig(known(mass, tools.mass, "kg"), separation, separation, known(length, tools.length, "m"))
