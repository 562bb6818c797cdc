"""Optical-flow cues of an approach to the ceiling, as the drone computes them.

Single precision, as on the vehicle. World frame (ENU, z up) for position and velocity: the flown firmware
used world-frame velocities too.
"""

import math

import numpy as np

from onboard.jit import kernel


@kernel
def optical_flow_cues(
    z: float, vx: float, vz: float, ceiling_z: float
) -> tuple[np.float32, np.float32, np.float32]:
    """Time to contact, translational optical flow and distance to the ceiling.

    ``tau = d_ceil / v_z`` (paper, section "Optical Flow Sensory Cues"), ``theta_x = v_x / d_ceil``
    (positive when flying forward; the authors' logged ``OF_y`` is its negative) and
    ``d_ceil = ceiling_z - z``.

    Args:
        z: height of the body's origin, m (world).
        vx: forward velocity, m/s (world).
        vz: climb velocity, m/s (world).
        ceiling_z: height of the ceiling, m (world).

    Returns:
        ``(tau, theta_x, d_ceil)`` as float32: s, rad/s, m. While the drone does not approach (v_z <= 0) tau
        is infinite, never 0. At or above the ceiling (d_ceil <= 0) the values are the limits for d_ceil -> 0:
        tau is 0 while climbing, and theta_x is infinite with the sign of v_x (0 for v_x = 0). A NaN input
        gives NaN, for which the trigger never fires.
    """
    forward = np.float32(vx)
    climb = np.float32(vz)
    d_ceil = np.float32(ceiling_z) - np.float32(z)
    if climb <= np.float32(0.0):
        tau = np.float32(math.inf)
    elif d_ceil <= np.float32(0.0):
        tau = np.float32(0.0)
    else:
        tau = d_ceil / climb
    if d_ceil <= np.float32(0.0):
        theta_x = np.float32(0.0) if forward == np.float32(0.0) else forward * np.float32(math.inf)
    else:
        theta_x = forward / d_ceil
    return tau, theta_x, d_ceil
