"""The region in which a policy fires, hatched over tau and theta_x at one distance to the ceiling."""

from typing import TYPE_CHECKING

import numpy as np

from onboard.policy.model import Policy
from perchhw.diagnosis.flip import values_of
from perchhw.report.cue_space import REGION_COLOUR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GRID = 120


def draw_region(
    axes: "Axes", policy: Policy | None, distance: float, tau: tuple[float, float], flow: tuple[float, float]
) -> None:
    """Draw it within the given ranges, and set them: tau falls to the right, as on an approach.

    Args:
        axes: of tau and theta_x.
        policy: None draws no region.
        distance: to the ceiling (m).
        tau: range (s).
        flow: range of theta_x (1/s).
    """
    axes.set(xlim=tau[::-1], ylim=flow)
    if policy is None:
        return
    grid = np.meshgrid(np.linspace(*tau, _GRID), np.linspace(*flow, _GRID))
    states = np.column_stack([part.ravel() for part in (*grid, np.full_like(grid[0], distance))])
    inside = values_of(policy, states).reshape(grid[0].shape) >= 0.0
    if inside.any():
        axes.contourf(*grid, inside, levels=[0.5, 1.5], colors=[REGION_COLOUR], alpha=0.25, hatches=["//"])
    axes.plot([], [], "s", color=REGION_COLOUR, alpha=0.5, label=f"region at {distance:.2f} m")
