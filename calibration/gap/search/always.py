"""What is fitted whatever is missing, for nobody knows it: it is an effect only beyond that doubt."""

import numpy as np

from calibration.gap.estimate.acceptance import DETECTABLE
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.motor_laws import LAWS
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.estimate.unstated import AXES

LOG_TIMING = Variable("command_delay", "delay")
"""When a command was logged is never known to the millisecond, and a delay left out makes other names."""

MADE_SCALE = Variable("thrust_scale", "scale")
"""Where no voltage was logged: one made for the vehicle file carries no other model. It is no effect."""

_MOST = 0.5
"""Share of a law from which on it is that of the rotors."""

_WHOLE = 1.25
"""Share of a law beyond which they follow by another one, which differs in the same sense: of laws that were
flown, strangers' flights told up to 1.18."""


def always_fitted(training: Training) -> tuple[Variable, ...]:
    """What these flights leave unknown."""
    made = not any(record.voltage_measured for record in training.records)
    return (LOG_TIMING, MADE_SCALE) if made else (LOG_TIMING,)


def late_by_more_than_the_log(model: Model, training: Training) -> bool:
    """Whether commands reach the motors later than half an interval of the log: nobody knows better when a
    line was written."""
    return model.start_value(LOG_TIMING) > 0.5 * training.regression.signals.dt


def law_in_words(final: Fitted) -> list[str]:
    """Which law the rotors follow, where the flights tell that it is another than the model's."""
    laws = slice(len(final.variables) + AXES, final.first_unnamed)
    shares = final.estimate.fit.theta[laws]
    errors = np.sqrt(np.diag(final.estimate.fit.covariance))[laws]
    return [
        f"{law} ({_size(share, error)}), and no thrust of first order: the vehicle file has it from a "
        "tachometer alone (`perchhw calibrate tachometer`); it was fitted beside names"
        for law, share, error in zip(LAWS, shares, errors, strict=False)
        if share > max(_MOST, DETECTABLE * error)
    ]


def _size(share: float, error: float) -> str:
    if share > _WHOLE:
        return f"or by a law that differs {share:.1f} times as much: their lag may be another too"
    return f"{share:.0%} +- {error:.0%} of what that changes"
