"""Flights made ready: starts, the log's clock, the ceiling of the day, and how much all of it scatters.

A flip is simulated without a ceiling from its recorded start. The gyro then tells how much later the log's
clock is than the trigger (rows of a radio log differ in age by up to 20 ms), and how much of the predicted
rates the vehicle showed. Contacts tell where the ceiling was (:mod:`.ceilings`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.flights import Flight
from calibration.gap.data.duplicates import duplicate_of
from calibration.gap.data.record import NotUsed
from calibration.gap.landings.kernels import COLUMNS, OMEGA
from calibration.gap.landings.outcomes.ceilings import (
    LEAST_CEILING,
    UnknownCeiling,
    session_ceilings,
    unknown_ceilings,
)
from calibration.gap.landings.outcomes.dispersion import Dispersion, estimate_dispersion
from calibration.gap.landings.outcomes.kernels import trace_flips
from calibration.gap.landings.outcomes.roll import RollEvidence, roll_evidence
from calibration.gap.landings.outcomes.starts import TriggerStart, trigger_start
from calibration.gap.landings.problem import highest
from calibration.gap.replay.inputs import below_no_ceiling
from onboard.arrays import FloatArray, IntArray
from onboard.vehicle import Vehicle
from sim_backend.physics.rollout import RolloutSettings

DRAWS = 200
"""Landings a flight: a share of 0.5 is then known to 0.035."""

ERRORS = 13
"""Numbers drawn for a landing: height, velocity (3), attitude (3), rate (3), pitch, roll, pads."""

SETTINGS = RolloutSettings()

CLOCK_RADIO, CLOCK_TRACKED = 0.010, 0.003
"""s, standard deviations of the clock's offset before the gyro is asked: two rows of a radio log up to 20 ms
old, one of them the trigger's flag (authors' data, section 1); our own runs have the drone's times."""

_CLOCK_STEP = 0.002
_CLOCK_STEPS = 20
_CLOCK_GRID = _CLOCK_STEP * np.arange(-_CLOCK_STEPS, _CLOCK_STEPS + 1)

CLOCK_BOUND = float(_CLOCK_GRID[-1])
"""s, the largest offset that is tried."""

RATE_ERROR = 1.3
"""rad/s, RMS that flips leave with a clock of their own."""

_UNSEEN_FLIP = 0.2  # s of a flip that is used where no contact was seen


@dataclass(frozen=True)
class FlipFit:
    """A flip without a ceiling, laid over the gyro.

    Attributes:
        clock: s, by how much the log is later than the trigger.
        pitch: measured over predicted change of rate about b_y. roll: change about b_x over the predicted one
            about b_y.
        error: rad/s, RMS about b_y.
        missed, gained: rad/s (k,), roll rate that the model lacks, pitch rate that it gained.
        ceiling: m, where the contact was, NaN where unseen. climb: m/s of the highest point there.
    """

    clock: float
    pitch: float
    roll: float
    error: float
    missed: FloatArray
    gained: FloatArray
    ceiling: float
    climb: float

    @property
    def clock_at_bound(self) -> bool:
        """Whether the clock may be off by more than was tried."""
        return abs(self.clock) >= CLOCK_BOUND


@dataclass(frozen=True)
class PreparedLandings:
    """Flights ready to be simulated with any vehicle.

    Attributes:
        starts: their triggers.
        flips: the flip of each, with the vehicle that prepared them.
        ceilings: m (n,), of the session, from the contacts of the other flights; where these are too few, as
            the drone reckoned.
        contacts: how many these are (n,).
        dispersion: of starts and flips.
        draws: standard normal numbers (n, draws, ERRORS), the same for every vehicle that is compared.
        roll: why flips roll; None where flips are too few to ask.
        unused: flights without a start.
    """

    starts: tuple[TriggerStart, ...]
    flips: tuple[FlipFit, ...]
    ceilings: FloatArray
    contacts: IntArray
    dispersion: Dispersion
    draws: FloatArray
    roll: RollEvidence | None
    unused: tuple[NotUsed, ...]

    @property
    def measured_ceilings(self) -> FloatArray:
        """The ceilings (m, (n,)) that contacts tell, NaN where they are too few."""
        return _measured(self.ceilings, self.contacts)

    @property
    def unknown_ceilings(self) -> tuple[UnknownCeiling, ...]:
        """The ceilings that are as the drone reckoned."""
        return unknown_ceilings(self.starts, np.array([flip.ceiling for flip in self.flips]), self.contacts)

    def contact(self, index: int) -> float | None:
        """Time (s) from the trigger to the measured contact of a flight; None: unseen."""
        seen = self.starts[index].contact
        return None if seen is None else seen + self.flips[index].clock


def prepare(
    flights: Sequence[Flight], vehicle: Vehicle, rng: np.random.Generator, draws: int = DRAWS
) -> PreparedLandings:
    """Starts, clocks, ceilings and dispersion of flights."""
    free = below_no_ceiling(vehicle)
    starts: list[TriggerStart] = []
    unused: list[NotUsed] = []
    for flight, copied in zip(flights, duplicate_of(flights), strict=True):
        if copied is not None:
            unused.append(NotUsed(flight.name, f"holds the same numbers as {copied.source}, or nearly"))
            continue
        found = trigger_start(flight, vehicle, free)
        if isinstance(found, NotUsed):
            unused.append(found)
        else:
            starts.append(found)
    flips = tuple(_flip(start, free) for start in starts)
    implied = np.array([flip.ceiling for flip in flips])
    ceilings, contacts = session_ceilings(starts, implied)
    off = implied - _measured(ceilings, contacts)
    pitch, roll = np.array([flip.pitch for flip in flips]), np.array([flip.roll for flip in flips])
    climbs = np.array([flip.climb for flip in flips])
    return PreparedLandings(
        starts=tuple(starts),
        flips=flips,
        ceilings=ceilings,
        contacts=contacts,
        dispersion=estimate_dispersion(starts, off, climbs, pitch, roll),
        draws=rng.standard_normal((len(starts), draws, ERRORS)),
        roll=roll_evidence(starts, vehicle, rng),
        unused=tuple(unused),
    )


def _flip(start: TriggerStart, p: Any) -> FlipFit:
    end = _UNSEEN_FLIP if start.contact is None else start.contact - start.contact_error
    trace = np.empty((1, round((end + 0.1) / SETTINGS.dt), COLUMNS))
    trace_flips(start.state.copy(), p, start.flip[None], SETTINGS, trace)
    rows = (start.gyro_t > 0.0) & (start.gyro_t <= end)
    t, seen = start.gyro_t[rows], start.gyro[rows]
    clock = _clock(t, seen[:, 1], trace[0], CLOCK_TRACKED if start.tracked else CLOCK_RADIO)
    model = _at(trace[0], t + clock)
    missed = seen[:, 0] - _at(trace[0], t + clock, axis=0)
    gained, first = model - trace[0, 0, OMEGA + 1], trace[0, 0, OMEGA : OMEGA + 3]
    size = float(gained @ gained)
    slope = (seen - first).T @ gained / size if size > 0.0 else np.full(3, np.nan)
    ceiling = climb = np.nan
    if start.contact is not None:
        row = min(max(round((start.contact + clock) / SETTINGS.dt), 1), trace.shape[1] - 2)
        below, ceiling, above = (highest(p, trace[0, row + k]) for k in (-1, 0, 1))
        climb = (above - below) / (2.0 * SETTINGS.dt)
    error = float(np.sqrt(np.mean((seen[:, 1] - model) ** 2))) if t.size else np.nan
    return FlipFit(clock, float(slope[1]), float(slope[0]), error, missed, gained, ceiling, climb)


def _at(trace: FloatArray, t: FloatArray, axis: int = 1) -> FloatArray:
    """Rate (rad/s) about a body axis of a trace at times (s)."""
    return np.asarray(np.interp(t, SETTINGS.dt * np.arange(len(trace)), trace[:, OMEGA + axis]))


def roll_errors(flips: Sequence[FlipFit]) -> FloatArray:
    """RMS (rad/s, (n, 2)) of the missed roll rate, and of what the others' roll per pitch leaves of it."""
    found = np.full((len(flips), 2), np.nan)
    shares = np.array([flip.roll for flip in flips])
    for index, flip in enumerate(flips):
        others = np.delete(shares, index)
        if flip.missed.size and np.isfinite(others).any():
            left = flip.missed - np.nanmean(others) * flip.gained
            found[index] = np.sqrt([np.mean(flip.missed**2), np.mean(left**2)])
    return found


def _clock(t: FloatArray, seen: FloatArray, trace: FloatArray, sigma: float) -> float:
    """Offset (s) of the log's clock that lays the gyro (rad/s, at `t`) best over the simulated flip."""
    costs = [
        float(np.sum((seen - _at(trace, t + offset)) ** 2)) / RATE_ERROR**2 + (offset / sigma) ** 2
        for offset in _CLOCK_GRID
    ]
    return float(_CLOCK_GRID[int(np.argmin(costs))])


def _measured(ceilings: FloatArray, contacts: IntArray) -> FloatArray:
    return np.where(contacts >= LEAST_CEILING, ceilings, np.nan)
