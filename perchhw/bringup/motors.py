"""Motors one by one, propellers off: is each where the board believes it to be, and does it turn its way?

The operator looks and says; bare rotors of a drone on a desk react too weakly for its gyro.
"""

import re
from collections.abc import Callable
from typing import Final

from calibration.bench.instruments.motor_stand import MotorStand, pwm
from onboard.clock import monotonic
from perchhw.doctor.finding import Finding, judged

DIRECTIONS: Final = {1: "ccw", 2: "cw", 3: "ccw", 4: "cw"}
"""Of motors 1 to 4 seen from above: M1 front right, M2 back right, M3 back left, M4 front left (Bitcraze)."""
STEP = 40
"""Of 256: a bare motor starts surely, and does not race."""
SECONDS = 1.0
_WHERE: Final = {1: "front right", 2: "back right", 3: "back left", 4: "front left"}
_ANSWER: Final = re.compile(r"\s*([1-4])\s*(ccw|cw)\s*", re.IGNORECASE)

Ask = Callable[[int], str]
"""What the operator saw turn when motor n (1..4) was told to: "1 ccw"."""


def motors(drone: str, phrase: str, saw: Ask) -> tuple[Finding, ...]:
    """Turn each motor for a second, and compare with what the operator saw.

    Args:
        drone: its URI.
        phrase: what the operator typed to unlock the motors.
        saw: asks the operator; called while all motors stand.

    Raises:
        MotorsRefused: another phrase, or the drone is armed.
        LinkError, InstrumentError: no link, or it was lost; the motors were stopped.
        MotorsNotStopped: the drone did not confirm that.
    """
    from onboard.link import DroneLink

    findings = []
    with DroneLink.open(drone) as link, MotorStand(link, no_remote_cut=True) as stand:
        stand.unlock(phrase)
        for motor in DIRECTIONS:
            stand.spin({motor: pwm(STEP)})
            until = monotonic() + SECONDS * link.patience
            while monotonic() < until:
                stand.take()
            stand.spin({})
            findings.append(_judge(motor, saw(motor)))
    return tuple(findings)


def _judge(motor: int, said: str) -> Finding:
    wanted = f"{motor} {DIRECTIONS[motor]}"
    found = _ANSWER.fullmatch(said)
    measured = f"{found[1]} {found[2].lower()}" if found else f"not understood: {said!r}"
    return judged(
        f"motor_{motor}",
        measured == wanted,
        measured,
        f"{wanted} ({_WHERE[motor]})",
        "a drone whose motors are exchanged, or turn the wrong way, turns over as it takes off",
        "connect each motor to its own output; one that turns the wrong way is of the other colour of wires",
    )
