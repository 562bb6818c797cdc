"""A vehicle with an effect that may be there, and the signals that it would show along a flight."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import VOLTAGE
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.search.candidates import candidates
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.manoeuvres.course import RATE
from onboard.vehicle import EFFECTS, Vehicle

SETTLED = slice(RATE, None)
"""Rows that count: motors take a while to settle from where a prediction begins."""


@dataclass(frozen=True)
class Hypothesis:
    """An effect with the values of its parameters."""

    effect: str
    values: Mapping[str, float]

    @classmethod
    def typical(cls, effect: str) -> "Hypothesis":
        """The effect as an ordinary vehicle may have it."""
        values = {name: p.typical for name, p in EFFECTS[effect].parameters.items()}
        if effect == "motor_imbalance":
            # One weak motor: four alike are no imbalance.
            values = {**cls.neutral(effect).values, "m1": values["m1"]}
        return cls(effect, values)

    @classmethod
    def neutral(cls, effect: str) -> "Hypothesis":
        """The effect that does nothing, from where a fit starts; typical where nothing is neutral.

        An infinite neutral value is one that has no derivative: typical, too.
        """
        values = {}
        for name, p in EFFECTS[effect].parameters.items():
            plain = p.neutral is not None and math.isfinite(p.neutral)
            values[name] = float(p.neutral) if plain and p.neutral is not None else p.typical
        return cls(effect, values)

    def on(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle with this effect, instead of what its file may say of it."""
        return Model(vehicle, {Variable(self.effect, name): x for name, x in self.values.items()}).vehicle()


def predicted(record: FlightRecord, vehicle: Vehicle) -> FloatArray:
    """Signals of a vehicle along a flight, shape (n, 13).

    Force and torque against the model (3 + 3), voltage, then force and rate of the IMU against those of
    motion capture (3 + 3). As in the gap finder, the voltage depends on the battery alone; it is given
    against that of the file. The first second is left out (:data:`SETTLED`).
    """
    signals = Model(only(vehicle, lambda name: name not in SENSING), ceiling_z=record.ceiling_z).predict(
        [record]
    )
    sagging = only(vehicle, lambda name: name == "battery_sag")
    signals[:, VOLTAGE] = 0.0
    if sagging.effects:
        plain = only(vehicle, lambda name: False)
        signals[:, VOLTAGE] = (Model(sagging).predict([record]) - Model(plain).predict([record]))[:, VOLTAGE]
    return np.hstack((signals, imu_against_pose(record, vehicle)))[SETTLED]


def only(vehicle: Vehicle, wanted: Callable[[str], bool]) -> Vehicle:
    """The vehicle with the effects whose names are wanted."""
    return dataclasses.replace(vehicle, effects=tuple(e for e in vehicle.effects if wanted(e.name)))


def starts(effect: str, vehicle: Vehicle, record: FlightRecord) -> list[Hypothesis]:
    """Where a fit begins: where the gap finder would begin, which knows effects without a derivative."""
    model = Model(vehicle, ceiling_z=record.ceiling_z)
    found = [candidate for candidate in candidates(model, [record]) if candidate.effect == effect]
    if not found:
        return [Hypothesis.neutral(effect)]
    return [
        Hypothesis(effect, {v.parameter: start.start_value(v) for v in found[0].variables})
        for start in found[0].starts
    ]


SENSING = frozenset({"pose_delay", "pose_rotation", "pose_offset", "gyro_bias"})
"""Effects that show in the IMU against motion capture."""


def imu_against_pose(record: FlightRecord, vehicle: Vehicle) -> FloatArray:
    """Specific force (m/s2) and rate (rad/s) that the IMU shows beyond those of motion capture, shape (n, 6).

    Zero for a vehicle without effects of sensing.
    """
    values = {effect.name: effect.values() for effect in vehicle.effects if effect.name in SENSING}
    if not values:
        return np.zeros((record.t.size, 6))
    delay = values.get("pose_delay", {}).get("delay", 0.0)
    turn, offset, bias = (
        np.array([values.get(name, {}).get(axis, 0.0) for axis in "xyz"])
        for name in ("pose_rotation", "pose_offset", "gyro_bias")
    )
    true = _imu_of_pose(record, 0.0, np.zeros(3), np.zeros(3))
    difference = true - _imu_of_pose(record, delay, turn, offset)
    difference[:, 3:] += bias
    return difference


def _imu_of_pose(record: FlightRecord, delay: float, turn: FloatArray, offset: FloatArray) -> FloatArray:
    """Specific force and rate of a pose that is `delay` s old, turned (rad) and shifted (m), shape (n, 6)."""
    t, dt = record.t, record.dt
    position = np.column_stack([np.interp(t - delay, t, record.position[:, i]) for i in range(3)])
    late = np.column_stack([np.interp(t - delay, t, record.attitude[:, i]) for i in range(4)])
    attitude = Rotation.from_quat(late)
    position = position + attitude.apply(offset)
    # As the description says, q_seen = q exp(turn / 2): a rotation vector of `turn`.
    seen = attitude * Rotation.from_rotvec(turn)
    acceleration = np.gradient(np.gradient(position, dt, axis=0), dt, axis=0)
    force = seen.apply(acceleration + np.array([0.0, 0.0, GRAVITY]), inverse=True)
    step = (seen[:-1].inv() * seen[1:]).as_rotvec() / dt
    rate = np.vstack((step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]))
    return np.hstack((force, rate))
