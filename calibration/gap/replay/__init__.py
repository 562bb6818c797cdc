"""How well a model predicts measured flights: by the simulation's own physics along the measured inputs."""

from calibration.gap.replay.closed_loop import ClosedLoopFlight, fly_again
from calibration.gap.replay.evaluation import (
    HORIZONS,
    BothWays,
    ErrorPair,
    FlightErrors,
    PredictionError,
    PredictionErrors,
    Unpredicted,
    evaluate,
)
from calibration.gap.replay.nuisances import Nuisances
from calibration.gap.replay.window_errors import ByHorizon, HorizonErrors, WindowErrors

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
