"""By how much a voltage follows its current: a cell that polarises, or a filter before the log.

The resistance of a vehicle file acts at once. Where the voltage follows in first order,

    V = E(charge) - R y,   lag dy/dt = I - y,

quick changes of current say too little of R by a factor, and a resistance that the file lacks goes unseen.
Lag and resistance are found together: of each lag that is tried the most likely resistance is taken, and of
these the most likely lag (a profile of the likelihood by prediction errors; Ljung, System Identification, 2nd
ed. 1999, section 7.4). The voltage alone decides, and nothing else depends on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import VOLTAGE, stack_signals
from calibration.gap.estimate.acceptance import DETECTABLE, LEAST_GAIN
from calibration.gap.estimate.mixed import FIRST_SPREAD, Prior
from calibration.gap.estimate.model import Model, Variable, terminal_voltage
from calibration.gap.estimate.refine import refine, training_set
from calibration.gap.estimate.regression import Noise, Regression
from calibration.gap.replay.teacher_forcing import Prediction
from onboard.arrays import FloatArray

_RESISTANCE = Variable("battery_sag", "resistance")

_LATE = (Variable("motor_lag", "scale"), Variable("command_delay", "delay"))
"""What makes thrusts late, and with them the current: forces and torques tell it."""

_TRIED = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
"""s, between which a lag is sought: up to where it is hardly told from a pack that empties."""

_NEAR = 0.01
"""Of its logarithm: a lag this well found is found."""

_STEPS = 3
"""Times that resistance and noise are fitted in turn."""

_RESOLVED = 1e-4
"""V: no battery is read more finely, and a voltage without noise does not show how it follows."""


def voltage_lag(records: Sequence[FlightRecord], model: Model) -> float:
    """Lag (s) with which logged voltages follow the current that motors draw; 0 where none is beyond chance.

    Motors that are slower than their file make the current late, too: where the voltage is, they are fitted,
    and it is held against the current that they draw. A lag within that of the motors is none.

    Args:
        records: flights.
        model: of the vehicle.
    """
    measured = [one for one in records if one.voltage is not None and one.voltage_measured]
    if not measured or _likeliest(measured, model) == 0.0:
        return 0.0
    fitted = refine(model, _LATE, training_set(measured, model)).model
    lag = _likeliest(measured, fitted)
    return lag if lag > _rotors_follow_in(fitted) else 0.0


def _rotors_follow_in(model: Model) -> float:
    """Time constant (s) of the rotors, of spinning up and down in the mean.

    A current in proportion to thrust is that of rotors which turn steadily; what they draw while they spin up
    is more, and less while they slow down, so that within this time no voltage is late against it. Thirteen
    real flights showed 0.046 s, with which five others were predicted to 9.0 cm in place of 5.9.
    """
    p = model.parameters()
    return 0.5 * float(p["time_constant_up"] + p["time_constant_down"])


def _likeliest(records: Sequence[FlightRecord], model: Model) -> float:
    """Lag (s) of voltages, which all flights have, to the current of a model; 0 as :func:`voltage_lag`."""
    voltages = _voltages(records, model)
    at_once = voltages.fit_at(0.0)
    if voltages.fit_at(_TRIED[0]).likelihood <= at_once.likelihood:
        return 0.0
    best = int(np.argmax([voltages.fit_at(lag).likelihood for lag in _TRIED]))
    low, high = _TRIED[max(best - 1, 0)], _TRIED[min(best + 1, len(_TRIED) - 1)]
    found = minimize_scalar(
        lambda logarithm: -voltages.fit_at(float(np.exp(logarithm))).likelihood,
        bounds=(np.log(low), np.log(high)),
        method="bounded",
        options={"xatol": _NEAR},
    )
    lag = float(np.exp(found.x))
    fit = voltages.fit_at(lag)
    beyond_chance = fit.likelihood - at_once.likelihood >= LEAST_GAIN
    return lag if beyond_chance and fit.resistance > DETECTABLE * fit.error else 0.0


class _FitAtLag(NamedTuple):
    """The voltages fitted with one lag.

    Attributes:
        likelihood: log-likelihood, less what does not depend on the lag.
        resistance: ohm, whole, the most likely.
        error: ohm, of it.
    """

    likelihood: float
    resistance: float
    error: float


@dataclass(frozen=True)
class _Voltages:
    """Measured voltages of some flights, and what a model says of them.

    Attributes:
        records: the flights.
        model: of the vehicle.
        predictions: by the model, one per flight.
        regression: in which nothing but voltages is valid.
    """

    records: Sequence[FlightRecord]
    model: Model
    predictions: Sequence[Prediction]
    regression: Regression

    def fit_at(self, lag: float) -> _FitAtLag:
        """The most likely resistance where they follow with this lag (s), and how likely both are."""
        late = [replace(record, voltage_lag=lag) for record in self.records]
        p, pairs = self.model.parameters(), list(zip(late, self.predictions, strict=True))
        predicted = self._column([terminal_voltage(p, *pair) for pair in pairs])
        per_ohm = self._column([-one.late_voltage(drawn.current) for one, drawn in pairs])
        rule = self.model.rule(_RESISTANCE)
        prior = Prior.independent(np.zeros(1), np.array([(rule.high - rule.low) ** -2.0]))
        spread = FIRST_SPREAD
        noise: Noise | None = None
        for _ in range(_STEPS):
            estimate = self.regression.estimate(predicted, [per_ohm], prior, spread, noise)
            spread, noise = estimate.fit.spread, self.regression.fit_noise(estimate.residual)
        assert noise is not None
        rows = int(self.regression.whole[:, VOLTAGE].sum())
        return _FitAtLag(
            likelihood=-rows * float(np.log(max(noise.sigma[VOLTAGE], _RESOLVED))),
            resistance=float(p["battery_resistance"] + estimate.fit.theta[0]),
            error=float(np.sqrt(estimate.fit.covariance[0, 0])),
        )

    def _column(self, voltages: Sequence[FloatArray]) -> FloatArray:
        column = np.zeros(self.regression.signals.measured.shape, order="F")
        column[:, VOLTAGE] = np.concatenate(voltages)
        return column


def _voltages(records: Sequence[FlightRecord], model: Model) -> _Voltages:
    # Every lag is judged by the same rows: those at which the longest has settled.
    signals = stack_signals([replace(record, voltage_lag=_TRIED[-1]) for record in records])
    valid = np.zeros_like(signals.valid)
    valid[:, VOLTAGE] = signals.valid[:, VOLTAGE]
    measured = np.where(valid, signals.measured, 0.0)
    alone = replace(signals, measured=measured, valid=valid)
    weights = np.ones((alone.part_bounds.size - 1, measured.shape[1]))
    return _Voltages(records, model, model.along(records, model.parameters()), Regression(alone, weights))
