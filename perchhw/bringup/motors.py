"""Motors one by one, propellers off: is each where the board believes it to be, and does it turn its way?

The operator sees which one turns. Which way a bare shaft turns hardly anybody sees; the gyro tells it of a
drone that hangs on a thread (:mod:`perchhw.bringup.reaction`), and where it cannot, the operator is asked.

The drone is on its battery, which nobody can switch off from afar: its own app must be there, which stops
the motors when this program falls silent.
"""

import re
from collections.abc import Callable
from typing import Final

import numpy as np

from calibration.bench.instruments.drone_log import DroneLog, LogBatch
from calibration.bench.instruments.motor_stand import MotorStand
from calibration.bench.instruments.set_points import pwm
from perchhw.bringup.reaction import Reaction, reaction
from perchhw.doctor.check_result import CheckResult, judged, not_known

DIRECTIONS: Final = {1: "ccw", 2: "cw", 3: "ccw", 4: "cw"}
"""Of motors 1 to 4 seen from above: M1 front right, M2 back right, M3 back left, M4 front left (Bitcraze)."""
STEP = 40
"""Of 256: a bare motor starts surely, and does not race."""
TURNS = 4
PERIOD_S = 0.6
"""s for which a motor turns, and then stands."""
UNLOCK_PHRASE: Final = "propellers off, drone hung or held"
"""What the operator types before a motor turns: not that of a bench, where the drone is clamped."""
_WHERE: Final = {1: "front right", 2: "back right", 3: "back left", 4: "front left"}
_ANSWER: Final = re.compile(r"\s*([1-4])\s*(ccw|cw)?\s*", re.IGNORECASE)
_WHY: Final = "a drone whose motors are exchanged, or turn the wrong way, turns over as it takes off"
_REMEDY: Final = (
    "connect each motor to its own output; one that turns the wrong way is of the other colour of wires"
)

Ask = Callable[[int, Reaction], str]
"""What the operator saw turn when motor n (1..4) was told to: "1 ccw", or "1" where the gyro tells."""


def motors(drone: str, phrase: str, saw: Ask) -> tuple[CheckResult, ...]:
    """Turn each motor four times, and compare with what gyro and operator say.

    Args:
        drone: its URI.
        phrase: what the operator typed to unlock the motors; must be :data:`UNLOCK_PHRASE`.
        saw: asks the operator; called while all motors stand.

    Raises:
        MotorsRefused: another phrase, the drone is armed, or its firmware has not our app.
        LinkError, InstrumentError: no link, or it was lost; the motors were stopped.
        MotorsNotStopped: the drone did not confirm that.
    """
    from onboard.link import DroneLink

    findings = []
    with (
        DroneLink.open(drone) as link,
        MotorStand(link, cut_by_drone=True, unlock_phrase=UNLOCK_PHRASE) as stand,
    ):
        stand.unlock(phrase)
        for motor in DIRECTIONS:
            with DroneLog(link, ("gyro.z", f"motor.m{motor}")) as log:
                felt = _turn(stand, log, motor)
            findings.append(judge(motor, saw(motor, felt), felt))
    return tuple(findings)


def _turn(stand: MotorStand, log: DroneLog, motor: int) -> Reaction:
    """Turn it and let it stand some times; how the drone answered."""
    batches = _listen(stand, log)
    for _ in range(TURNS):
        stand.spin({motor: pwm(STEP)})
        batches += _listen(stand, log)
        stand.spin({})
        batches += _listen(stand, log)
    times = np.concatenate([batch.times for batch in batches])
    rates = np.concatenate([batch.values["gyro.z"] for batch in batches])
    driven = np.concatenate([batch.values[f"motor.m{motor}"] for batch in batches]) > 0.0
    return reaction(times, rates, driven)


def _listen(stand: MotorStand, log: DroneLog) -> list[LogBatch]:
    """What comes in for so long by the drone's own clock."""
    batches: list[LogBatch] = []
    while not batches or batches[-1].times[-1] - batches[0].times[0] < PERIOD_S:
        stand.take()
        batch = log.take(0.0)
        if len(batch.times):
            batches.append(batch)
    return batches


def judge(motor: int, said: str, felt: Reaction) -> CheckResult:
    """Hold one motor against what the operator said and the gyro felt; both must agree where both speak."""
    what, wanted = f"motor_{motor}", f"{motor} {DIRECTIONS[motor]} ({_WHERE[motor]})"
    told = felt.direction
    gyro = f"gyro: {told or 'cannot tell'}, {felt.step:+.1f} deg/s"
    found = _ANSWER.fullmatch(said)
    if found is None:
        return judged(what, False, f"not understood: {said!r} ({gyro})", wanted, _WHY, _REMEDY)
    ways = {way.lower() for way in (found[2], told) if way}
    if not ways:
        remedy = "hang the drone on a thread, free to turn, or say which way it turned: cw or ccw"
        return not_known(what, f"{found[1]}, no direction ({gyro})", wanted, _WHY, remedy)
    fine = int(found[1]) == motor and ways == {DIRECTIONS[motor]}
    return judged(what, fine, f"{said.strip().lower()} ({gyro})", wanted, _WHY, _REMEDY)
