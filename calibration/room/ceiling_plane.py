"""The ceiling as a plane, from places at which a spherical marker touched it.

    z = a + b x + c y  of the marker's centre, by least squares;  ceiling: a + r sqrt(1 + b^2 + c^2)

r is the radius of the marker. The tilts of the lab file are atan b and atan c. A touch is as good as a hand
holds it, or as the touches fit the plane, whichever is worse.
"""

import math
from dataclasses import dataclass

import numpy as np

from calibration.room.errors import GeometryRefused
from onboard.arrays import FloatArray

TOUCHES = 4
TOUCH_M = 0.5e-3
"""m, standard uncertainty of one touch: a hand that presses lightly, and the marker's roundness."""
ASIDE_M = 0.2
"""m, standard deviation of the places across the line that fits them best: a rectangle of 0.4 m."""
OFF_PLANE_M = 5e-3
"""m that a touch may be off the plane of all."""


@dataclass(frozen=True)
class CeilingPlane:
    """A plane z = a + b x + c y with its covariance.

    Attributes:
        coefficients: a (m), b, c.
        covariance: of these, (3, 3).
        residuals: m, of each touch.
    """

    coefficients: FloatArray
    covariance: FloatArray
    residuals: FloatArray

    def height(self, x: float = 0.0, y: float = 0.0) -> tuple[float, float]:
        """Height over a place and its standard uncertainty, m."""
        at = np.array([1.0, x, y])
        return float(at @ self.coefficients), float(np.sqrt(at @ self.covariance @ at))

    def tilts_deg(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Tilt along x and along y, each with its standard uncertainty, deg."""
        (_, b, c), sigma = self.coefficients.tolist(), np.sqrt(np.diag(self.covariance)).tolist()
        x, y = (
            (math.degrees(math.atan(slope)), math.degrees(error / (1.0 + slope**2)))
            for slope, error in ((b, sigma[1]), (c, sigma[2]))
        )
        return x, y


def ceiling_plane(touches: FloatArray, radius: float, radius_sigma: float = 0.0) -> CeilingPlane:
    """The ceiling that a marker of this radius (m) touched with its centre at these places, (n, 3), m.

    Raises:
        GeometryRefused: fewer than four touches, nearly in a line, or not on one plane.
    """
    if len(touches) < TOUCHES:
        raise GeometryRefused(
            f"{len(touches)} touches of the ceiling are too few: touch it at {TOUCHES} points"
        )
    aside = float(np.linalg.svd(touches[:, :2] - touches[:, :2].mean(axis=0), compute_uv=False)[-1])
    aside /= math.sqrt(len(touches))
    if aside < ASIDE_M:
        raise GeometryRefused(
            f"the touches lie {100.0 * aside:.0f} cm (standard deviation) about a line and must spread by "
            f"{100.0 * ASIDE_M:.0f}: touch the corners of a rectangle as large as the approaches are"
        )
    rows = np.column_stack([np.ones(len(touches)), touches[:, :2]])
    spread = np.linalg.inv(rows.T @ rows)
    coefficients = spread @ rows.T @ touches[:, 2]
    residuals = touches[:, 2] - rows @ coefficients
    freedom = len(touches) - 3
    worst = float(np.abs(residuals).max())
    if worst > OFF_PLANE_M:
        raise GeometryRefused(
            f"touches are up to {1e3 * worst:.1f} mm off the plane of all: is the ceiling "
            "flat, and did the marker touch it each time? Touch again"
        )
    scatter = max(TOUCH_M, float(np.sqrt((residuals**2).sum() / freedom)))
    covariance = scatter**2 * spread
    covariance[0, 0] += radius_sigma**2
    coefficients = coefficients + np.array(
        [radius * math.sqrt(1.0 + float((coefficients[1:] ** 2).sum())), 0, 0]
    )
    return CeilingPlane(coefficients, covariance, residuals)
