"""What strings of finite length change: the body rises as it turns.

With ``r^2 = r_t r_b`` and ``rho = r / h`` the restoring moment stiffens by ``rho^2 a^2 / 2`` of itself, and
the rise takes kinetic energy, as if ``rho^2 (r/k)^2 a^2`` of the inertia were added (a: angle, k: radius of
gyration). Together they multiply the pendulum's lengthening of the period, A^2/16, by
``1 + rho^2 (4 (r/k)^2 - 3)``.
"""

import math

from calibration.bench.inertia.rig import Rig
from calibration.bench.inertia.swing_fit import SwingFit


def small_period(fit: SwingFit, rig: Rig) -> float:
    """s: the period at zero amplitude on this rig; `fit` alone assumes strings without end.

    ``(r/k)^2`` needs no inertia: it is the period of a pendulum as long as the drop over that of the torsion,
    squared.
    """
    square = 0.25 * rig.top.value * rig.bottom.value / rig.drop**2
    pendulum = 4.0 * math.pi**2 * rig.drop / rig.gravity.value
    excess = square * (4.0 * pendulum / fit.period.value**2 - 3.0)
    return fit.period.value * (1.0 - excess * fit.mean_square_amplitude / 16.0)
