"""What one attempt is asked to do and what came of it: the words between a campaign and the flight.

A campaign (or ``fly``, or ``demo``) makes an :class:`AttemptRequest`; an :data:`AttemptRunner` flies it and
returns an :class:`AttemptResult`. Neither side knows how the other works.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from onboard.errors import SafetyStop
from onboard.lab_file import LabFile
from onboard.outcome import Outcome as Outcome
from onboard.room import RoomGeometry
from perchhw.errors import FlightStackError

DEFAULT_VEHICLE = "crazyflie21-upgraded"
"""The paper's flying vehicle."""
STORED_VEHICLE = "crazyflie21-upgraded-stored"
"""The same as it was believed before its landings were looked at; the authors' simulation builds on it."""
AUTHORS_VEHICLE = "crazyflie21-gazebo"
"""That of the authors' simulation."""
DEFAULT_POLICY = "default"
"""The policy that comes with the code, trained for it."""
SHAPE = ("ax", "az", "tau0")
"""What fixes the shape of an approach: all three, or none."""
APPROACH_PARAMETERS = (*SHAPE, "impact_x", "impact_y")
"""What :attr:`AttemptRequest.approach` may hold; :mod:`perchhw.flight.mission` says what they mean."""


@dataclass(frozen=True)
class AttemptRequest:
    """One attempt to fly.

    Attributes:
        speed: commanded speed on the approach line (m/s).
        angle_deg: angle of the approach line above the horizon (deg).
        index: number of the attempt in its campaign, from 0 (its place in the flying order).
        folder: the run folder for the record: reserved and empty, or not there yet.
        drone: URI of the drone.
        mocap: URI of the motion-capture source.
        policy: policy file (``*.policy.json``) or the name of a shipped policy.
        vehicle: name or path of the vehicle file.
        legs: name of the leg design, or None for the one in the vehicle file.
        room: ceiling and flight volume.
        lab: the lab file: limits, start mark, correction of the poses; None: a simulated room.
        seed: seed of everything random in this attempt.
        try_number: 1 for the first try; higher when an earlier try was interrupted.
        approach: further parameters of the approach (:data:`APPROACH_PARAMETERS`).
        new_pack: why the drone gets a charged battery before the attempt, in words; None: it does not.
        warm_up_s: hover for so long first, s.
        operator, note: who flies, and what is to be remembered of it; both are kept with the record.
        accept_mismatch: fly policy, vehicle, room and drone also where they do not belong together.
    """

    speed: float
    angle_deg: float
    index: int
    folder: Path
    drone: str
    mocap: str
    policy: str
    vehicle: str
    legs: str | None = None
    room: RoomGeometry = field(default_factory=RoomGeometry)
    lab: LabFile | None = None
    seed: int = 0
    try_number: int = 1
    approach: dict[str, float] = field(default_factory=dict)
    new_pack: str | None = None
    warm_up_s: float = 0.0
    operator: str | None = None
    note: str | None = None
    accept_mismatch: bool = False


@dataclass(frozen=True)
class AttemptResult:
    """What came of an attempt.

    Attributes:
        outcome: landing outcome; of a dry run always ``aborted``, also when it passed (`aborted_by` is None).
        triggered: whether the policy fired on the drone.
        trigger: the trigger snapshot (fields of the ``trigger`` topic), or None when it never fired.
        aborted_by: name of the rule that ended the attempt, or None.
        record: the run folder.
        halt: why nobody may go to the drone, or fly it again, before a person has looked; or None.
        fell: how the motors came to be cut before the drone was down, without a trigger, in words, or None.
        accepted_mismatches: what does not belong together and was flown all the same, in words.
        not_compared: what of it nobody could compare, in words.
        diagnosis: what happened and why, as in ``run.json``, or None where the record does not tell.
    """

    outcome: Outcome
    triggered: bool
    trigger: dict[str, Any] | None
    aborted_by: str | None
    record: Path
    halt: str | None = None
    fell: str | None = None
    accepted_mismatches: tuple[str, ...] = ()
    not_compared: tuple[str, ...] = ()
    diagnosis: dict[str, Any] | None = None


class AttemptInterrupted(KeyboardInterrupt):
    """The operator interrupted an attempt; the drone was stopped and the record closed first.

    Attributes:
        result: what came of the attempt until then.
    """

    def __init__(self, result: AttemptResult) -> None:
        super().__init__()
        self.result = result


class WarmUpAborted(FlightStackError, SafetyStop):
    """The drone did not hover as it should before its first attempt: none follows."""


AttemptRunner = Callable[[AttemptRequest], AttemptResult]
"""Flies one attempt. Raises :class:`AttemptInterrupted` after cleaning up."""
