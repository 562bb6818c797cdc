"""What wizards find fits into a vehicle file, whatever the motor is like."""

from pathlib import Path

import numpy as np
import pytest

from calibration.bench.motors.analysis import analyse
from calibration.bench.motors.clock import ClockFit
from calibration.bench.motors.propellers import propeller
from calibration.bench.motors.records import WindowRecord
from calibration.bench.procedures.apply import changed_vehicle, write_applied
from calibration.bench.procedures.calibration import write_calibration
from calibration.bench.procedures.conclude import motor_calibration
from calibration.bench.procedures.motors import MotorFits
from calibration.measurement import Estimate
from onboard.vehicle import load_vehicle


def first_order_steps(tau: float) -> WindowRecord:
    """A motor whose speed follows exponentially: its law has no square in it."""
    ends = np.arange(1, 4001) * 0.01
    target = np.where((ends // 2.5).astype(int) % 2 == 0, 800.0, 2000.0)
    speed = np.empty(ends.size)
    speed[0] = 800.0
    for k in range(1, ends.size):
        speed[k] = target[k] + (speed[k - 1] - target[k]) * np.exp(-0.01 / tau)
    return WindowRecord(ends, speed)


def test_a_motor_without_a_square_in_its_law_is_applied(tmp_path: Path) -> None:
    tau = 0.04
    clock = ClockFit(Estimate(1.0, "1", 1e-5), 60.0)
    result = analyse([first_order_steps(tau)], propeller("bitcraze-2015"), 0.09, 2, clock)
    fits = MotorFits({1: result}, 0.0, [])
    written = write_calibration(motor_calibration(fits, "2026-11-22T00:00:00+00:00", {}), tmp_path)
    file = tmp_path / "drone.toml"
    write_applied(changed_vehicle(load_vehicle("crazyflie21-upgraded-stored"), [written]), file)
    (law,) = load_vehicle(file).effects
    assert law.parameters["a_up"].value == pytest.approx(1.0 / tau, rel=0.15)
