"""Set-points of brushed motors: their PWM has 8 bits, and the firmware drops the lower byte of each."""

from calibration.bench.instruments.errors import InstrumentInputError

PWM_STEP, PWM_MAX = 256, 255 * 256


def pwm(step: int) -> int:
    """The set-point whose duty is exactly ``step / 256``, `step` 0..255.

    Raises:
        InstrumentInputError: another step.
    """
    if not 0 <= step <= 255:
        raise InstrumentInputError(f"PWM step {step}: the motors' PWM has 8 bits, 0 to 255")
    return PWM_STEP * step


def check_set_point(value: int) -> None:
    """Raise InstrumentInputError unless the motors' PWM can keep this set-point."""
    if not 0 <= value <= PWM_MAX or value % PWM_STEP:
        raise InstrumentInputError(
            f"set-point {value}: the motors' PWM has 8 bits, so that only multiples of {PWM_STEP} from 0 to "
            f"{PWM_MAX} are what they say"
        )
