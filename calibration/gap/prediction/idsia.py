"""The protocol of the IDSIA nano-drone benchmark (arXiv 2512.14450): 50 steps at 100 Hz from every start.

Every sample whose following half second is known is a start, from the record's own state. At each step the
errors are averaged over the starts, and the averages of steps 1 to 50 are summed. Its flights and vehicle are
not ours: the metric is the same, the numbers are not comparable across data.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.prediction.evaluation import PredictionError
from calibration.gap.prediction.flight_prediction import prediction_errors
from calibration.gap.prediction.inputs import PredictionInputs, prediction_inputs
from calibration.gap.prediction.window_errors import WindowErrors, window_errors
from calibration.gap.prediction.windows import Rows, usable_lengths
from calibration.gap.record import FlightRecord
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle

STEPS = 50
STEP_S = 0.01


@dataclass(frozen=True, kw_only=True)
class CumulatedErrors:
    """Sums over the steps of mean errors.

    Attributes:
        position: m. velocity: m/s. attitude: rad, geodesic. rate: rad/s.
    """

    position: float
    velocity: float
    attitude: float
    rate: float


@dataclass(frozen=True, kw_only=True)
class IdsiaErrors:
    """The benchmark's row of a model, and that of a vehicle that stays as it is ("naive").

    Attributes:
        model, naive: sums over steps 1 to 50.
        starts: number of starts.
    """

    model: CumulatedErrors
    naive: CumulatedErrors
    starts: int


def idsia_errors(records: Sequence[FlightRecord], vehicle: Vehicle) -> IdsiaErrors:
    """Errors of a model by the benchmark's protocol.

    Raises:
        PredictionError: a record whose rate is no multiple of 100 Hz, or not a single start.
    """
    model, naive = [], []
    for record in records:
        per_step = STEP_S / record.dt
        if round(per_step) < 1 or abs(per_step - round(per_step)) > 0.02 * per_step:
            raise PredictionError(
                f"{record.source}: samples {record.dt:.4g} s apart; the protocol needs 100 Hz or a multiple"
            )
        inputs = prediction_inputs(record, vehicle)
        ends = round(per_step) * np.arange(1, STEPS + 1)
        lengths = usable_lengths(inputs)
        rows = np.flatnonzero(lengths >= ends[-1])
        if rows.size == 0:
            continue
        errors = prediction_errors(
            inputs, rows, ends, lengths[rows], given_attitude=False, velocity=inputs.velocity[rows]
        )
        model.append(_lengths(errors))
        naive.append(_lengths(_unmoved(inputs, rows, ends, lengths[rows])))
    if not model:
        raise PredictionError("no half second of free flight with pose, gyro and motor commands known")
    every = np.concatenate(model)
    return IdsiaErrors(
        model=_cumulated(every), naive=_cumulated(np.concatenate(naive)), starts=every.shape[0]
    )


def _unmoved(inputs: PredictionInputs, rows: Rows, ends: Rows, lengths: Rows) -> WindowErrors:
    """Errors of a prediction that nothing changes."""
    state = np.hstack(
        [inputs.position[rows], inputs.velocity[rows], inputs.quaternion[rows], inputs.rate[rows]]
    )
    states = np.broadcast_to(state[:, None], (rows.size, ends.size, state.shape[1]))
    return window_errors(inputs, rows, ends, lengths, states, given_attitude=False)


def _lengths(errors: WindowErrors) -> FloatArray:
    """Lengths of the error vectors in SI units, shape (m, h, 4)."""
    return np.linalg.norm(errors.vectors, axis=3)


def _cumulated(lengths: FloatArray) -> CumulatedErrors:
    position, velocity, attitude, rate = lengths.mean(axis=0).sum(axis=0)
    return CumulatedErrors(
        position=float(position), velocity=float(velocity), attitude=float(attitude), rate=float(rate)
    )
