"""Measure the drone on the simulated bench with the wizards, and apply what they say."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE
from calibration.bench.motors.propellers import PropellerMap
from calibration.bench.procedures.apply import changed_vehicle, write_applied
from calibration.bench.procedures.assistant import Assistant
from calibration.bench.procedures.calibration import load_calibration
from calibration.bench.procedures.compare import compare_with_vehicle
from calibration.bench.procedures.inertia import InertiaPlan
from calibration.bench.procedures.motors import MotorPlan
from calibration.bench.procedures.sessions import (
    Concluded,
    Stand,
    measure_inertia,
    measure_motors,
    measure_thrust,
)
from calibration.bench.procedures.thrust import ThrustPlan
from onboard.json_file import as_json
from onboard.vehicle import Vehicle, load_vehicle
from perchhw.errors import FlightStackError
from perchhw.lab_process import SimulatedLab
from perchhw.walkthrough.bench.story import BELIEVED

PACE = 8.0
"""Bench seconds in a second: most of a calibration is waiting for swings to die down."""
MOTOR_PACE = 1.0
"""A clock can be compared with another only where time is nobody's invention."""

Say = Callable[[str], None]


def measure_on_bench(folder: Path, true: Path, seed: int, say: Say) -> dict[str, Any]:
    """All three wizards on the drone `true`; goes on where an earlier call stopped.

    Returns:
        ``runs`` (folders) and ``vehicle``, the file with all three calibrations applied.

    Raises:
        FlightStackError: a calibration was rejected by its own checks.
    """
    believed = load_vehicle(BELIEVED)
    runs = {
        "bifilar": _run(folder / "bifilar", true, seed, PACE, say, _inertia(believed)),
        "tachometer": _run(folder / "tachometer", true, seed, MOTOR_PACE, say, _motors(believed)),
        "thrust": _run(folder / "thrust", true, seed, PACE, say, _thrust(believed)),
    }
    calibrations = [load_calibration(run) for run in runs.values()]
    vehicle = folder / "vehicle.toml"
    write_applied(changed_vehicle(believed, calibrations), vehicle)
    return {"runs": {kind: str(run) for kind, run in runs.items()}, "vehicle": str(vehicle)}


Wizard = Callable[[SimulatedLab, Path, Assistant], Concluded]


def _run(folder: Path, true: Path, seed: int, pace: float, say: Say, wizard: Wizard) -> Path:
    arguments = ["--drone-port", "0", "--vehicle", str(true), "--seed", str(seed), "--pace", str(pace)]
    with SimulatedLab("bench", arguments) as bench:
        assistant = Assistant(bench.ready["bench"]["hands"], say, [UNLOCK_PHRASE])
        with assistant:
            concluded = wizard(bench, folder, assistant)
    if rejections := concluded.calibration.rejections:
        raise FlightStackError(f"{folder}: the calibration was rejected: {'; '.join(rejections)}")
    return folder


def _inertia(believed: Vehicle) -> Wizard:
    return lambda bench, folder, assistant: measure_inertia(
        InertiaPlan(believed), bench.drones[0], folder, assistant, {"operator": "walk-through"}
    )


def _motors(believed: Vehicle) -> Wizard:
    coefficient = believed.motors.thrust_coefficient
    if coefficient is None:
        raise FlightStackError(f"{believed.name}: no motors.thrust_coefficient, so no thrust from a speed")
    propeller = PropellerMap("vehicle", 0.0, 0.0, coefficient.value, coefficient.source)

    def wizard(bench: SimulatedLab, folder: Path, assistant: Assistant) -> Concluded:
        ports = bench.ready["bench"]
        stand = Stand(bench.drones[0], ports["tachometer"], ports["supply"], 3.9)
        plan = MotorPlan(believed, propeller)
        return measure_motors(plan, stand, folder, assistant, {"operator": "walk-through"})

    return wizard


def _thrust(believed: Vehicle) -> Wizard:
    def wizard(bench: SimulatedLab, folder: Path, assistant: Assistant) -> Concluded:
        ports = bench.ready["bench"]
        plan = ThrustPlan(believed)
        stand = Stand(bench.drones[0], ports["scale"], ports["supply"], plan.voltages[0])
        return measure_thrust(plan, stand, folder, assistant, {"operator": "walk-through"})

    return wizard


def against_truth(true: Vehicle, runs: dict[str, str]) -> list[dict[str, Any]]:
    """Each measured quantity beside the truth: E_n above 1 would be a wrong interval."""
    return [
        as_json(row)
        for run in runs.values()
        for row in compare_with_vehicle(true, load_calibration(Path(run)))
    ]
