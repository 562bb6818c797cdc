"""What differs from flight to flight and is no finding: thrust scale, lean and trim of its first seconds.

Several airframes, batteries and marker frames hide behind one vehicle file (gap note, 1.8). For a flight that
no fit saw, these few numbers come from its beginning, and only the rest is scored.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from calibration.gap.replay.flight_prediction import Replay, in_body_axes, prediction_errors
from calibration.gap.replay.floors import accelerometer_bias
from calibration.gap.replay.inputs import PredictionInputs
from calibration.gap.replay.windows import Rows
from onboard.arrays import FloatArray, Vector

FORCE_HORIZON = 0.5
"""s over which velocity errors show scale and lean: long against the noise of the velocity."""
TORQUE_HORIZON = 0.1
"""s over which rate errors show the trim: short, because a controlled vehicle corrects it."""
LEAST_STARTS = 20
"""Starts that the fit needs."""

_SCALE_RANGE = (0.5, 1.5)
_MOST_LEAN = 0.2


@dataclass(frozen=True, kw_only=True)
class Nuisances:
    """What a flight has beside its model.

    Attributes:
        thrust_scale: factor on the thrust of all rotors.
        lean_rad: of the thrust towards b_x and b_y.
        angular_acceleration_rad_s2: about the body axes, constant.
        accelerometer_bias_m_s2: body, for the floor only.
        at_bound: a number left the range of what is physical (0.5 to 1.5, 0.2 rad) and was held there: the
            flight belongs to another vehicle, or the model is far off.
    """

    thrust_scale: float = 1.0
    lean_rad: tuple[float, float] = (0.0, 0.0)
    angular_acceleration_rad_s2: Vector = (0.0, 0.0, 0.0)
    accelerometer_bias_m_s2: Vector = (0.0, 0.0, 0.0)
    at_bound: bool = False

    def trim(self) -> FloatArray:
        """Lean and angular acceleration for the kernels, shape (5,)."""
        return np.array([*self.lean_rad, *self.angular_acceleration_rad_s2])

    def scaled(self, parameters: Any) -> Any:
        """The parameters of the physics with this thrust scale."""
        if self.thrust_scale == 1.0:
            return parameters
        scaled = parameters.copy()
        scaled["command_gain"] *= self.thrust_scale
        scaled["command_on"] = 1
        return scaled

    def replay(self, inputs: PredictionInputs, rows: Rows, ends: Rows, lengths: Rows) -> Replay:
        """What to predict of a flight with these numbers, everything open loop."""
        return Replay(
            rows=rows,
            ends=ends,
            lengths=lengths,
            parameters=self.scaled(inputs.parameters),
            trims=self.trim(),
        )


def fit_nuisances(inputs: PredictionInputs, rows: Rows, lengths: Rows) -> Nuisances | None:
    """Least squares of velocity errors (scale, lean) and mean of rate errors (trim) from these starts.

    Args:
        inputs: the flight.
        rows: starts of the first seconds, shape (m,).
        lengths: samples that may be predicted from each start without leaving them, shape (m,).

    Returns:
        The numbers, or None when fewer than :data:`LEAST_STARTS` starts reach the horizon.
    """
    end = np.array([max(1, inputs.rows(FORCE_HORIZON))])
    long_enough = lengths >= end[0]
    rows, lengths = rows[long_enough], lengths[long_enough]
    if rows.size < LEAST_STARTS:
        return None
    fit = least_squares(
        lambda force: _velocity_errors(inputs, rows, end, lengths, force),
        [1.0, 0.0, 0.0],
        bounds=([_SCALE_RANGE[0], -_MOST_LEAN, -_MOST_LEAN], [_SCALE_RANGE[1], _MOST_LEAN, _MOST_LEAN]),
        method="dogbox",
        x_scale=0.01,
    )
    bias = np.zeros(3)
    if inputs.record.specific_force is not None:
        bias = accelerometer_bias(inputs, rows, int(end[0]))
    found = Nuisances(
        thrust_scale=float(fit.x[0]),
        lean_rad=(float(fit.x[1]), float(fit.x[2])),
        accelerometer_bias_m_s2=(float(bias[0]), float(bias[1]), float(bias[2])),
        at_bound=bool(np.any(fit.active_mask)),
    )
    return replace(found, angular_acceleration_rad_s2=_trim(inputs, rows, lengths, found))


def _velocity_errors(
    inputs: PredictionInputs, rows: Rows, end: Rows, lengths: Rows, force: FloatArray
) -> FloatArray:
    """Velocity errors (m/s, body axes) with this scale and lean, shape (3 m,)."""
    nuisances = Nuisances(thrust_scale=force[0], lean_rad=(force[1], force[2]))
    replay = replace(nuisances.replay(inputs, rows, end, lengths), given_attitude=True)
    errors = prediction_errors(inputs, replay)
    return in_body_axes(errors, inputs.rotation[rows])[:, 0, 1].ravel()


def _trim(inputs: PredictionInputs, rows: Rows, lengths: Rows, found: Nuisances) -> Vector:
    """Angular acceleration (rad/s2) that the model lacks."""
    end = np.array([max(1, inputs.rows(TORQUE_HORIZON))])
    errors = prediction_errors(inputs, found.replay(inputs, rows, end, lengths))
    x, y, z = -errors.vectors[:, 0, 3].mean(axis=0) / (end[0] * inputs.dt)
    return float(x), float(y), float(z)
