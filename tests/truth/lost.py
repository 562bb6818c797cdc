"""Sets in which nothing flies: with what is hidden, the pilot cannot keep the vehicle."""

from collections.abc import Sequence

import numpy as np


class VehicleLost(RuntimeError):
    """The pilot could not keep the vehicle with what is hidden in it: there is no flight."""


def check_kept(attitudes: Sequence[np.ndarray]) -> None:
    """Refuse flights of which not one stays upright.

    Args:
        attitudes: of each flight, quaternions with the scalar last, shape (n, 4).

    Raises:
        VehicleLost: each turns over.
    """
    if all(np.min(1.0 - 2.0 * (q[:, 0] ** 2 + q[:, 1] ** 2)) < 0.0 for q in attitudes):
        raise VehicleLost(f"all {len(attitudes)} flights turn over")
