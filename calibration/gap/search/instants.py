"""Forces at chosen instants of flights: quick enough for many starts of a fit that has many valleys.

Along a flight motors have memory, and a prediction costs tens of milliseconds. Forces of the air and of
strings have none: at a instant at which thrust, place and speed are known they follow from the parameters at
once. What they add is held against the mean misfit around each instant.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import FORCE, Signals
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.replay.teacher_forcing import force_at_sample, teacher_forced
from onboard.arrays import FloatArray
from sim_backend.physics.jit import outlined
from sim_backend.physics.state import new_state

_WINDOW = 0.1
"""s around each instant; what is slower than this is seen whole."""

_MOST = 2000
"""Instants: more make a fit slower, not surer."""

_DOUBT = 0.1
"""m/s2: misfits up to this size are noise, those far beyond it count less (robust loss)."""

_STEPS = 60

_LEAST_GAP, _USUAL_GAP = 0.005, 0.05
"""m between a ceiling and the highest rotor flown: who flies for the ceiling comes near it, never into it."""

_GAP_FACTOR = 2.0
"""One standard deviation about the usual gap."""


@outlined
def _forces(state: Any, p: Any, records: Any, thrusts: FloatArray, out: FloatArray) -> None:
    for k in range(out.shape[0]):
        for motor in range(4):
            state.thrust[motor] = thrusts[k, motor]
        fx, fy, fz = force_at_sample(state, records, k, p)
        out[k, 0], out[k, 1], out[k, 2] = fx, fy, fz


class Instants:
    """Instants of flights, with what a model left unexplained there.

    Args:
        model: of which the misfit is.
        records: the flights.
        signals: of the flights.
        misfit: signals less prediction, shape (n, 7); 0 where not valid.
    """

    def __init__(
        self, model: Model, records: Sequence[FlightRecord], signals: Signals, misfit: FloatArray
    ) -> None:
        self._base = model
        width = max(1, round(_WINDOW / signals.dt))
        valid = np.asarray(signals.valid[:, FORCE].all(axis=1))
        rows = np.arange(width, valid.size - width, max(width, valid.size // _MOST))
        around = rows[:, None] + np.arange(width) - width // 2
        flight = signals.flight
        one_flight = flight[rows - width] == flight[rows + width]
        whole = np.flatnonzero(valid[around].all(axis=1) & one_flight)
        rows, around = rows[whole], around[whole]
        self.misfit: FloatArray = misfit[:, FORCE][around].mean(axis=1)
        p = model.parameters()
        thrust = np.vstack([teacher_forced(record, p).thrust for record in records])
        self._thrust = np.ascontiguousarray(thrust[rows])
        self._place = tuple(
            np.ascontiguousarray(np.nan_to_num(np.concatenate(values)[rows]))
            for values in (
                [record.position for record in records],
                [record.velocity for record in records],
                [record.attitude for record in records],
                [record.rate for record in records],
                [record.duty for record in records],
                [np.zeros(record.t.size) if record.voltage is None else record.voltage for record in records],
            )
        )
        self._without = self._force(model)

    @property
    def highest_rotor(self) -> float:
        """Height (m) of the rotors at the highest instant."""
        return float(self._place[0][:, 2].max()) + self._base.base.body.propeller_height_z.value

    def settled(
        self, start: Model, variables: Sequence[Variable], move_ceiling: bool = False
    ) -> tuple[float, Model]:
        """A model near `start` that fits the instants well, and what it leaves (sum of robust squares).

        Without a instant (no force was measured) the start stays as it is.

        Args:
            start: to begin with.
            variables: to fit.
            move_ceiling: whether the height of the ceiling is one more unknown.
        """
        if self.misfit.shape[0] == 0:
            return 0.0, start
        first = np.array([start.start_value(v) for v in variables])
        rules = [start.rule(v) for v in variables]
        low, high = np.array([r.low for r in rules]), np.array([r.high for r in rules])
        believed = [(i, r.typical, r.spread) for i, r in enumerate(rules) if r.spread is not None]
        scale = np.array([max(abs(x), r.practical_minimum) for x, r in zip(first, rules, strict=True)])
        top = self.highest_rotor

        def model_of(values: FloatArray) -> Model:
            model = start.with_values(dict(zip(variables, values, strict=False)))
            return model.at_ceiling(top + values[-1]) if move_ceiling else model

        def left(values: FloatArray) -> FloatArray:
            added = self._force(model_of(values)) - self._without
            doubts = [(values[i] - typical) / spread for i, typical, spread in believed]
            if move_ceiling:
                doubts.append(np.log(values[-1] / _USUAL_GAP) / np.log(_GAP_FACTOR))
            return np.concatenate([((self.misfit - added) / _DOUBT).ravel(), doubts])

        if move_ceiling and start.ceiling_z is not None:
            first = np.append(first, max(start.ceiling_z - top, 2.0 * _LEAST_GAP))
            low, high = np.append(low, _LEAST_GAP), np.append(high, np.inf)
            scale = np.append(scale, first[-1])
        inside = np.clip(first, low + 1e-9 * (1.0 + np.abs(low)), high)
        found = least_squares(
            left, inside, bounds=(low, high), x_scale=scale, loss="soft_l1", max_nfev=_STEPS
        )
        return float(found.cost), model_of(found.x)

    def _force(self, model: Model) -> FloatArray:
        p = model.parameters()
        force = np.empty((self.misfit.shape[0], 3))
        _forces(new_state(), p, self._place, self._thrust, force)
        return force / float(p["mass"])
