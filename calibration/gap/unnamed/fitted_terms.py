"""What is missing and has no name: terms of a place, a speed or a frequency, in competition with names."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.gap.data.split import FEW
from calibration.gap.estimate.acceptance import LEAST_GAIN, lower_bound
from calibration.gap.estimate.refine import Fitted, Training, UnnamedTerm, refine, settled
from calibration.gap.unnamed.consequence import amplitude, least_amplitude
from calibration.gap.unnamed.gap_map import GapMap, gap_map
from calibration.gap.unnamed.lines import find_lines
from calibration.gap.unnamed.structure import Structure, structured
from calibration.gap.unnamed.term_search import unnamed_terms
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle

_OFFERED = 3
"""Places, and lines, that are made into terms in a round."""

_ROUNDS = 3
"""Of a fit with another term: its coefficients are linear, and noise and spreads have followed by then."""


@dataclass(frozen=True, eq=False)
class FittedTerm:
    """A term without a name that came into the model.

    Attributes:
        structure: where it lives.
        term: what it is.
        gain: held-out log-likelihood gained.
        after: the fit with it.
    """

    structure: Structure
    term: UnnamedTerm
    gain: float
    after: Fitted


def residual_map(fitted: Fitted, training: Training, rng: np.random.Generator) -> GapMap:
    """Where the residual of a fit lives."""
    return gap_map(training.regression.signals, training.records, fitted.estimate.residual, rng)


def best_term(present: Fitted, training: Training, rng: np.random.Generator) -> FittedTerm | None:
    """The term without a name that explains most; None when what is left has no structure."""
    signals, records = training.regression.signals, training.records
    residual = present.estimate.residual
    found = structured(residual_map(present, training, rng), find_lines(signals, records, residual))
    # What a propeller lifts says little about what its motor draws: a voltage that goes with it is no gap.
    found = [structure for structure in found if structure.channel.kind != "voltage"]
    places = [structure for structure in found if structure.cell is not None][:_OFFERED]
    lines = [structure for structure in found if structure.line is not None][:_OFFERED]
    terms = unnamed_terms(
        [structure.cell for structure in places if structure.cell is not None],
        [structure.line for structure in lines if structure.line is not None],
        signals,
        records,
        residual,
    )
    offered = [
        _offer(present, structure, term, training, rng)
        for structure, term in zip([*places, *lines], terms, strict=True)
    ]
    believed = [one for one in offered if one is not None]
    best = max(believed, key=lambda one: one.gain, default=None)
    return None if best is None else replace(best, after=settled(best.after, training))


def formulas(fitted: Fitted, terms: Sequence[UnnamedTerm], vehicle: Vehicle) -> list[str]:
    """Those unnamed terms of a fit with their coefficients, in words."""
    return [term.formula(values, vehicle) for term, values in coefficients(fitted) if term in terms]


def with_consequence(
    found: Sequence[FittedTerm], fitted: Fitted, training: Training
) -> tuple[FittedTerm, ...]:
    """Those that are large enough to matter to a flight; lines were held against that when they were found.

    The others stay in the model: left out, a name would be given for them.
    """
    vehicle, valid = fitted.model.base, training.regression.signals.valid
    sizes = [(term, amplitude(term, values, valid)) for term, values in coefficients(fitted)]
    large = [term for term, size in sizes if size >= least_amplitude(term.channel, vehicle)]
    return tuple(one for one in found if one.structure.line is not None or one.term in large)


def coefficients(fitted: Fitted) -> Iterator[tuple[UnnamedTerm, FloatArray]]:
    """The unnamed terms of a fit, each with its values, in the order of the estimate's columns."""
    values = fitted.estimate.fit.theta[fitted.first_unnamed :]
    for term in fitted.unnamed:
        count = len(term.columns)
        yield term, values[:count]
        values = values[count:]


def without_superfluous(present: Fitted, found: Sequence[FittedTerm], training: Training) -> Fitted:
    """The fit without unnamed terms that named effects, found later, have made superfluous."""
    for one in found:
        rest = tuple(term for term in present.unnamed if term is not one.term)
        if len(rest) == len(present.unnamed):
            continue
        reduced = _with_terms(present, rest, training)
        columns = list(range(len(present.columns)))[-len(one.term.columns) :]
        in_time = _own_phase(one.structure) or present.few_kinds(columns)
        if float(present.gains(reduced, in_time).sum()) < _least_gain(one.structure):
            present = settled(reduced, training)
    return present


def _with_terms(present: Fitted, terms: Sequence[UnnamedTerm], training: Training) -> Fitted:
    """The fit with these terms in the place of its own, and the derivatives that it had: a term moves the
    named parameters by little, and derivatives are most of the work."""
    model, variables = present.model, present.variables
    return refine(model, variables, training, _ROUNDS, start=present, unnamed=terms, near=present)


def _offer(
    present: Fitted, structure: Structure, term: UnnamedTerm, training: Training, rng: np.random.Generator
) -> FittedTerm | None:
    fitted = _with_terms(present, (*present.unnamed, term), training)
    columns = list(range(len(fitted.columns)))[-len(term.columns) :]
    gains = fitted.gains(present, _own_phase(structure) or fitted.few_kinds(columns))
    total = float(gains.sum())
    if total < _least_gain(structure):
        return None
    if structure.line is None and (
        _of_few(gains, training) or lower_bound(gains, training, False, rng) <= 0.0
    ):
        return None
    return FittedTerm(structure, term, total, fitted)


def _of_few(gains: FloatArray, training: Training) -> bool:
    """Whether few flights gain most: it may be of those alone, and no known physics says otherwise.

    Of a power of a place, the flights that went farthest tell most, and yet all may gain.
    """
    flights = np.maximum(np.bincount(training.flight_of_part, weights=gains), 0.0)
    return bool(np.sum(flights**2) > flights.sum() ** 2 / FEW)


def _own_phase(structure: Structure) -> bool:
    """Whether a term has coefficients of its own on each flight: only that flight's other parts tell them."""
    return structure.line is not None


def _least_gain(structure: Structure) -> float:
    """Log-likelihood that a term must gain.

    A line was held against chance when it was found, over all flights; a noise with a memory explains most of
    it as a resonance, so that its gain says little more than that it is not in the way.
    """
    return 0.0 if structure.line is not None else LEAST_GAIN
