"""A vehicle with an effect that may be there, and the signals that it would show along a flight."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import VOLTAGE
from calibration.gap.estimate.model import Model
from calibration.gap.search.candidates import candidates
from calibration.gap.suggest.imu_signals import SENSING, imu_against_pose
from onboard.arrays import FloatArray
from onboard.manoeuvres.course import RATE
from onboard.quantity import Quantity
from onboard.vehicle import EFFECTS, Effect, Vehicle

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
        rules = EFFECTS[self.effect].parameters
        effect = Effect(
            name=self.effect,
            parameters={
                name: Quantity(value, rules[name].unit, 0.0, "hypothesis")
                for name, value in self.values.items()
            },
        )
        others = tuple(e for e in vehicle.effects if e.name != self.effect)
        return dataclasses.replace(vehicle, effects=(*others, effect))


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
