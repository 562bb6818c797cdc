"""Reward of a landing attempt: closeness, trigger time, impact attitude and legs (paper Eqs. r_d to r_legs).

The paper's reward and the one that made the data of the flown policy have the same form with different
numbers (paper errata 10), so a preset is data.
"""

import math
from typing import Any, NamedTuple

from onboard.jit import kept
from perchhw.learning.errors import LearningInputError


class RewardWeights(NamedTuple):
    """Numbers of the reward.

    Attributes:
        distance, tau, tilt, legs: weights of the four parts.
        c0: 1/m, c1: 1/s: where the closeness and the trigger part saturate.
        distance_offset: m, added to the least distance.
        tilt_full: rad of tilt at impact that earns the whole tilt part.
        two_legs, one_leg: share of the legs part for two legs and for one.
        contact_factor: on the legs part when body or propellers touched the ceiling.
        contact_factor_few: the same with fewer than three legs.
    """

    distance: float
    tau: float
    tilt: float
    legs: float
    c0: float
    c1: float
    distance_offset: float
    tilt_full: float
    two_legs: float
    one_leg: float
    contact_factor: float
    contact_factor_few: float


PAPER = RewardWeights(
    distance=0.05, tau=0.1, tilt=0.2, legs=0.65, c0=15.0, c1=15.0, distance_offset=0.0,
    tilt_full=math.radians(120.0), two_legs=0.5, one_leg=0.5, contact_factor=1.0 / 3.0,
    contact_factor_few=1.0 / 3.0,
)  # fmt: skip
"""The paper's equations; c0 and c1, not printed there, as in the only code with its weights (errata 10)."""

FLOWN = RewardWeights(
    distance=0.1, tau=0.0, tilt=0.2, legs=0.7, c0=10.0, c1=15.0, distance_offset=1e-3,
    tilt_full=math.radians(120.0), two_legs=2.0 / 7.0, one_leg=0.0, contact_factor=4.0 / 7.0,
    contact_factor_few=0.5,
)  # fmt: skip
"""The reward of the sweep that trained the flown policy: SIM@6a3be0be, Crazyflie_env.py (errata 10)."""

LATER = RewardWeights(
    distance=0.1, tau=0.0, tilt=0.3, legs=0.6, c0=10.0, c1=15.0, distance_offset=1e-3,
    tilt_full=math.radians(90.0), two_legs=1.0 / 3.0, one_leg=0.0, contact_factor=0.5, contact_factor_few=0.5,
)  # fmt: skip
"""The reward of the authors' sweeps from 2022-07-29 on, NS and WS among them: SIM@52ee88af and SIM@7c3e4562,
CrazyflieEnv_ParamOpt.py."""

PRESETS = {"paper": PAPER, "flown": FLOWN, "later": LATER}

BEST_TAU = 0.2
"""s, centre of the trigger part (paper Eq. r_tau)."""


def reward_weights(name: str) -> RewardWeights:
    """The preset of that name.

    Raises:
        LearningInputError: there is none.
    """
    if name not in PRESETS:
        raise LearningInputError(f"reward {name!r} is not known: choose one of {', '.join(PRESETS)}")
    return PRESETS[name]


@kept()
def saturated(distance: float, most: float) -> float:
    """clip(1 / |distance|, 0, most) / most."""
    size = abs(distance)
    return 1.0 if size * most <= 1.0 else 1.0 / (size * most)


@kept()
def legs_part(feet: int, body_contact: int, w: RewardWeights) -> float:
    """Share of the legs part (paper Eq. r_legs and the factor for contact), 0..1."""
    share = 0.0
    if feet >= 3:
        share = 1.0
    elif feet == 2:
        share = w.two_legs
    elif feet == 1:
        share = w.one_leg
    if not body_contact:
        return share
    return share * (w.contact_factor if feet >= 3 else w.contact_factor_few)


@kept()
def reward(out: Any, w: RewardWeights) -> float:
    """Reward of a rollout.

    Args:
        out: record of :data:`sim_backend.physics.rollout.ROLLOUT`.
        w: weights.

    Returns:
        Reward between 0 and the sum of the weights. A rollout that never triggered has no trigger part, one
        that never touched the ceiling has no tilt part.
    """
    total = w.distance * saturated(out.d_min + w.distance_offset, w.c0)
    if out.triggered:
        total += w.tau * saturated(out.tau - BEST_TAU, w.c1)
    if out.contact:
        total += w.tilt * min(out.impact_tilt / w.tilt_full, 1.0)
    return total + w.legs * legs_part(out.feet, out.body_contact, w)
