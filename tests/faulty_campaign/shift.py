"""What is wrong in one shift of a campaign: faults of its lab, what befalls a process, a full disk."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from perchhw.diagnosis import Cause
from perchhw.lab_process import FREE_PORTS, LOCKSTEP
from perchhw.supervisor import Phase

LATEST_FAULT_S = 25.0
"""Of the lab's time: two flights or three."""
_LATEST_ATTEMPT = 4
DURATIONS_S = (0.02, 0.1, 0.3, 1.0, 5.0)
MOST_FAULTS = 2


class Blow(StrEnum):
    """What befalls a process while the campaign flies."""

    KILLED = "flight program killed"
    INTERRUPTED = "Ctrl-C"
    STOPPED = "perchhw stop"
    LAB_KILLED = "lab killed"
    ROOM_KILLED = "room killed"
    SUSPENDED = "host suspended"


CAUSES: dict[Blow, tuple[Cause, ...]] = {
    Blow.KILLED: (Cause.PROCESS_KILLED,),
    Blow.INTERRUPTED: (Cause.OPERATOR,),
    Blow.STOPPED: (Cause.STOPPED_BY_OTHERS,),
    Blow.LAB_KILLED: (Cause.LINK_LOST, Cause.MOCAP_SILENT, Cause.NOT_BEGUN),
    Blow.ROOM_KILLED: (Cause.MOCAP_SILENT,),
    Blow.SUSPENDED: (Cause.HOST_STOOD_STILL,),
}
"""What a flight that it ends may be explained by."""

_SHARES = {
    Blow.KILLED: 0.4,
    Blow.INTERRUPTED: 0.12,
    Blow.STOPPED: 0.12,
    Blow.LAB_KILLED: 0.12,
    Blow.ROOM_KILLED: 0.08,
    Blow.SUSPENDED: 0.16,
}
_IN_THE_AIR = (Phase.TAKING_OFF, Phase.MOVING_TO_START, Phase.APPROACHING)
_ANY = (None, Phase.CHECKING, Phase.UPLOADING, Phase.ARMING, *_IN_THE_AIR, Phase.FLIPPING, Phase.DONE)


@dataclass(frozen=True)
class Strike:
    """A blow in the `attempt`-th flight of the shift (from 1), `later` s after its `phase` (None: its start);
    a suspended host stands still for `seconds`.
    """

    blow: Blow
    attempt: int
    phase: Phase | None
    later: float
    seconds: float = 0.0


@dataclass(frozen=True)
class Shift:
    """One lab, and one run of the campaign in it.

    Attributes:
        number: from 0.
        faults: of the lab, by name.
        causes: what they may end a flight by.
        strikes: what befalls its processes, in order. The last one of every shift ends its run.
        file_limit: bytes that a file may have, as on a disk without room for more; None: no limit.
        aborted_in_a_row: aborted attempts that end the run.
        at_real_pace: whether the lab keeps the machine's time.
    """

    number: int
    faults: dict[str, str]
    causes: tuple[Cause, ...]
    strikes: tuple[Strike, ...]
    file_limit: int | None
    aborted_in_a_row: int
    at_real_pace: bool

    def lab_arguments(self, seed: int) -> tuple[str, ...]:
        """For ``perchhw sim lab``."""
        shown = [part for name, value in self.faults.items() for part in ("--fault", f"{name}={value}")]
        pace = () if self.at_real_pace else LOCKSTEP
        return (*FREE_PORTS, *pace, "--seed", str(1000 * seed + self.number), *shown)


def draw_shift(seed: tuple[int, int], number: int, attempts: int) -> Shift:
    """The shift of this number, of a day with this seed and so many attempts."""
    rng = np.random.default_rng((*seed, number))
    blow = Blow(rng.choice([*_SHARES], p=[*_SHARES.values()]))
    if blow is Blow.SUSPENDED:
        return _suspended(rng, number)
    limit = int(np.exp(rng.uniform(np.log(7e4), np.log(2e6)))) if rng.random() < 0.12 else None
    faults, causes = _faults(rng)
    if limit is not None:
        causes = (*causes, Cause.RECORD_LOST)
    strike = Strike(
        blow, int(rng.integers(1, 5)), _ANY[rng.integers(len(_ANY))], float(rng.uniform(0.0, 0.5))
    )
    return Shift(number, faults, causes, (strike,), limit, int(rng.choice([1, 1, 2])), at_real_pace=False)


def _suspended(rng: np.random.Generator, number: int) -> Shift:
    """In lock step time waits for whoever is suspended, and nothing comes of it; at real pace it does not."""
    real = bool(rng.random() < 0.5)
    phase = (_IN_THE_AIR if real else _ANY)[rng.integers(len(_IN_THE_AIR))]
    suspended = Strike(
        Blow.SUSPENDED, 1, phase, float(rng.uniform(0.0, 0.4)), float(rng.uniform(2.0, 4.0) if real else 1.0)
    )
    killed = Strike(Blow.KILLED, 2, None, float(rng.uniform(0.0, 1.0)))
    return Shift(number, {}, (), (suspended, killed), None, 1, real)


def _faults(rng: np.random.Generator) -> tuple[dict[str, str], tuple[Cause, ...]]:
    """None to two faults of a lab, and what they may end a flight by."""
    at, lasts = f"{rng.uniform(0.0, LATEST_FAULT_S):.3f}", rng.choice(DURATIONS_S)
    x, y, z = rng.uniform(0.15, 0.3, 3) * rng.choice([-1.0, 1.0], 3)
    kinds: dict[str, tuple[str, tuple[Cause, ...]]] = {
        "mocap_drop": (f"{rng.uniform(0.05, 0.7):.3f}", (Cause.MOCAP_SILENT,)),
        "mocap_jitter_ms": (f"{rng.uniform(1.0, 60.0):.1f}", (Cause.MOCAP_LATE,)),
        "mocap_occlude_at": (f"{at}:{lasts:g}", (Cause.MOCAP_OCCLUDED,)),
        "mocap_freeze_at": (f"{at}:{lasts:g}", (Cause.MOCAP_FROZEN,)),
        "mocap_flip180_at": (f"{at}:{lasts:g}", (Cause.MOCAP_JUMPED,)),
        "mocap_dies_at": (at, (Cause.MOCAP_SILENT,)),
        "link_loss": (f"{rng.uniform(0.01, 0.3):.3f}", (Cause.LINK_LOST,)),
        "freeze_drone_at": (at, (Cause.LINK_LOST,)),
        "drone_dies_at": (at, (Cause.LINK_LOST,)),
        "gyro_bias": (f"{x:.3f},{y:.3f},{z:.3f}", (Cause.GYRO_BIASED,)),
        "motors_swapped": ("1,2", (Cause.TUMBLED,)),
        "propeller_reversed": (f"{rng.integers(1, 5)}", (Cause.TUMBLED,)),
        "battery_voltage": (f"{rng.uniform(3.5, 4.2):.2f}", (Cause.BATTERY_LOW,)),
    }
    names = rng.choice(sorted(kinds), size=rng.choice([0, 1, 1, 1, MOST_FAULTS]), replace=False)
    chosen = {str(name): kinds[str(name)] for name in names}
    causes = tuple(cause for _, causes in chosen.values() for cause in causes)
    return {name: value for name, (value, _) in chosen.items()}, causes


def as_document(shift: Shift) -> dict[str, Any]:
    """What is said of it."""
    return {
        "number": shift.number,
        "faults": shift.faults,
        "causes": [cause.value for cause in shift.causes],
        "file_limit": shift.file_limit,
        "aborted_in_a_row": shift.aborted_in_a_row,
        "at_real_pace": shift.at_real_pace,
    }
