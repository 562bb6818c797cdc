"""A vehicle with effects whose parameters are being searched for, and its predictions along flights."""

import dataclasses
import functools
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import CHANNELS, FORCE, KINDS, TORQUE, VOLTAGE
from calibration.gap.data.smoothing import as_poses_see
from calibration.gap.replay.inputs import NO_CEILING
from calibration.gap.replay.teacher_forcing import LONGEST_STEP, Prediction, teacher_forced
from onboard.arrays import FloatArray
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Effect, Vehicle
from onboard.vehicle.effects import EffectParameter, Size
from onboard.vehicle.unnamed import UnnamedCurve
from sim_backend.physics.parameters import physics_parameters

_BATTERY = "battery_sag"
"""The effect that a voltage decides about."""

LIFT_ONLY = ("thrust_curve", "motor_warming")
"""Effects of what a motor lifts at a voltage, which says nothing of what it draws."""

_FORCES, _TORQUES, _VOLTAGES = range(len(KINDS))

WORKERS = 2
"""Threads; the kernels let go of the interpreter."""

_SHARE_OF_RANGE = 1e-4

_DELAY = "command_delay"
"""Its response is a broken line that bends at every step of a prediction: a derivative to one side of a bend
asks for a step across it, that to the other side for one back, and no fit would ever arrive."""


class Variable(NamedTuple):
    """One parameter of one effect."""

    effect: str
    parameter: str


@dataclass(frozen=True)
class Model:
    """A vehicle file, and effects on top of it with the values they have at present.

    Attributes:
        base: the vehicle as it was given.
        values: by variable; those of one effect together make the effect.
        ceiling_z: m, height of the ceiling; None: not known, and no rotor feels one.
    """

    base: Vehicle
    values: Mapping[Variable, float] = field(default_factory=dict)
    ceiling_z: float | None = None

    def with_values(self, values: Mapping[Variable, float]) -> "Model":
        """The model with some values changed or added; each kept within its bounds."""
        bounded = {v: float(np.clip(x, self.rule(v).low, self.rule(v).high)) for v, x in values.items()}
        return dataclasses.replace(self, values={**self.values, **bounded})

    def rule(self, variable: Variable) -> EffectParameter:
        """What is known of a parameter of a vehicle of this size before any flight."""
        return _rule(variable, self.size)

    @cached_property
    def size(self) -> Size:
        """Magnitudes of the vehicle, with which the bounds of its effects grow."""
        return self.base.size

    def nothing_new(self, variable: Variable) -> float | None:
        """The value with which the vehicle is as its file says: of the file, else the neutral one, if any."""
        for effect in self.base.effects:
            if effect.name == variable.effect:
                return effect.values()[variable.parameter]
        return self.rule(variable).neutral

    def without_it(self, variable: Variable) -> float | None:
        """:meth:`nothing_new`, or else the value with which the whole effect is not there, if any."""
        rule, same = self.rule(variable), self.nothing_new(variable)
        return rule.absent if same is None else same

    def change(self, variable: Variable) -> float:
        """Distance of the present value from the one that does nothing new (from 0, where none does)."""
        return self.start_value(variable) - (self.nothing_new(variable) or 0.0)

    def without(self, effect: str) -> "Model":
        """The model without one effect (with what the vehicle file says of it)."""
        return self.without_values([v for v in self.values if v.effect == effect])

    def without_values(self, variables: Collection[Variable]) -> "Model":
        """The model without some values (with what the vehicle file says of them)."""
        return dataclasses.replace(self, values={v: x for v, x in self.values.items() if v not in variables})

    def with_curves(self, curves: Iterable[UnnamedCurve]) -> "Model":
        """The model of a vehicle with these curves, besides those that its file has."""
        return dataclasses.replace(self, base=self.base.with_unnamed(curves))

    def at_ceiling(self, ceiling_z: float) -> "Model":
        """The model under a ceiling at this height (m)."""
        return dataclasses.replace(self, ceiling_z=ceiling_z)

    def start_value(self, variable: Variable) -> float:
        """The value at present: searched for, else of the vehicle file, else the neutral or typical one."""
        if variable in self.values:
            return self.values[variable]
        value = self.nothing_new(variable)
        return self.rule(variable).typical if value is None else value

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that are searched for, in the order in which they came."""
        return tuple(dict.fromkeys(variable.effect for variable in self.values))

    def vehicle(self) -> Vehicle:
        """The vehicle with all its effects, values without uncertainty."""
        return self.base.with_effects(
            Effect(
                name=name,
                parameters={
                    v.parameter: Quantity(x, EFFECTS[name].parameters[v.parameter].unit, 0.0, "gap finder")
                    for v, x in self.values.items()
                    if v.effect == name
                },
            )
            for name in self.effects
        )

    def parameters(self) -> Any:
        """The record of physics parameters."""
        ceiling = NO_CEILING if self.ceiling_z is None else self.ceiling_z
        return physics_parameters(self.vehicle(), RoomGeometry(ceiling_z=ceiling))

    def predict(self, records: Sequence[FlightRecord]) -> FloatArray:
        """Predicted signals along the flights (:mod:`calibration.gap.data.signals`), shape (n, 7)."""
        p = self.parameters()
        predictions = self.along(records, p)
        plain = functools.reduce(Model.without, LIFT_ONLY, self)
        drawing = predictions if plain.effects == self.effects else plain.along(records, plain.parameters())
        voltages = [terminal_voltage(p, *pair) for pair in zip(records, drawing, strict=True)]
        return stack_predictions(records, predictions, voltages)

    def motion(self, records: Sequence[FlightRecord], p: Any) -> FloatArray:
        """:meth:`predict` with nothing in the voltage, which takes half of its time or more."""
        return stack_motion(records, self.along(records, p))

    def voltage_for_lift(self, records: Sequence[FlightRecord]) -> FloatArray:
        """Battery voltage (V), shape (n,), of motors that draw for what they lift, :data:`LIFT_ONLY` too."""
        p = self.parameters()
        drawing = zip(records, self.along(records, p), strict=True)
        return np.concatenate([terminal_voltage(p, *pair) for pair in drawing])

    def along(self, records: Sequence[FlightRecord], p: Any) -> list[Prediction]:
        """What these :meth:`parameters` say along each flight."""
        with ThreadPoolExecutor(WORKERS) as pool:
            return list(pool.map(lambda record: teacher_forced(record, p), records))

    def derivative(
        self, records: Sequence[FlightRecord], variable: Variable, predicted: FloatArray
    ) -> FloatArray:
        """Derivative, shape (n, 7), of the predicted signals that say how large a variable is.

        As :meth:`response`, but for effects that forces alone measure (`sized_by_forces` of
        :class:`~onboard.vehicle.effects.EffectDescription`).
        """
        change = self.response(records, variable, predicted)
        if EFFECTS[variable.effect].sized_by_forces:
            change[:, TORQUE] = 0.0
        return change

    def response(
        self, records: Sequence[FlightRecord], variable: Variable, predicted: FloatArray
    ) -> FloatArray:
        """Derivative, shape (n, 7), of all predicted signals that speak for an effect by a variable of it.

        Voltage is left to the battery alone: it is known to millivolts, what a motor draws for a thrust is
        not, and so a voltage must not decide about a thrust. Likewise forces alone decide about some effects
        (`by_forces` of :class:`~onboard.vehicle.effects.EffectDescription`).

        Args:
            records: flights.
            variable: by which; taken towards the middle of its bounds, of a delay to both sides.
            predicted: by this model, shape (n, 7).
        """
        value, rule = self.start_value(variable), self.rule(variable)
        of_battery = variable.effect == _BATTERY

        def at(other: float) -> FloatArray:
            stepped = self.with_values({variable: other})
            return stepped.predict(records) if of_battery else stepped.motion(records, stepped.parameters())

        if variable.effect == _DELAY:
            low, high = max(value - LONGEST_STEP, rule.low), min(value + LONGEST_STEP, rule.high)
            slope = (at(high) - at(low)) / (high - low)
        else:
            step = max(_SHARE_OF_RANGE * (rule.high - rule.low), 1e-3 * abs(value))
            if value + step > rule.high:
                step = -step
            slope = (at(value + step) - predicted) / step
        # In the order in which channels are whitened, one after the other.
        change = np.asfortranarray(slope)
        if of_battery:
            change[:, :VOLTAGE] = 0.0
        else:
            change[:, VOLTAGE] = 0.0
        if EFFECTS[variable.effect].by_forces:
            change[:, TORQUE] = 0.0
        return change


@cache
def _rule(variable: Variable, size: Size) -> EffectParameter:
    return EFFECTS[variable.effect].parameters[variable.parameter].for_size(size)


def kinds_that_tell(effects: Collection[str]) -> list[int]:
    """Which of the :data:`~calibration.gap.data.signals.KINDS` of signals decide which of these there are."""
    if effects and all(EFFECTS[name].by_forces for name in effects):
        return [_FORCES]
    return [_FORCES, _TORQUES, _VOLTAGES] if _BATTERY in effects else [_FORCES, _TORQUES]


def terminal_voltage(p: Any, record: FlightRecord, prediction: Prediction) -> FloatArray:
    """Battery voltage (V) by the vehicle's battery model, shape (n,), from full at the first sample."""
    fallen = p["open_circuit_slope"] * prediction.charge / p["battery_capacity"]
    dropped = p["battery_resistance"] * record.late_voltage(prediction.current)
    return np.asarray(p["open_circuit_full"] - fallen - dropped)


def stack_motion(records: Sequence[FlightRecord], predictions: Sequence[Prediction]) -> FloatArray:
    """:func:`stack_predictions` with nothing in the voltage."""
    return stack_predictions(records, predictions, [np.zeros_like(one.current) for one in predictions])


def stack_predictions(
    records: Sequence[FlightRecord], predictions: Sequence[Prediction], voltages: Sequence[FloatArray]
) -> FloatArray:
    """Predicted signals, shape (n, 7), stacked as :func:`~calibration.gap.data.signals.stack_signals`.

    Args:
        records: the flights; without an accelerometer forces are those that poses show.
        predictions: one per flight.
        voltages: V, predicted at the terminals, shape (n,) per flight.
    """
    parts = []
    for record, prediction, voltage in zip(records, predictions, voltages, strict=True):
        part = np.zeros((voltage.size, len(CHANNELS)))
        seen = record.specific_force is not None
        part[:, FORCE] = prediction.force if seen else as_poses_see(record, prediction.force)
        part[:-1, TORQUE] = prediction.angular_acceleration
        part[:, VOLTAGE] = voltage
        parts.append(part)
    return np.vstack(parts)
