"""What is fitted whatever is missing, for nobody knows it: it is an effect only beyond that doubt."""

from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Training

LOG_TIMING = Variable("command_delay", "delay")
"""When a command was logged is never known to the millisecond, and a delay left out makes other names."""

MADE_SCALE = Variable("thrust_scale", "scale")
"""Where no voltage was logged: one made for the vehicle file carries no other model. It is no effect."""


def always_fitted(training: Training) -> tuple[Variable, ...]:
    """What these flights leave unknown."""
    made = not any(record.voltage_measured for record in training.records)
    return (LOG_TIMING, MADE_SCALE) if made else (LOG_TIMING,)


def late_by_more_than_the_log(model: Model, training: Training) -> bool:
    """Whether commands reach the motors later than half an interval of the log: nobody knows better when a
    line was written."""
    return model.start_value(LOG_TIMING) > 0.5 * training.regression.signals.dt
