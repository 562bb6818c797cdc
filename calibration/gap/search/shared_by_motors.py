"""Four unequal motors, or an error of scale and a centre of mass: what all motors share is no difference.

Four motors thrust, roll, pitch and yaw as they like. A centre of mass beside the middle rolls and pitches
alike, but lifts nothing: where the scale of thrust is wrong as well, four motors explain both causes at once
and more than either alone, and would be taken first. A weak motor yaws, which those two causes do not.
"""

import numpy as np

from calibration.gap.estimate.model import Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, settled
from calibration.gap.search.rivals import NOT_TOLD_APART
from calibration.gap.search.selection import SelectionStep

MOTORS = "motor_imbalance"

_SCALES = (Variable("thrust_scale", "scale"), Variable("mass_error", "relative"))
_CENTRE = (Variable("com_offset", "x"), Variable("com_offset", "y"))


def scale_shared_by(motors: SelectionStep, present: Fitted, training: Training) -> str | None:
    """The error of scale that explains as much beside a centre of mass as four motors do; None where none.

    Args:
        motors: the effect that would come in; anything but four motors shares nothing.
        present: the model before.
        training: the flights.
    """
    if not shares_a_scale(motors) or any(v in present.variables for v in (*_SCALES, *_CENTRE)):
        return None
    fits = []
    for scale in _SCALES:
        variables = (*present.variables, scale, *_CENTRE)
        both = settled(refine(present.model, variables, training, start=present, near=present), training)
        fits.append((_lead(motors.after, both), scale.effect))
    lead, effect = min(fits)
    return effect if lead <= NOT_TOLD_APART else None


def shares_a_scale(step: SelectionStep) -> bool:
    """Whether the effect that came in is four motors whose mean is an error of scale worth a name."""
    if step.effect != MOTORS:
        return False
    model = step.after.model
    shared = np.mean([model.change(v) for v in model.values if v.effect == MOTORS])
    return bool(abs(shared) >= model.rule(_SCALES[0]).practical_minimum)


def _lead(motors: Fitted, both: Fitted) -> float:
    """Held-out log-likelihood by which four motors are ahead, whichever way flights are held out."""
    return max(float(motors.gains(both, in_time).sum()) for in_time in (False, True))
