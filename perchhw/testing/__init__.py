"""What the pytest plugin gives to tests: a lab of simulated Crazyflies, their faults, the truth."""

from perchhw.testing.lab import Lab, LabWaitTimeout, SimulatedDrone
from perchhw.testing.stage import StageFailed, StageProcess
from perchhw.testing.values import LabInputError

__all__ = ["Lab", "LabInputError", "LabWaitTimeout", "SimulatedDrone", "StageFailed", "StageProcess"]
