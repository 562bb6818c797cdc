"""How well a model predicts measured flights: by the simulation's own physics along the measured inputs."""

from calibration.gap.prediction.closed_loop import ClosedLoopFlight, fly_again
from calibration.gap.prediction.evaluation import (
    HORIZONS,
    BothWays,
    ErrorPair,
    FlightErrors,
    PredictionError,
    PredictionErrors,
    Unpredicted,
    evaluate,
)
from calibration.gap.prediction.nuisances import Nuisances
from calibration.gap.prediction.window_errors import ByHorizon, HorizonErrors, WindowErrors

__all__ = [
    "HORIZONS",
    "BothWays",
    "ByHorizon",
    "ClosedLoopFlight",
    "ErrorPair",
    "FlightErrors",
    "HorizonErrors",
    "Nuisances",
    "PredictionError",
    "PredictionErrors",
    "Unpredicted",
    "WindowErrors",
    "evaluate",
    "fly_again",
]
