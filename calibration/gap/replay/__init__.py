"""How well a model predicts measured flights: by the simulation's own physics along the measured inputs."""

from calibration.gap.replay.closed_loop import fly_again
from calibration.gap.replay.evaluation import PredictionError, PredictionErrors, evaluate

__all__ = ["PredictionError", "PredictionErrors", "evaluate", "fly_again"]
