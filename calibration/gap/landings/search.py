"""Which contact effects explain a set of landings: fits, held-out scores, intervals, rivals.

A vehicle is a point theta = (ln stiffness scale, ln damping scale, ln adhesion strength, preload); a model
may move some of them. The score of a landing with cost J and N residuals is

    -(FREEDOM / 2) log(1 + J / N),

the log likelihood of Student's t with the scale of the floors: neighbouring samples repeat each other, so
that a landing counts as FREEDOM numbers however often it was sampled. Models are compared on landings that
they were not fitted to.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np

from calibration.gap.landings.problem import Solver
from calibration.measurement import drawn_again
from onboard.arrays import FloatArray
from sim_backend.physics.effects.registry import TERMS

FREEDOM = 30.0
"""Independent numbers in a landing: three axes for 0.4 s at a bandwidth of about 12 Hz."""

PERFECT = 4.6
"""ln N (99 N): a foot that never comes off, for all that a landing can pull."""

STRONGEST = math.log(12.0)
"""ln N: a stronger foot is never pulled off by a landing, so that its strength cannot be told."""

EXPLAINED = 0.3
"""Median cost per residual at which landings are explained as well as the equations hold: nothing is left."""


class Theta(NamedTuple):
    """Logarithms of the scales of stiffness and damping, ln of the adhesion strength (N), preload (N)."""

    stiffness: float = 0.0
    damping: float = 0.0
    adhesion: float = PERFECT
    preload: float = 0.0

    @property
    def moved(self) -> frozenset[str]:
        """Names of the parameters that are not as the vehicle file has them."""
        return frozenset(name for name, own in self._asdict().items() if own != getattr(NOMINAL, name))


NOMINAL = Theta()
HIGHEST = Theta(math.log(50.0), math.log(100.0), STRONGEST, 20.0)
LOWEST = Theta(math.log(0.02), math.log(0.02), math.log(0.05), 0.0)

CANDIDATES: dict[str, tuple[str, ...]] = {
    "leg_stiffness": ("stiffness",),
    "leg_damping": ("damping",),
    "foot_slip": ("adhesion", "preload"),
}
"""The parameters that each effect moves."""

MODELS: tuple[tuple[str, ...], ...] = tuple(
    model for size in range(3) for model in combinations(CANDIDATES, size)
)
"""None of them, one, or two."""

_STIFFNESS_GRID = np.log(np.geomspace(0.15, 6.0, 17))
_DAMPING_GRID = np.log(np.array([0.3, 1.0, 3.0, 10.0, 30.0]))
_ADHESION_GRID = np.log(np.geomspace(0.2, 12.0, 11))
_PRELOAD_GRID = (0.3, 1.0, 3.0)
_SCAN = Theta(0.03, 0.15, 0.05, 0.1)
"""Spacing of the first scan along a parameter; the second one has a third of it."""
_MOST_STEPS = 12  # of a scan, to either side
_FAR = 25.0  # log likelihood below the best at which a scan turns back at once,
_PATIENCE = 3  # and the steps without a better point after which it does
_WIDE = (-2.0, -1.0, 0.0, 1.0, 2.0)
_WIDE_STEP = Theta(0.06, 0.2, 0.12, 0.3)


def apply(parameters: Any, theta: Theta) -> Any:
    """A copy of a record of parameters with the contact effects of theta, by the effects' own equations."""
    changed = parameters.copy()
    TERMS["leg_stiffness"].apply(changed, {"scale": math.exp(theta.stiffness)})
    TERMS["leg_damping"].apply(changed, {"scale": math.exp(theta.damping)})
    if theta.adhesion < PERFECT or theta.preload > 0.0:
        strength = math.inf if theta.adhesion >= PERFECT else math.exp(theta.adhesion)
        values = {"adhesion_strength": strength, "minimum_preload": theta.preload, "preload_spread": 0.0}
        TERMS["foot_slip"].apply(changed, values)
    return changed


@dataclass
class ScoreTable:
    """Scores of all landings at every vehicle that was tried.

    Attributes:
        solver: of the landings. parameters: of the vehicle file.
        scores: (landings,) by vehicle. ratios: cost per residual, likewise. starts: nuisances, likewise.
    """

    solver: Solver
    parameters: Any
    scores: dict[Theta, FloatArray] = field(default_factory=dict)
    ratios: dict[Theta, FloatArray] = field(default_factory=dict)
    starts: dict[Theta, FloatArray] = field(default_factory=dict)

    def total(self, theta: Theta, near: Theta | None = None) -> float:
        """Sum of the scores at theta; `near`: a vehicle alike, whose start states are tried too."""
        theta = Theta(*(round(value, 5) for value in theta))
        if theta not in self.scores:
            warm = None if near is None else self.starts.get(near)
            costs, found = self.solver.costs(apply(self.parameters, theta), warm)
            self.starts[theta] = found
            self._note(theta, costs)
        return float(self.scores[theta].sum())

    def polish(self, thetas: Sequence[Theta]) -> None:
        """Try the start states of each of `thetas` for all others: none shall win by a luckier search."""
        warm = np.stack([self.starts[theta] for theta in thetas])
        for theta in thetas:
            costs, found = self.solver.improve(apply(self.parameters, theta), warm)
            better = costs < self.ratios[theta] * self.solver.counts
            self.starts[theta] = np.where(better[:, None], found, self.starts[theta])
            self._note(theta, np.where(better, costs, self.ratios[theta] * self.solver.counts))

    def _note(self, theta: Theta, costs: FloatArray) -> None:
        self.ratios[theta] = costs / self.solver.counts
        self.scores[theta] = -0.5 * FREEDOM * np.log1p(self.ratios[theta])

    def of_model(self, model: Sequence[str]) -> tuple[list[Theta], FloatArray]:
        """Vehicles that differ from the file only by what the model moves, and their scores (vehicles, n)."""
        moved = {name for effect in model for name in CANDIDATES[effect]}
        inside = [theta for theta in self.scores if theta.moved <= moved]
        return inside, np.array([self.scores[theta] for theta in inside])


def coarse_points() -> list[Theta]:
    """The vehicles that the search looks at first."""
    points = [Theta(*np.round(at, 5)) for at in product((0.0, *_STIFFNESS_GRID), _DAMPING_GRID)]
    points += [Theta(adhesion=round(float(strength), 5)) for strength in _ADHESION_GRID]
    points += [Theta(preload=m) for m in _PRELOAD_GRID]
    return points


def explore(coarse: ScoreTable, fine: ScoreTable) -> dict[tuple[str, ...], Theta]:
    """Best vehicle of every model that was worth a fit; `fine` then holds all that was tried.

    Pairs are fitted where the best single effect leaves something to explain.

    Args:
        coarse: landings with a short horizon, on which the valleys are wide. fine: with the whole one.
    """
    for theta in coarse_points():
        coarse.total(theta)
    best: dict[tuple[str, ...], Theta] = {(): NOMINAL}
    fine.total(NOMINAL)
    for effect in CANDIDATES:
        best[(effect,)] = _refine(fine, _coarse_best(coarse, (effect,)), (effect,))
    top = max(best, key=lambda model: fine.total(best[model]))
    if float(np.median(fine.ratios[best[top]])) > EXPLAINED:
        for model in (model for model in MODELS if len(model) == 2):
            best[model] = _best_pair(coarse, fine, model, best)
    fine.polish(list(best.values()))
    return best


def _best_pair(
    coarse: ScoreTable, fine: ScoreTable, model: tuple[str, ...], best: dict[tuple[str, ...], Theta]
) -> Theta:
    """Fit of two effects: from the better of them alone, and from the best point of the coarse grid."""
    inner = max((best[(effect,)] for effect in model), key=fine.total)
    if "foot_slip" in model:
        other = best[(next(effect for effect in model if effect != "foot_slip"),)]
        for adhesion in _ADHESION_GRID:
            coarse.total(other._replace(adhesion=round(float(adhesion), 5)), near=NOMINAL)
    starts = dict.fromkeys((inner, _coarse_best(coarse, model)))
    return max((_refine(fine, theta, model) for theta in starts), key=fine.total)


def _coarse_best(coarse: ScoreTable, model: tuple[str, ...]) -> Theta:
    """Best vehicle of the coarse grid that has an effect of the model."""
    thetas, scores = coarse.of_model(model)
    totals = scores.sum(axis=1)
    return next(thetas[k] for k in np.argsort(-totals) if thetas[k] != NOMINAL)


def _refine(table: ScoreTable, theta: Theta, model: tuple[str, ...]) -> Theta:
    """Scan along each parameter of a model, widely and then closely; twice where there are two effects."""
    names = [name for effect in model for name in CANDIDATES[effect]]
    table.total(theta)
    for scale in (1.0, 0.33):
        for name in names:
            if name == "adhesion" and theta.adhesion >= PERFECT:
                continue  # there is nothing between a foot that comes off and one that never does
            theta = _scan(table, theta, name, scale * getattr(_SCAN, name))
    return theta


def _scan(table: ScoreTable, theta: Theta, name: str, spacing: float) -> Theta:
    """Best of the points along a parameter: outwards on both sides while the score does not fall far."""
    low, high = getattr(LOWEST, name), getattr(HIGHEST, name)
    best = theta
    for sign in (1.0, -1.0):
        since_best = 0
        for step in range(1, _MOST_STEPS + 1):
            value = getattr(theta, name) + sign * step * spacing
            if not low <= value <= high:
                break
            trial = theta._replace(**{name: round(value, 5)})
            fallen = table.total(best) - table.total(trial, near=theta)
            since_best = 0 if fallen < 0.0 else since_best + 1
            if fallen < 0.0:
                best = trial
            if fallen > _FAR or since_best >= _PATIENCE:
                break
    return best


def finer_adhesion(table: ScoreTable, theta: Theta) -> float:
    """ln of the adhesion strength (N) that fits best in `table`, whose solver takes smaller steps.

    The pull on a foot peaks within milliseconds, and the implicit rods of a step of 1 ms (docs/physics.md)
    cut the peak by a fifth: there a foot must be weaker to come off at the same moment.
    """
    return _scan(table, theta._replace(adhesion=round(theta.adhesion + 0.2, 5)), "adhesion", 0.05).adhesion


def widen(table: ScoreTable, theta: Theta, model: tuple[str, ...]) -> None:
    """Try a grid around a model's best vehicle, so that bootstrap and hold-out can choose across a ridge."""
    names = [name for effect in model for name in CANDIDATES[effect] if name in theta.moved]
    for offsets in product(_WIDE, repeat=len(names)):
        moved = {}
        for name, offset in zip(names, offsets, strict=True):
            value = getattr(theta, name) + offset * getattr(_WIDE_STEP, name)
            moved[name] = round(min(max(value, getattr(LOWEST, name)), getattr(HIGHEST, name)), 5)
        table.total(theta._replace(**moved), near=theta)


@dataclass(frozen=True)
class LeaveOneOut:
    """A model on landings that it was not fitted to.

    Attributes:
        model: its effects. theta: fitted to all landings.
        chosen: fitted to all but each landing. scores: of each landing there, (n,).
    """

    model: tuple[str, ...]
    theta: Theta
    chosen: tuple[Theta, ...]
    scores: FloatArray


def leave_one_out(table: ScoreTable, model: tuple[str, ...], theta: Theta) -> LeaveOneOut:
    """Fit a model to all landings but one, and score that one, for each."""
    thetas, scores = table.of_model(model)
    rest = scores.sum(axis=1, keepdims=True) - scores
    picked = np.argmax(rest, axis=0)
    held = scores[picked, np.arange(scores.shape[1])]
    return LeaveOneOut(model, theta, tuple(thetas[k] for k in picked), held)


def bootstrap(
    table: ScoreTable, model: tuple[str, ...], rng: np.random.Generator, replicates: int
) -> FloatArray:
    """Fits (replicates, 4) of a model to landings drawn with replacement, between the vehicles tried."""
    thetas, scores = table.of_model(model)
    points = np.array(thetas)
    count = scores.shape[1]
    weights = (np.bincount(drawn, minlength=count) for drawn in drawn_again(count, replicates, rng))
    return np.array([_peak(points, scores @ weight) for weight in weights])


def _peak(points: FloatArray, values: FloatArray) -> FloatArray:
    """Highest point of `values` (n,) over `points` (n, d): a parabola through the best, axis by axis."""
    top = int(np.argmax(values))
    peak = points[top].copy()
    for axis in range(points.shape[1]):
        others = np.delete(np.arange(points.shape[1]), axis)
        line = np.flatnonzero(np.all(points[:, others] == points[top, others], axis=1))
        below = line[points[line, axis] < points[top, axis]]
        above = line[points[line, axis] > points[top, axis]]
        if not below.size or not above.size:
            continue
        left = int(below[np.argmax(points[below, axis])])
        right = int(above[np.argmin(points[above, axis])])
        x = points[[left, top, right], axis]
        bend, slope, _ = np.polyfit(x - x[1], values[[left, top, right]], 2)
        if bend < 0.0:
            peak[axis] = np.clip(x[1] - 0.5 * slope / bend, x[0], x[2])
    return peak
