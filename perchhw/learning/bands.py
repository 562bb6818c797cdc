"""Landing rates by condition, and their means by band of angle and speed."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from perchhw.learning.grid import Condition
from perchhw.learning.sweep_folder import Row

BANDS_DEG = ((30.0, 45.0), (45.0, 60.0), (60.0, 75.0), (75.0, 90.1))
"""Bands of the approach angle; the right bound is outside, except for 90 deg."""

FAST = 2.5
"""m/s from which an approach counts as fast in the table."""


def best_per_condition(rows: Sequence[Row], column: str = "landing_rate") -> dict[Condition, float]:
    """The best rate of the repeats at each condition."""
    best: dict[Condition, float] = {}
    for row in rows:
        condition = Condition(float(row["speed_m_s"] or 0), float(row["angle_deg"] or 0))
        best[condition] = max(best.get(condition, 0.0), float(row[column] or 0))
    return best


def band_table(rates: dict[Condition, float]) -> list[dict[str, Any]]:
    """Mean rate by band of angle and below or from 2.5 m/s, and over all; bands without data are left out."""
    table = []
    for low, high in BANDS_DEG:
        for fast in (False, True):
            inside = [
                rate for c, rate in rates.items() if low <= c.angle_deg < high and (c.speed >= FAST) == fast
            ]
            if inside:
                table.append(_band(f"{low:g}-{min(high, 90.0):g} deg", fast, inside))
    return [*table, _band("all", None, list(rates.values()))]


def _band(angles: str, fast: bool | None, rates: list[float]) -> dict[str, Any]:
    speeds = "all" if fast is None else f">= {FAST:g} m/s" if fast else f"< {FAST:g} m/s"
    return {"angles": angles, "speeds": speeds, "rate": float(np.mean(rates)), "conditions": len(rates)}
