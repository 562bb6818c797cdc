"""What no vehicle file states, and is fitted beside whatever is missing: the laws of the rotors
(:mod:`calibration.gap.estimate.motor_laws`), and where the board sits.

Gyro and accelerometer, and the origin that motion capture tracks, are taken to be in the middle between the
rotors. A board a few millimetres beside it feels more whenever the vehicle turns, a x r + w x (w x r): to the
accelerometer that is a centre of mass beside the middle, which the torques of its thrust contradict.
"""

from collections.abc import Sequence

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import CHANNELS, FORCE
from calibration.gap.data.smoothing import as_poses_see
from calibration.gap.estimate.mixed import Prior
from calibration.gap.estimate.model import Model, stack_motion
from calibration.gap.estimate.motor_laws import motor_laws
from calibration.gap.replay.teacher_forcing import Prediction
from onboard.arrays import FloatArray

AXES = 3
"""Of the place of the board: the first of what is unstated; the laws follow."""

_BESIDE = 0.1
"""Standard deviation of the board's place along each axis, as a share of the arm: 4.6 mm of a Crazyflie
(engineering estimate: a sensor somewhere on its board)."""


def unstated(model: Model, records: Sequence[FlightRecord]) -> tuple[FloatArray, ...]:
    """What each unstated quantity adds to the predicted signals, shape (n, 7) each, per unit of its prior."""
    predictions = model.along(records, model.parameters())
    laws = motor_laws(model, records, stack_motion(records, predictions))
    return (*place_of_board(model, records, predictions), *laws)


def prior_of_unstated(count: int) -> Prior:
    """Of each: nothing, give or take one unit."""
    return Prior.independent(np.zeros(count), np.ones(count))


def place_of_board(
    model: Model, records: Sequence[FlightRecord], predictions: Sequence[Prediction]
) -> tuple[FloatArray, ...]:
    """Specific force beside that of the middle, by axis, of a board one standard deviation beside it."""
    places = _BESIDE * model.size.arm * np.eye(AXES)
    columns: list[list[FloatArray]] = [[] for _ in places]
    for record, predicted in zip(records, predictions, strict=True):
        rate, seen = np.nan_to_num(record.rate), record.specific_force is not None
        for place, parts in zip(places, columns, strict=True):
            felt = np.cross(predicted.turn_up, place) + np.cross(rate, np.cross(rate, place))
            part = np.zeros((record.t.size, len(CHANNELS)))
            part[:, FORCE] = felt if seen else as_poses_see(record, felt)
            parts.append(part)
    return tuple(np.asfortranarray(np.vstack(parts)) for parts in columns)
