"""By which law rotors follow their commands: fitted whatever is missing, for few vehicle files say it.

A vehicle file says how long a thrust takes to follow, and only after a tachometer by which law it gets there:
the speed w of a rotor may follow in first order (an electric brake, a controller of speed), or by the drag of
its propeller, dw/dt = b (ws^2 - w^2) (a winding that only drives; bench notes 1.2), the one on the way up and
the other on the way down. With hover's time constants they differ in the second order of a step: enough to
look like a bent map of thrust, like inertias and like a lag that is quicker down than up.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model
from onboard.arrays import FloatArray

_NO_DRAG = 1e-4
"""Share of a drag that makes all of a lag: next to none, by which the physics knows that there is a law."""

_ANY = 1e7
"""rad2/(N s2) where the vehicle file says nothing of speeds: their ratios alone count."""

_SPEED, _DRAG = "by their speed in first order", "by the drag of their propellers"
_PAIRS = ((_SPEED, _SPEED), (_DRAG, _DRAG), (_SPEED, _DRAG))
"""Up and down."""

LAWS = tuple(
    f"rotors follow {up}" if up == down else f"rotors speed up {up} and slow down {down}"
    for up, down in _PAIRS
)
"""In words, in the order of :func:`motor_laws`."""


def motor_laws(model: Model, records: Sequence[FlightRecord], usual: FloatArray) -> tuple[FloatArray, ...]:
    """What other laws add to the predicted signals, shape (n, 7) each; none where the vehicle file says it.

    One law both up and down, the other one so, and the first up with the second down.

    Args:
        usual: the model's own :meth:`~calibration.gap.estimate.model.Model.motion` along them, shape (n, 7).
    """
    p = model.parameters()
    if p["speed_law_b"][0] > 0.0:
        return ()
    return tuple(np.asfortranarray(model.motion(records, _by(p, up, down)) - usual) for up, down in _PAIRS)


def _by(p: Any, up: str, down: str) -> Any:
    """The parameters with rotors that follow by these laws, as quickly near hover as the model's thrusts."""
    p = p.copy()
    if p["speed2_per_thrust"] == 0.0:
        p["speed2_per_thrust"], p["thrust_per_speed2"] = _ANY, 1.0 / _ANY
    hover = math.sqrt(p["hover_thrust"] * p["speed2_per_thrust"])
    for index, (law, lag) in enumerate(((up, p["time_constant_up"]), (down, p["time_constant_down"]))):
        p["speed_law_a"][index] = 1.0 / lag if law == _SPEED else 0.0
        p["speed_law_b"][index] = (_NO_DRAG if law == _SPEED else 1.0) * 0.5 / (lag * hover)
    p["motors_on"] = True
    return p
