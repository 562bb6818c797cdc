"""ceiling_effect: a rotor gives more thrust close under a ceiling (Hsiao, Chirarattananon, IEEE/ASME Trans.
Mechatronics 24(5), 2019, arXiv 1905.04632).

Air has to come in through the gap d between rotor and ceiling. Momentum theory with the suction on the
ceiling gives T = 2 rho A gamma^2 v_i^2 with the induced velocity v_i and

    gamma = 1/2 + 1/2 sqrt(1 + R^2 / (8 opening^2 d^2))

(`opening`: share of the rim that neighbours leave open): the same thrust needs 1/gamma of the induced
velocity, and of the power. A rotor at the same speed meets less inflow and gives more: with blade element
theory, T = T0 (1 + inflow) - inflow T0 v_i/v_i0, where T0 is the thrust in open air and `inflow` the share of
it that its own inflow costs. With y = sqrt(T/T0) both together are

    y^2 + (inflow/gamma) y - (1 + inflow) = 0

so the gain T/T0 is 1 far away and rises to 1 + inflow at the ceiling. Each rotor has its own distance, so a
tilted vehicle is turned. The gain fades with the cosine of the tilt; a rotor that faces down has none.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from onboard.arrays import FloatArray
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import kernel

FAR = 0.01
"""R^2 / (8 opening^2 d^2) below which a series takes the place of two square roots: 3.5 radii and more."""

_FAR_SHARES = 0.5 * FAR * (1.0 + np.polynomial.chebyshev.chebpts1(30))
# Values there to the coefficients of the polynomial of third degree that is nearest to them.
_FAR_FIT = np.linalg.pinv(np.vander(_FAR_SHARES / FAR, 4, increasing=True)) / FAR ** np.arange(4)[:, None]


@kernel
def inflow_gain(inflow: float, reach2: float, gap: float) -> float:
    """T/T0 of a level rotor.

    Args:
        inflow: share of the thrust in open air that its own inflow costs.
        reach2: R^2 / (8 opening^2), m2.
        gap: m from the hub up to the ceiling; a rotor at or in the ceiling has 0.
    """
    gap = max(gap, 0.0)
    # inflow / (2 gamma), without a pole at the ceiling
    share = inflow * gap / (gap + math.sqrt(gap * gap + reach2))
    root = math.sqrt(share * share + 1.0 + inflow) - share
    return root * root


@kernel
def ceiling_gain(p: Any, gap: float, facing: float) -> float:
    """Thrust over that in open air; `facing`: cosine of the angle between the rotor's axis and up."""
    if p.ceiling_inflow == 0.0 or facing <= 0.0:
        return 1.0
    share, c = p.ceiling_reach2 / (gap * gap), p.ceiling_far
    if gap > 0.0 and share < FAR:
        return 1.0 + facing * share * (c[0] + share * (c[1] + share * (c[2] + share * c[3])))
    return 1.0 + facing * (inflow_gain(p.ceiling_inflow, p.ceiling_reach2, gap) - 1.0)


def _far_series(inflow: float) -> FloatArray:
    """Coefficients of T/T0 - 1 over the first four powers of reach2/gap^2, good to 1e-12 below `FAR`."""
    gain = np.array([inflow_gain(inflow, share, 1.0) for share in _FAR_SHARES.tolist()])
    return np.asarray(_FAR_FIT @ ((gain - 1.0) / _FAR_SHARES))


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["ceiling_inflow"] = values["inflow"]
    p["ceiling_reach2"] = 0.125 * (float(p["propeller_radius"]) / values["opening"]) ** 2
    p["ceiling_far"] = _far_series(values["inflow"])


EFFECT = EffectTerm(
    "ceiling_effect",
    Acts.FORCES,
    _apply,
    (Field("ceiling_inflow"), Field("ceiling_reach2"), Field("ceiling_far", (4,))),
)
