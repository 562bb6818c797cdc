"""From the fits of one hang to the inertia about its axis, with budget and interval.

``I = m g (D_t D_b / 4 - e^2) T0^2 / (4 pi^2 h)``, h the height of the hang (the paper's formula for equal
strings and e = 0). What can only have one sign (centre of mass off the middle, air that moves along) is
corrected by its mean, and its spread stays in the budget. The 95 % interval is drawn (GUM Supplement 1): the
largest input is usually a ruler, whose error is even between two limits and not normal.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.bench.inertia.checks import check_inertia, check_trials
from calibration.bench.inertia.errors import RigError
from calibration.bench.inertia.geometry import small_period
from calibration.bench.inertia.rig import Rig, check_rig
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.measurement import (
    COVERAGE,
    Contribution,
    Estimate,
    Finding,
    combine,
    rejected,
    student,
)
from onboard.arrays import FloatArray, Vector

FEWEST_TRIALS = 4
"""Below it nobody knows the spread between trials, and no 95 % interval is claimed."""

USUAL_SPREAD = 0.0015
"""Relative standard deviation of the period between trials, taken where fewer than FEWEST_TRIALS were made:
the largest that the authors' repeated logs show (0.06 to 0.14 %)."""

_DRAWS = 40_000
_SEED = 20260101  # fixed: the same data give the same interval
_UNLIKE_INERTIA = 1.0  # relative difference of the axes that a tilt may mix in


@dataclass(frozen=True, slots=True)
class InertiaResult:
    """Inertia of the drone about one axis.

    Attributes:
        inertia: kg m2, without jig.
        axis: unit vector, body frame: mean of the trials.
        period: s at zero amplitude, mean of the trials with the uncertainty of their spread.
        trials: s, the period of each trial that counts.
        spread: relative standard deviation of the trials; NaN for one.
        formula: kg m2: the paper's formula with this period, nothing corrected and nothing subtracted.
        budget: relative contributions, largest first.
        findings: of rig, trials and plausibility (those of each swing are in its fit).
    """

    inertia: Estimate
    axis: Vector
    period: Estimate
    trials: tuple[float, ...]
    spread: float
    formula: float
    budget: tuple[Contribution, ...]
    findings: tuple[Finding, ...]

    @property
    def rejected(self) -> bool:
        """Whether a finding says that the result must not be used."""
        return rejected(self.findings)


def inertia_about_axis(
    fits: Sequence[SwingFit], rig: Rig, expected: float | None = None, accept_rejected: bool = False
) -> InertiaResult:
    """Combine the trials of one hang.

    Args:
        fits: the trials; rejected ones are left out.
        rig: masses and lengths.
        expected: kg m2, of a preset or the former measurement, for the plausibility check.
        accept_rejected: count rejected trials too (the operator said so); noted in the findings.

    Raises:
        RigError: no trial counts, or lengths that no hang has.
    """
    counted = [fit for fit in fits if accept_rejected or not fit.rejected]
    if not counted:
        raise RigError(f"none of {len(fits)} trial(s) is usable; see their findings and record again")
    period, trials = mean_period([small_period(fit, rig) for fit in counted])
    formula = formula_inertia(period.value, rig)
    total = formula * (1.0 - _off_middle(rig)) * (1.0 - 0.5 * rig.air)
    value = total - _jig_inertia(rig)
    if not value > 0.0:
        raise RigError(
            f"the jig's inertia is no smaller than what was measured ({total:.3g} kg m2); check both"
        )
    budget = sorted(_budget(rig, period, total, value), key=lambda one: -one.share)
    share, dof = combine(budget)
    spread = float(np.std(trials, ddof=1) / np.mean(trials)) if len(trials) > 1 else math.nan
    claimed = len(trials) >= FEWEST_TRIALS
    half = _half_interval(rig, period, value) if claimed else math.inf
    findings = [
        *check_rig(rig),
        *check_trials(counted, spread, FEWEST_TRIALS),
        *check_inertia(value, rig.drone_mass, expected),
    ]
    return InertiaResult(
        inertia=Estimate(value, "kg m2", share * value, dof if claimed else 0.0, half_interval=half),
        axis=_mean_axis(counted),
        period=period,
        trials=trials,
        spread=spread,
        formula=formula,
        budget=tuple(budget),
        findings=tuple(findings),
    )


def formula_inertia(period: float, rig: Rig) -> float:
    """kg m2 of all that hangs, by the paper's formula for `period` (s), with no correction."""
    product = 0.25 * rig.top.value * rig.bottom.value
    return rig.mass.value * rig.gravity.value * product * period**2 / (4.0 * math.pi**2 * rig.drop)


def expected_uncertainty(rig: Rig, period: Estimate) -> float:
    """Relative standard uncertainty of an inertia measured with `rig` (without jig) and `period` (s)."""
    return combine(_budget(rig, period, 1.0, 1.0))[0]


def mean_period(trials: Sequence[float]) -> tuple[Estimate, tuple[float, ...]]:
    """Mean period (s) of `trials`: its uncertainty is their spread, never the fit's own."""
    n = len(trials)
    mean = float(np.mean(trials))
    if n < FEWEST_TRIALS:
        return Estimate(mean, "s", USUAL_SPREAD * mean / math.sqrt(n), 0.0), tuple(trials)
    return Estimate(mean, "s", float(np.std(trials, ddof=1)) / math.sqrt(n), n - 1.0), tuple(trials)


def _off_middle(rig: Rig) -> float:
    """Share of the inertia that the centre of mass off the middle adds to the formula on average."""
    return 4.0 * rig.offset_sigma**2 / (rig.top.value * rig.bottom.value)


def _jig_inertia(rig: Rig) -> float:
    """kg m2, of the jig about the common vertical axis, with what two separate centres of mass add."""
    if rig.jig is None:
        return 0.0
    jig = rig.jig
    reduced = jig.mass.value * rig.drone_mass / rig.mass.value
    return jig.inertia.value + reduced * jig.offset**2


def _budget(rig: Rig, period: Estimate, total: float, value: float) -> list[Contribution]:
    """Shares of the drone's inertia; the jig's subtraction makes those of the formula larger."""
    leverage = total / value
    separation = rig.top.sigma / rig.top.value + rig.bottom.sigma / rig.bottom.value  # one ruler: they add up
    lines = [
        (
            "string distance",
            separation,
            min(rig.top.dof, rig.bottom.dof),
            "use a printed jig, or a larger distance",
        ),
        ("period", 2.0 * period.sigma / period.value, max(period.dof, 1.0), "make more trials"),
        ("mass", rig.mass.sigma / rig.mass.value, rig.mass.dof, "use a finer balance"),
        (
            "string length",
            rig.length.sigma / rig.length.value,
            rig.length.dof,
            "measure it loaded, more often",
        ),
        (
            "centre of mass",
            math.sqrt(2.0) * _off_middle(rig),
            math.inf,
            "centre the drone, or a larger string distance",
        ),
        ("tilt", math.sqrt(2.0) * _UNLIKE_INERTIA * rig.tilt_sigma**2, math.inf, "hang it level"),
        ("air", rig.air / math.sqrt(12.0), math.inf, "compare with a bar of known inertia"),
        ("strings", rig.string, math.inf, "use thinner braided line"),
        ("gravity", rig.gravity.sigma / rig.gravity.value, rig.gravity.dof, "enter latitude and height"),
    ]
    budget = [Contribution(name, leverage * share, dof, advice) for name, share, dof, advice in lines]
    if rig.jig is not None:
        share = rig.jig.inertia.sigma / value
        budget.append(Contribution("jig", share, rig.jig.inertia.dof, "swing the jig alone"))
    return budget


def _half_interval(rig: Rig, period: Estimate, value: float) -> float:
    """kg m2: 95 % of drawn inertias lie no further from `value` (GUM Supplement 1, 7.7, symmetric)."""
    rng = np.random.default_rng(_SEED)

    def factor(one: Estimate, source: np.random.Generator = rng) -> FloatArray:
        return 1.0 + one.draw(source, _DRAWS) / one.value

    # One ruler measures both distances and is wrong by the same at both: the same draws.
    top, bottom = (factor(one, np.random.default_rng(_SEED + 1)) for one in (rig.top, rig.bottom))
    period_factor = 1.0 + period.sigma / period.value * student(rng, period.dof, _DRAWS)
    drawn = formula_inertia(period.value, rig) * factor(rig.mass) * factor(rig.gravity) / factor(rig.length)
    drawn *= period_factor**2 * (top * bottom - _off_middle(rig) * rng.standard_normal(_DRAWS) ** 2)
    tilt = _UNLIKE_INERTIA * rig.tilt_sigma**2 * (rng.standard_normal(_DRAWS) ** 2 - 1.0)
    drawn *= 1.0 - rng.uniform(0.0, rig.air, _DRAWS) + tilt + rig.string * rng.standard_normal(_DRAWS)
    drawn -= _jig_inertia(rig)
    if rig.jig is not None:
        drawn += rig.jig.inertia.draw(rng, _DRAWS)
    return float(np.quantile(np.abs(drawn - value), COVERAGE))


def _mean_axis(fits: Sequence[SwingFit]) -> Vector:
    first = np.array(fits[0].axis)
    axes = np.array([fit.axis for fit in fits])
    mean = np.sum(axes * np.sign(axes @ first)[:, None], axis=0)
    x, y, z = (float(part) for part in mean / np.linalg.norm(mean))
    return x, y, z
