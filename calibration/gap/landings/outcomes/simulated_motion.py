"""How a flight's simulated landings move: the very ones of which a forecast counts the ends."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.gap.landings.kernels import COLUMNS, OMEGA, POSITION, QUATERNION
from calibration.gap.landings.outcomes.kernels import follow_flips
from calibration.gap.landings.outcomes.labels import classes_of
from calibration.gap.landings.outcomes.predict import scattered
from calibration.gap.landings.outcomes.prepare import SETTINGS, PreparedLandings
from onboard.arrays import FloatArray, IntArray
from sim_backend.physics.rollout import ROLLOUT

MOST_OF = (0.1, 0.9)
"""Quantiles of the draws between which most of them lie."""

_QUANTILES = (MOST_OF[0], 0.5, MOST_OF[1])

AFTER_CONTACT = SETTINGS.after_contact
"""s after the first contact in which a simulated landing ends, and its feet are counted."""


@dataclass(frozen=True)
class SimulatedMotion:
    """Simulated landings of one flight.

    Attributes:
        t: s after the trigger (rows,).
        traces: (n, rows, COLUMNS), as :func:`calibration.gap.landings.kernels.note` writes them.
        flips: thrusts (N, (n, 4)) until the motors are cut. cuts: s (n,), when they were, NaN: never.
        ends: records of :data:`sim_backend.physics.rollout.ROLLOUT` (n,).
    """

    t: FloatArray
    traces: FloatArray
    flips: FloatArray
    cuts: FloatArray
    ends: Any

    @property
    def classes(self) -> IntArray:
        """How each ends (n,): four legs, two or none."""
        return classes_of(self.ends["feet"])

    @property
    def contacts(self) -> FloatArray:
        """When each first touches (n,), s after the trigger; NaN: never."""
        return np.where(self.ends["contact"] > 0, self.ends["impact_time"], np.nan)

    @property
    def rates(self) -> FloatArray:
        """Rates (rad/s, (n, rows, 3)) about the body axes."""
        return self.traces[:, :, OMEGA : OMEGA + 3]

    @property
    def positions(self) -> FloatArray:
        """Positions (m, (n, rows, 3)) of the body's origin in the world."""
        return self.traces[:, :, POSITION : POSITION + 3]

    @property
    def quaternions(self) -> FloatArray:
        """Attitudes (n, rows, 4), body to world."""
        return self.traces[:, :, QUATERNION : QUATERNION + 4]

    @property
    def flip_angles(self) -> FloatArray:
        """Flip angles (rad, (n, rows)), as :func:`flip_angles` has them."""
        return flip_angles(self.quaternions)

    @property
    def thrusts(self) -> FloatArray:
        """Thrusts (N, (n, rows, 4)) that the motors are told."""
        running = ~(self.t >= self.cuts[:, None])
        return running[:, :, None] * self.flips[:, None, :]

    @property
    def first_contacts(self) -> FloatArray:
        """Quantiles (3,) of the first contact of those that touch, s after the trigger; NaN: none does."""
        return quantiles(self.contacts)

    def at_contact(self, values: FloatArray) -> FloatArray:
        """Values (n, rows) at the first contact of each landing (n,); NaN where there is none."""
        return np.array(
            [np.interp(when, self.t, row) for when, row in zip(self.contacts, values, strict=True)]
        )

    def typical(self, one: int) -> int | None:
        """The landing that ends in class `one` and is nearest to the median pitch rate of all that do."""
        those = np.flatnonzero(self.classes == one)
        if not those.size:
            return None
        rates = self.rates[those, :, 1]
        off = np.sum((rates - np.median(rates, axis=0)) ** 2, axis=1)
        return int(those[np.argmin(np.where(np.isfinite(off), off, np.inf))])


def quantiles(draws: FloatArray) -> FloatArray:
    """Lower, middle and upper quantile (3, ...) of draws (n, ...), without those that are not finite."""
    finite = np.isfinite(draws).reshape(len(draws), -1).all(axis=1)
    if not finite.any():
        return np.full((3, *draws.shape[1:]), np.nan)
    return np.asarray(np.quantile(draws[finite], _QUANTILES, axis=0))


def flip_angles(quaternions: FloatArray) -> FloatArray:
    """How far the body axis has turned from up towards the back (rad), along the last axis but one.

    In the plane of world x and z, 0 level, pi upside down; goes on beyond pi. A nose that rises counts as
    positive, as the flip turns; `quaternions` (..., rows, 4) must be dense enough to follow.
    """
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.unwrap(np.arctan2(-2.0 * (x * z + y * w), 1.0 - 2.0 * (x * x + y * y)), axis=-1)


def simulated_motion(
    prepared: PreparedLandings, index: int, parameters: Any, horizon: float
) -> SimulatedMotion:
    """Fly the draws of one flight again, as :func:`..predict.forecast` does.

    Args:
        prepared: the flights. index: which of them.
        parameters: physics parameters of the forecast.
        horizon: s after the trigger until which the motion is kept.
    """
    p = parameters.copy()
    p["ceiling_z"] = prepared.ceilings[index]
    start, numbers = prepared.starts[index], prepared.draws[index]
    states, flips = scattered(start, prepared.dispersion, numbers, p)
    rows = round(horizon / SETTINGS.dt) + 1
    traces, cuts = np.empty((len(states), rows, COLUMNS)), np.empty(len(states))
    ends = np.zeros(len(states), dtype=ROLLOUT)
    follow_flips(states, p, flips, SETTINGS, traces, cuts, ends)
    t = np.arange(rows, dtype=np.float64) * SETTINGS.dt
    return SimulatedMotion(t, traces, flips, cuts, ends)
