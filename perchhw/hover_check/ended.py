"""What a check that a safety rule ended still tells: a battery that does not reach the hover."""

from pathlib import Path

import numpy as np

from calibration.measurement import Estimate
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle, load_vehicle
from perchhw.hover_check.expected import expected
from perchhw.hover_check.history import History
from perchhw.hover_check.judge import CheckedQuantity, judge
from perchhw.hover_check.thrust import thrusts_of
from perchhw.hover_check.windows import MOTORS
from perchhw.lab.setup import FlightSetup
from perchhw.record import RunRecord, read_run

LAG = 0.1
"""Relative standard uncertainty: commands are followed late by 0.05 to 0.15 s, and the voltage at once."""
_LEAST_ROWS = 20


def examine_ended(record: Path, setup: FlightSetup, out: Path) -> tuple[CheckedQuantity, ...]:
    """The battery's line of a check that came to no end, held against file and days; nothing is kept."""
    vehicle = load_vehicle(setup.vehicle, setup.legs)
    resistance = resistance_aloft(read_run(record), vehicle)
    if resistance is None:
        return ()
    before = History.of(out, setup.drone, setup.mocap, vehicle).before()
    measured = {"battery_resistance": resistance}
    return judge(measured, expected(vehicle), [one.values for one in before])


def resistance_aloft(run: RunRecord, vehicle: Vehicle) -> Estimate | None:
    """Median of the voltage's fall over the current, wherever the commands ask for a quarter of the weight.

    Returns:
        ohm; None where the motors never turned so much for 0.2 s.
    """
    motors, power = run.series.get("motors"), run.series.get("power")
    armed = next((float(e["t"]) for e in run.events if e.get("phase") == "arming"), None)
    if motors is None or power is None or armed is None or len(power.t) < _LEAST_ROWS:
        return None
    commands = np.column_stack([motors.numbers(name) for name in MOTORS])
    rows = (motors.t > armed) & np.isfinite(commands).all(axis=1)
    volts = np.interp(motors.t[rows], power.t, power.numbers("vbat"))
    thrust_map = vehicle.motors.thrust_map_compiled()
    thrusts = thrusts_of(thrust_map, commands[rows], volts, round(vehicle.motors.pwm_bits.value)).sum(axis=1)
    turning = thrusts > 0.25 * vehicle.body.mass.value * GRAVITY
    if turning.sum() < _LEAST_ROWS:
        return None
    rest = float(power.numbers("vbat")[power.t < armed].mean())
    current = vehicle.battery.motor_current_per_newton.value * thrusts[turning]
    value = float(np.median((rest - volts[turning]) / current))
    return Estimate(value, "ohm", LAG * abs(value))
