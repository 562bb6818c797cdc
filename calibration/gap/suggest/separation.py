"""How well a flight tells two effects apart: the log-likelihood that the wrong one would lose.

The flight is simulated with effect A. Then effect B explains it as well as it can: its parameters and the
nuisances are refitted by linearised least squares on the predicted signals. What is left, in units of the
noise, is the expected log-likelihood ratio.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import stack_signals
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.nuisances import NUISANCES, nuisance_columns
from calibration.gap.suggest.hypothesis import SETTLED, Hypothesis, only, predicted, starts
from calibration.gap.suggest.simulate import fly_course
from calibration.gap.suggest.spectra import noise_spectra, weighed
from onboard.arrays import FloatArray
from onboard.manoeuvres import Course
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Vehicle

_ROUNDS = 3
"""Of the linearised fit: bounds and curvature need more than one."""

_SHARE_OF_TYPICAL = 0.02
_FILED_STEP = 1e-3
_LEAST_SIGMA = 1e-3


@dataclass(frozen=True)
class Separation:
    """What a flight is expected to tell.

    Attributes:
        log_likelihood_ratio: of the whole flight, for the true effect against the best of the other.
    """

    log_likelihood_ratio: float
    seconds: float

    @property
    def per_second(self) -> float:
        """Expected log-likelihood ratio of a second of flight."""
        return self.log_likelihood_ratio / self.seconds


def separation(
    vehicle: Vehicle, true: Hypothesis, other: str, course: Course, room: RoomGeometry, seed: int
) -> Separation:
    """How much worse another effect explains a flight of the true one; nothing where it cannot be flown.

    `vehicle` has the effects that are certain; the flight is simulated with the `true` one, `seed` is of its
    disturbances.
    """
    base = only(vehicle, lambda name: name not in (true.effect, other))
    flown = true.on(base)
    record = fly_course(flown, course, room, np.random.default_rng(seed), "suggested")
    if record is None:
        return Separation(0.0, course.duration)
    target = predicted(record, flown)
    spectra = noise_spectra(len(target), record.dt)
    columns, sigma = _nuisances(record, base, {true.effect, other}, spectra)
    trial = _Trial(record, base, target, spectra, columns, sigma)
    left = min(trial.left_by(start) for start in starts(other, base, record))
    return Separation(0.5 * left, course.duration)


@dataclass(frozen=True)
class _Trial:
    """A simulated flight that another effect has to explain.

    Attributes:
        record: the flight. vehicle: without the effect.
        target: signals of the true effect, shape (n, 13).
        spectra: of the noise.
        nuisances: weighed columns, those of this flight first, shape (m, k).
        sigma: their standard deviations, shape (k,).
    """

    record: FlightRecord
    vehicle: Vehicle
    target: FloatArray
    spectra: FloatArray
    nuisances: FloatArray
    sigma: FloatArray

    def left_by(self, start: Hypothesis) -> float:
        """Twice the log-likelihood ratio that is left when the effect and the nuisances are fitted."""
        now, best = start, math.inf
        for round_ in range(_ROUNDS + 1):
            model = predicted(self.record, now.on(self.vehicle))
            residual = weighed(self.target - model, self.spectra)
            best = min(best, self._fit(self.nuisances, residual)[1])
            if round_ < _ROUNDS:
                slopes = [self._slope(now, name, model) for name in now.values]
                step, _ = self._fit(np.column_stack((*slopes, self.nuisances)), residual)
                changes = zip(now.values.items(), step.tolist(), strict=False)  # nuisances follow
                moved = {name: _bounded(now.effect, name, x + change) for (name, x), change in changes}
                now = Hypothesis(now.effect, moved)
        return best

    def _slope(self, at: Hypothesis, name: str, model: FloatArray) -> FloatArray:
        """Derivative of the weighed signals by one parameter, towards the middle of its bounds."""
        rule = EFFECTS[at.effect].parameters[name]
        value = at.values[name]
        size = abs(rule.typical - (rule.neutral or 0.0)) or rule.practical_minimum
        step = _SHARE_OF_TYPICAL * min(size, 0.5 * (rule.high - rule.low))
        if value + step > rule.high:
            step = -step
        there = Hypothesis(at.effect, {**at.values, name: value + step})
        return weighed((predicted(self.record, there.on(self.vehicle)) - model) / step, self.spectra)

    def _fit(self, columns: FloatArray, residual: FloatArray) -> tuple[FloatArray, float]:
        """Least squares with the priors of the nuisances, which are the last columns.

        Returns:
            The solution, and what is left: of the data, and of the nuisances that each flight draws anew.
        """
        free = columns.shape[1] - self.sigma.size
        products = columns.T @ columns
        weak = 1e-12 * np.maximum(np.diag(products)[:free], 1e-12)
        precision = np.concatenate((weak, self.sigma**-2.0))
        solution: FloatArray = np.asarray(
            np.linalg.solve(products + np.diag(precision), columns.T @ residual), dtype=np.float64
        )
        left = residual - columns @ solution
        of_flight = slice(free, free + len(NUISANCES))
        drawn = float(np.sum(solution[of_flight] ** 2 * precision[of_flight]))
        return solution, float(left @ left) + drawn


def _bounded(effect: str, name: str, value: float) -> float:
    rule = EFFECTS[effect].parameters[name]
    return float(np.clip(value, rule.low, rule.high))


def _nuisances(
    record: FlightRecord, vehicle: Vehicle, pair: set[str], spectra: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Weighed columns of what may differ besides, shape (m, k), and their standard deviations (k,).

    Those of each flight, as the gap finder has them; and mass and inertia within the sigma of the vehicle
    file, unless the question is about them. What these cost is no merit of the flight.
    """
    per_flight = nuisance_columns(stack_signals([record]), Model(vehicle).predict([record]))
    columns = [weighed(np.pad(column, ((0, 0), (0, 6)))[SETTLED], spectra) for column in per_flight]
    sigma = [nuisance.first for nuisance in NUISANCES]
    flown = predicted(record, vehicle)
    for effect, parameter, spread in _filed(vehicle):
        if effect in pair:
            continue
        neutral = Hypothesis.neutral(effect).values
        changed = Hypothesis(effect, {**neutral, parameter: _FILED_STEP}).on(vehicle)
        columns.append(weighed((predicted(record, changed) - flown) / _FILED_STEP, spectra))
        sigma.append(spread)
    return np.column_stack(columns), np.array(sigma)


def _filed(vehicle: Vehicle) -> Sequence[tuple[str, str, float]]:
    """Effect, parameter and relative standard deviation of mass and inertia in the vehicle file."""
    body = vehicle.body
    of = (
        ("mass_error", "relative", body.mass),
        ("inertia_error", "xx", body.inertia_xx),
        ("inertia_error", "yy", body.inertia_yy),
        ("inertia_error", "zz", body.inertia_zz),
    )
    return [(effect, name, max(q.sigma / q.value, _LEAST_SIGMA)) for effect, name, q in of]
