"""How large something without a name must be to have a consequence: what it does to a position after 1 s.

A force that stands for a time t moves the vehicle by a t^2 / 2. A torque stands against the control law,
which gives way until its own moment is as large: J alpha = kr e_R. The thrust, tilted by e_R, then pushes as
a force of g e_R does. A heading that is off by as much pushes nobody, and turns what is flown by that angle.
"""

import numpy as np

from calibration.gap.data.channels import ResidualChannel
from calibration.gap.estimate.refine import UnnamedTerm
from onboard.arrays import BoolArray, FloatArray
from onboard.controller import controller_gains
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle

LEAST_ERROR = 0.025
"""m, of a position after 1 s: half of what the accelerometer, in the place of a model, leaves on real flights
(``floor`` of ``gap evaluate``: 4.2 to 5.4 cm, docs/gap_figures.md). Beside that such an error does not
show."""

_HORIZON = 1.0
"""s."""


def least_amplitude(channel: ResidualChannel, vehicle: Vehicle) -> float:
    """Force (m/s2) or torque (rad/s2) in a channel that moves this vehicle by :data:`LEAST_ERROR`; a voltage
    (V) has no consequence by itself, and no least size."""
    force = 2.0 * LEAST_ERROR / _HORIZON**2
    match channel.kind:
        case "force":
            return force
        case "torque":
            return force / GRAVITY * _stiffness(vehicle)[channel.axis]
    return 0.0


def _stiffness(vehicle: Vehicle) -> tuple[float, float, float]:
    """Angular acceleration (rad/s2) of the control law per rad off its attitude, about the body axes."""
    gains = controller_gains(vehicle)
    return gains.kr_xy / gains.inertia_xx, gains.kr_xy / gains.inertia_yy, gains.kr_z / gains.inertia_zz


def amplitude(term: UnnamedTerm, values: FloatArray, valid: BoolArray) -> float:
    """Size of a term where it acts, in the unit of its channel: root mean square, weighted by its own power.

    A constant in a range has its own size, however seldom the flights were there.

    Args:
        term: which.
        values: of its columns, shape (k,).
        valid: rows of the signals that count, shape (n, 7).
    """
    told = np.where(valid, np.tensordot(values, np.stack(term.columns), axes=1), 0.0)
    power = np.square(told).sum(axis=1)
    return float(np.sqrt(power @ power / power.sum())) if power.any() else 0.0
