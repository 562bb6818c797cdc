"""Where a residual can live: forces in the body and in the world frame, torques, voltage."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import matrices
from calibration.gap.data.signals import FORCE, TORQUE, VOLTAGE
from onboard.arrays import BoolArray, FloatArray


class ResidualChannel(NamedTuple):
    """One component of the residual.

    Attributes:
        name: unique among :data:`CHANNELS`.
        signal: name in :data:`calibration.gap.data.signals.CHANNELS` (of the world's axis likewise).
        frame: "body", "world" or "battery".
        unit: of the residual.
        words: how sentences call its direction.
    """

    name: str
    signal: str
    frame: str
    unit: str
    words: str

    @property
    def axis(self) -> int:
        """0, 1, 2 for x, y, z; -1 for the voltage."""
        return "xyz".find(self.signal[-1])

    @property
    def kind(self) -> str:
        """ "force", "torque" or "voltage": channels of one kind are valid on the same rows."""
        return self.signal.split("_")[0]


CHANNELS = (
    *(ResidualChannel(f"force_{a}", f"force_{a}", "body", "m/s2", f"along body {a}") for a in "xyz"),
    *(ResidualChannel(f"world_force_{a}", f"force_{a}", "world", "m/s2", f"along world {a}") for a in "xyz"),
    *(ResidualChannel(f"torque_{a}", f"torque_{a}", "body", "rad/s2", f"about body {a}") for a in "xyz"),
    ResidualChannel("voltage", "voltage", "battery", "V", "at the battery"),
)
"""All channels, those of one kind beside each other."""

BY_NAME = {channel.name: channel for channel in CHANNELS}
"""The same by name."""


def attitudes(records: Sequence[FlightRecord]) -> FloatArray:
    """Matrices body to world of all rows, shape (n, 3, 3)."""
    return np.concatenate([matrices(record.attitude) for record in records])


def channel_values(residual: FloatArray, turns: FloatArray) -> FloatArray:
    """The residual by channel.

    Args:
        residual: shape (n, 7), 0 where not valid.
        turns: body to world, shape (n, 3, 3).

    Returns:
        Shape (n, 10), in the order of :data:`CHANNELS`.
    """
    world = np.einsum("nij,nj->ni", turns, residual[:, FORCE])
    return np.hstack([residual[:, FORCE], world, residual[:, FORCE.stop :]])


def channel_valid(valid: BoolArray) -> BoolArray:
    """Rows on which each channel is valid, shape (n, 10), from those of the signals, shape (n, 7)."""
    force, torque = (valid[:, kind].all(axis=1, keepdims=True) for kind in (FORCE, TORQUE))
    return np.hstack([np.repeat(force, 6, axis=1), np.repeat(torque, 3, axis=1), valid[:, VOLTAGE:]])


def kinds() -> dict[str, list[int]]:
    """Indices into :data:`CHANNELS` by kind: neighbours, valid on the same rows."""
    found: dict[str, list[int]] = {}
    for index, channel in enumerate(CHANNELS):
        found.setdefault(channel.kind, []).append(index)
    return found
