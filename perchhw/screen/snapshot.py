"""What goes from the flight's process to its screen: one line of JSON, a few times a second."""

import dataclasses
import json
import math
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """One picture of a flight; what is not known is None.

    Attributes:
        title: the command, with the name of what it flies.
        drone: its URI.
        attempt, attempts: number of this one from 1, and how many there are.
        condition: what is flown, in words.
        phases: phases so far, the present one last.
        planned: phases of a flight that goes to plan.
        in_phase_s: s since the present one began.
        waiting_for: what it waits for, in words.
        alert: what the operator must know at once.
        aborted_by: the rule or person that ended the attempt early.
        battery_v: V.
        telemetry_hz, silence_s: packets of the estimate a second; s since the drone was last heard.
        mocap, mocap_hz, mocap_age_s: verdict on the poses, poses a second, age of the last good one (s).
        estimate_to_mocap_m: distance of the drone's estimate from the pose, m.
        tau_s: the drone's time to contact, s.
        policy_crc: of the policy that is live on the drone.
        outcomes: outcome and count of the attempts so far.
        time_left_s, packs_left: what the attempts that are left will take.
        paused: the next attempt waits for the operator.
        marks: notes without text yet.
        view: where the flight is seen, in words.
        messages: what else was said, the newest last.
        question: what is asked of the operator; its number, and whether words are wanted, not just Enter.
        flying: an attempt is under way.
        on_desk: the command flies nothing; `phases` are its stages.
    """

    title: str
    drone: str = ""
    attempt: int | None = None
    attempts: int | None = None
    condition: str = ""
    phases: tuple[str, ...] = ()
    planned: tuple[str, ...] = ()
    in_phase_s: float | None = None
    waiting_for: str = ""
    alert: str | None = None
    aborted_by: str | None = None
    battery_v: float | None = None
    telemetry_hz: float | None = None
    silence_s: float | None = None
    mocap: str | None = None
    mocap_hz: float | None = None
    mocap_age_s: float | None = None
    estimate_to_mocap_m: float | None = None
    tau_s: float | None = None
    policy_crc: int | None = None
    outcomes: tuple[tuple[str, int], ...] = ()
    time_left_s: float | None = None
    packs_left: int | None = None
    paused: bool = False
    marks: int = 0
    view: str = ""
    messages: tuple[str, ...] = ()
    question: str | None = None
    question_number: int = 0
    wants_words: bool = False
    flying: bool = False
    on_desk: bool = False

    def to_line(self) -> bytes:
        """As it is sent."""
        return json.dumps({name: _finite(value) for name, value in vars(self).items()}).encode() + b"\n"

    @classmethod
    def from_line(cls, line: bytes) -> "Snapshot":
        """As it was sent; raises ``ValueError`` or ``TypeError`` for anything else."""
        found: dict[str, Any] = json.loads(line)
        for field in fields(cls):
            if isinstance(found.get(field.name), list):
                found[field.name] = tuple(
                    tuple(one) if isinstance(one, list) else one for one in found[field.name]
                )
        return cls(**found)

    def with_changes(self, **changes: Any) -> "Snapshot":
        """The same, but for some fields."""
        return dataclasses.replace(self, **changes)


def _finite(value: Any) -> Any:
    """A number that is none is not known."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
