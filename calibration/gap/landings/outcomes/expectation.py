"""What a lab should expect of its next flights: simulated rates with the model's error as flights showed it.

The share of flights that really end on four legs follows from the simulated one by a straight line between
their logits, logit(real) = offset + slope logit(simulated). Flights of known outcome say how far both can be
from 0 and 1: a Bayesian logistic regression on a grid, with a prior that is as wide as the largest error that
this simulation is known to have made. The line only widens what is promised of flights to come; no score is
made from it. Intervals are judged on groups of flights that did not take part (:func:`coverage`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.special import expit, logit

from calibration.errors import CalibrationError
from calibration.gap.landings.outcomes.words import percent
from calibration.measurement import Interval, interval_of
from onboard.arrays import BoolArray, FloatArray
from onboard.errors import InputError

NEXT = 20
"""Flights that a count is promised for."""

LEVEL = 0.8
"""Of the interval of a count."""

_OFFSET, _SLOPE = 1.5, 0.5
"""Standard deviations of the prior about 0 and 1. The vehicle file in which every foot held said 0.81 where
0.39 did (docs/gap_landings.md): an offset of -1.9."""
_OFFSETS = np.linspace(-5.0, 5.0, 81)
_SLOPES = np.linspace(0.0, 2.5, 41)
_SAMPLES = 4000
_GROUP = 7
"""Flights that are predicted together when intervals are judged."""
_SPLITS = 20
LEAST_JUDGED = 16
"""Flights: fewer are not enough to say how often such intervals hold."""


class ModelErrorFileError(CalibrationError, InputError):
    """A document of ``gap landings`` does not say how wrong the model is."""


@dataclass(frozen=True)
class ModelError:
    """Offset and slope of the logit of real rates over simulated ones, normally distributed.

    Attributes:
        mean: (offset, slope). sigma: their standard deviations. correlation: of the two.
        flights: that say so.
    """

    mean: Interval
    sigma: Interval
    correlation: float
    flights: int

    def draws(self, rng: np.random.Generator) -> FloatArray:
        """(n, 2) offsets and slopes; no slope is negative."""
        mixed = self.correlation * self.sigma[0] * self.sigma[1]
        covariance = [[self.sigma[0] ** 2, mixed], [mixed, self.sigma[1] ** 2]]
        drawn = rng.multivariate_normal(self.mean, covariance, _SAMPLES)
        return np.maximum(drawn, (-np.inf, 0.0))

    def json_shape(self) -> dict[str, Any]:
        """As a JSON object."""
        return {
            "offset": {"value": self.mean[0], "sigma": self.sigma[0]},
            "slope": {"value": self.mean[1], "sigma": self.sigma[1]},
            "correlation": self.correlation,
            "flights": self.flights,
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any], vehicle_sha256: str, where: str) -> Self:
        """From a document ``perchhw.gap_landings/1``; `where` names it in errors.

        Such a document judges the vehicle that was given, and the one that was written where a search found
        something. The error of one is none of the other: it would be corrected twice.

        Args:
            document: its content. vehicle_sha256: whose error is wanted
                (:func:`onboard.vehicle.fingerprint.fingerprint`). where: names the document.

        Raises:
            ModelErrorFileError: it has none of this vehicle.
        """
        judged = [document, document.get("improved") or {}]
        own = [one for one in judged if one.get("vehicle_sha256") == vehicle_sha256]
        if not own:
            raise ModelErrorFileError(
                f"{where}: how wrong the simulation is was found with another vehicle "
                f"({document.get('vehicle', 'it does not say which')}) than the one that is given: give "
                "--vehicle and --legs as to gap landings, or the vehicle.toml that was written with this "
                "file; or run perchhw gap landings again, with this vehicle"
            )
        try:
            found = own[0]["expectation"]["model_error"]
            pairs = [found["offset"], found["slope"]]
            return cls(
                (float(pairs[0]["value"]), float(pairs[1]["value"])),
                (float(pairs[0]["sigma"]), float(pairs[1]["sigma"])),
                float(found["correlation"]),
                int(found["flights"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise ModelErrorFileError(
                f"{where}: has no expectation.model_error: give the landings.json of classified flights "
                "(perchhw gap landings --out)"
            ) from error


@dataclass(frozen=True)
class Expectation:
    """What is to be expected of flights.

    Attributes:
        four_leg_rate: real share, mean. ci95: of it.
        four_leg_count80: LEVEL interval of how many of `next_flights` such flights.
    """

    four_leg_rate: float
    ci95: Interval
    next_flights: int
    four_leg_count80: tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class JudgedExpectation(Expectation):
    """An expectation of flights like those that were judged, what it rests on, and how often its like held.

    Attributes:
        coverage80: share of groups of left-out flights whose count lies in its interval of LEVEL; None of
            fewer than LEAST_JUDGED flights.
        coverage80_of_simulated_rates: likewise of the simulated rates alone, taken as they are.
    """

    model_error: ModelError
    coverage80: float | None
    coverage80_of_simulated_rates: float | None

    @property
    def words(self) -> str:
        """For people."""
        (low, high), (least, most) = self.ci95, self.four_leg_count80
        promised = (
            f"to be expected of {NEXT} more flights like these: {least} to {most} on four legs (80 %), a "
            f"rate of {self.four_leg_rate:.2f} ({low:.2f} to {high:.2f})"
        )
        if self.coverage80 is None or self.coverage80_of_simulated_rates is None:
            return f"{promised}; fewer than {LEAST_JUDGED} flights cannot tell how often such intervals hold"
        return (
            f"{promised}; such intervals held the counts of left-out flights in {percent(self.coverage80)}, "
            f"those of the simulated rates alone in {percent(self.coverage80_of_simulated_rates)}"
        )


def judged_expectation(simulated: FloatArray, real: BoolArray, rng: np.random.Generator) -> JudgedExpectation:
    """What to expect of more flights like these, and how far to believe it.

    Args:
        simulated: probability (n,) of four legs. real: whether it happened (n,).
        rng: draws errors, counts and groups.
    """
    error = model_error(simulated, real)
    judged = len(real) >= LEAST_JUDGED
    inside, alone = coverage(simulated, real, rng) if judged else (None, None)
    return JudgedExpectation(
        **vars(expect(error, simulated, rng)),
        model_error=error,
        coverage80=inside,
        coverage80_of_simulated_rates=alone,
    )


def model_error(simulated: FloatArray, real: BoolArray) -> ModelError:
    """Posterior of offset and slope."""
    offset, slope = np.meshgrid(_OFFSETS, _SLOPES, indexing="ij")
    line = offset[..., None] + slope[..., None] * _logit(simulated)
    log = np.where(real, -np.logaddexp(0.0, -line), -np.logaddexp(0.0, line)).sum(axis=-1)
    log -= 0.5 * ((offset / _OFFSET) ** 2 + ((slope - 1.0) / _SLOPE) ** 2)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    means = [float((weight * value).sum()) for value in (offset, slope)]
    off = [offset - means[0], slope - means[1]]
    sigmas = [float(np.sqrt((weight * value**2).sum())) for value in off]
    mixed = float((weight * off[0] * off[1]).sum())
    return ModelError(
        (means[0], means[1]), (sigmas[0], sigmas[1]), mixed / (sigmas[0] * sigmas[1]), len(simulated)
    )


def expect(
    error: ModelError, simulated: FloatArray, rng: np.random.Generator, triggers: FloatArray | None = None
) -> Expectation:
    """What to expect where the simulation says `simulated`.

    Args:
        error: of the model. simulated: probability (n,) of four legs, of attempts that flip.
        rng: draws errors and counts.
        triggers: probability (n,) that an attempt flips; default: all do.
    """
    rates = _rates(error, simulated, rng) * (1.0 if triggers is None else triggers)
    mean = rates.mean(axis=1)
    return Expectation(float(mean.mean()), interval_of(mean), NEXT, _count(rng.binomial(NEXT, mean)))


def coverage(simulated: FloatArray, real: BoolArray, rng: np.random.Generator) -> tuple[float, float]:
    """Share of left-out groups whose number on four legs is inside: with the error of the others; without."""
    inside, alone, groups = 0, 0, 0
    parts = max(2, round(len(real) / _GROUP))
    for _ in range(_SPLITS):
        folds = rng.permutation(np.arange(len(real)) % parts)
        for fold in range(parts):
            own = folds == fold
            error = model_error(simulated[~own], real[~own])
            count = int(real[own].sum())
            rates = _rates(error, simulated[own], rng)
            low, high = _count((rng.random(rates.shape) < rates).sum(axis=1))
            inside += low <= count <= high
            low, high = _count((rng.random(rates.shape) < simulated[own]).sum(axis=1))
            alone += low <= count <= high
            groups += 1
    return inside / groups, alone / groups


def _rates(error: ModelError, simulated: FloatArray, rng: np.random.Generator) -> FloatArray:
    drawn = error.draws(rng)
    return np.asarray(expit(drawn[:, :1] + drawn[:, 1:] * _logit(simulated)))


def _logit(simulated: FloatArray) -> FloatArray:
    """Of a share that was simulated: none in some hundred is not impossible."""
    return np.asarray(logit(np.clip(simulated, 0.005, 0.995)))


def _count(counts: Any) -> tuple[int, int]:
    low, high = np.quantile(counts, [0.5 * (1.0 - LEVEL), 0.5 * (1.0 + LEVEL)], method="inverted_cdf")
    return int(low), int(high)
