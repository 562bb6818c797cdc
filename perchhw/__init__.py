"""Land a Crazyflie upside down on a ceiling: learn, upload, fly, record, measure.

What a notebook or a script lives on is here; every name is imported when it is first used:

>>> import perchhw
>>> vehicle = perchhw.load_vehicle("crazyflie21-upgraded")
>>> policy = perchhw.load_policy("default")
>>> flight = perchhw.simulate_approach(policy, speed=2.5, angle_deg=50.0, seed=3)
>>> flight.trigger is not None
True
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from calibration.flights import open_flight as open_flight
    from onboard.policy.files import save_policy as save_policy
    from onboard.vehicle import load_vehicle as load_vehicle
    from perchhw.attempt import AttemptRequest as AttemptRequest
    from perchhw.flight import fly_attempt as fly_attempt
    from perchhw.lab_process import SimulatedLab as SimulatedLab
    from perchhw.learning.setup import LearningSetup as LearningSetup
    from perchhw.notebook import find_gap as find_gap
    from perchhw.notebook import fly as fly
    from perchhw.notebook import fly_campaign as fly_campaign
    from perchhw.notebook import label_flight as label_flight
    from perchhw.notebook import load_policy as load_policy
    from perchhw.notebook import open_flights as open_flights
    from perchhw.notebook import simulate_approach as simulate_approach
    from perchhw.notebook import sweep as sweep
    from perchhw.notebook import train as train
    from perchhw.record import read_run as read_run

_HOMES = {
    "AttemptRequest": "perchhw.attempt",
    "LearningSetup": "perchhw.learning.setup",
    "SimulatedLab": "perchhw.lab_process",
    "find_gap": "perchhw.notebook",
    "fly": "perchhw.notebook",
    "fly_attempt": "perchhw.flight",
    "fly_campaign": "perchhw.notebook",
    "label_flight": "perchhw.notebook",
    "load_policy": "perchhw.notebook",
    "load_vehicle": "onboard.vehicle",
    "open_flight": "calibration.flights",
    "open_flights": "perchhw.notebook",
    "read_run": "perchhw.record",
    "save_policy": "onboard.policy.files",
    "simulate_approach": "perchhw.notebook",
    "sweep": "perchhw.notebook",
    "train": "perchhw.notebook",
}
"""Where each name lives: a command must not import what it does not use."""

__all__ = ["__version__", *sorted(_HOMES)]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("perchhw")
    if name not in _HOMES:
        raise AttributeError(f"module 'perchhw' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
