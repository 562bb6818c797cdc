"""The map: which channel of a residual goes with which regressor, and where.

Each pair of channel and regressor is judged by the share of variance that a profile explains on flights
that it was not fitted to. Whether that is beyond chance, innovations say
(:mod:`calibration.gap.unnamed.normal_equations`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.gap.data.channels import (
    CHANNELS,
    ResidualChannel,
    attitudes,
    channel_valid,
    channel_values,
    kinds,
)
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import Signals
from calibration.gap.unnamed.blocks import make_blocks
from calibration.gap.unnamed.normal_equations import (
    Grid,
    NormalEquations,
    block_equations,
    whitened_equations,
)
from calibration.gap.unnamed.profile import (
    KNOTS,
    Explained,
    explained,
    fast_part,
    fit_profile,
    places,
    profile_knots,
    random_signs,
)
from calibration.gap.unnamed.regressors import Regressor, regressors, where_it_lives
from onboard.arrays import FloatArray

DRAWS = 200
"""Draws of chance."""

_LEVEL = 0.05
"""Family-wise level of :attr:`GapMap.chance`."""


@dataclass(frozen=True, eq=False)
class Cell:
    """One channel against one regressor.

    Attributes:
        channel: where the residual lives.
        regressor: what it goes with.
        share: of the channel's block variance, cross-validated; below zero where nothing is explained.
        p: chance of a share this far beyond its null anywhere in the map (family-wise).
        condition: where the mean residual is far from its median, in words.
        knots: places along the regressor, shape (k,).
        profile, errors: mean residual at each knot about its median over time, and its standard errors,
            shape (k,), in the channel's unit.
    """

    channel: ResidualChannel
    regressor: Regressor
    share: float
    p: float
    condition: str
    knots: FloatArray
    profile: FloatArray
    errors: FloatArray


@dataclass(frozen=True, eq=False)
class GapMap:
    """Every channel against every regressor.

    Attributes:
        channels, regressors: names of rows and columns.
        share: of block variance explained, cross-validated, shape (channels, regressors).
        chance: the share that chance reaches somewhere in the map once in 20 times, likewise.
        p: family-wise over the whole map, likewise.
        cells: all pairs, largest share first.
    """

    channels: tuple[str, ...]
    regressors: tuple[str, ...]
    share: FloatArray
    chance: FloatArray
    p: FloatArray
    cells: tuple[Cell, ...]


def gap_map(
    signals: Signals,
    records: Sequence[FlightRecord],
    residual: FloatArray,
    rng: np.random.Generator,
    draws: int = DRAWS,
) -> GapMap:
    """Where a residual lives.

    Args:
        signals: of the flights.
        records: the flights, in the same order.
        residual: signals less everything that is explained, shape (n, 7), 0 where not valid.
        rng: source of chance.
        draws: of chance; 100 or more.
    """
    along = regressors(records)
    values, valid = channel_values(residual, attitudes(records)), channel_valid(signals.valid)
    blocks, knots = make_blocks(signals), [profile_knots(r.values) for r in along]
    grid = Grid(
        np.column_stack([places(r.values, k) for r, k in zip(along, knots, strict=True)]),
        np.stack([fast_part(r.values, signals) for r in along], axis=1)[:, :, None],
        KNOTS,
    )
    signs = random_signs(blocks.part.size, draws, rng)
    found: list[Explained] = []
    cells = []
    for members in kinds().values():
        used = slice(members[0], members[-1] + 1)
        whitened = whitened_equations(signals, blocks, values[:, used], valid[:, used], grid)
        averaged = block_equations(blocks, values[:, used], valid[:, used.start], grid)
        found.append(explained(whitened, averaged, signs))
        cells += [
            _cell(whitened, (local, column), (CHANNELS[channel], regressor), knots[column])
            for local, channel in enumerate(members)
            for column, regressor in enumerate(along)
        ]
    share, chance, p = _against_chance(
        np.concatenate([e.gain for e in found]), np.concatenate([e.share for e in found])
    )
    judged = [
        replace(cell, share=float(s), p=float(q))
        for cell, s, q in zip(cells, share.ravel(), p.ravel(), strict=True)
    ]
    return GapMap(
        channels=tuple(channel.name for channel in CHANNELS),
        regressors=tuple(r.name for r in along),
        share=share,
        chance=chance,
        p=p,
        cells=tuple(sorted(judged, key=lambda cell: -cell.share)),
    )


def _against_chance(gain: FloatArray, share: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Share, its chance level and family-wise p from the data (first draw) and from turned signs (the rest).

    Args:
        gain, share: of :class:`Explained`, shape (channels, regressors, draws).
    """
    z, used = _standardised(gain)
    most = z[:, :, 1:].max(axis=(0, 1))
    # Gumbel's law of maxima reaches beyond the few hundred draws.
    beta = np.sqrt(6.0) / np.pi * most.std()
    mode = most.mean() - np.euler_gamma * beta
    p = -np.expm1(-np.exp(-(z[:, :, 0] - mode) / beta))
    null = share[:, :, 1:]
    level = mode - beta * np.log(-np.log1p(-_LEVEL))
    chance = np.maximum(null.mean(axis=2) + level * null.std(axis=2), 0.0)
    return share[:, :, 0], chance, np.where(used, p, 1.0)


def _standardised(gain: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gains in standard deviations of chance from its mean, and whether chance varies at all."""
    null = gain[:, :, 1:]
    spread = null.std(axis=2, keepdims=True)
    used = spread > 0.0
    return (gain - null.mean(axis=2, keepdims=True)) / np.where(used, spread, np.inf), used[:, :, 0]


def _cell(
    equations: NormalEquations,
    at: tuple[int, int],
    pair: tuple[ResidualChannel, Regressor],
    knots: FloatArray,
) -> Cell:
    channel, regressor = pair
    profile, errors = fit_profile(equations, *at)
    time = np.einsum("pkk->k", equations.matrix[:, *at, :KNOTS, :KNOTS])
    profile, condition = where_it_lives(regressor, knots, profile, errors, time)
    return Cell(channel, regressor, 0.0, 1.0, condition, knots, profile, errors)
