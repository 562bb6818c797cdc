"""A deterministic stand-in for a flight: writes a real, short record; may kill its process at a chosen point.

Run as a program, ``stand_in.py FILE FOLDER POINT COUNT`` flies the campaign and kills itself by SIGKILL when
POINT (``before``, ``inside``, ``closed``, ``never``) of its COUNT-th attempt is reached.
"""

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

from perchhw.attempt import AttemptRequest, AttemptResult, Outcome
from perchhw.campaign import load_plan, run_campaign
from perchhw.record import RunRecorder

OUTCOMES = tuple(o for o in Outcome if o is not Outcome.ABORTED)


def expected_outcome(index: int) -> Outcome:
    return OUTCOMES[index % len(OUTCOMES)]


def fly(request: AttemptRequest, reached: Callable[[str], None] = lambda point: None) -> AttemptResult:
    reached("before")
    outcome = expected_outcome(request.index)
    trigger = {"tau": 0.23, "d_ceil": 0.45, "seed": request.seed}
    config = {"speed_m_s": request.speed, "angle_deg": request.angle_deg, "ceiling_z": request.room.ceiling_z}
    with RunRecorder(request.folder, config, clock=lambda: 0.0) as recorder:
        for i in range(20):
            recorder.write("pose", i * 0.01, {"x": 0.0, "y": 0.0, "z": 1.0, "frame": i, "verdict": "ok"})
            if i == 10:
                reached("inside")
        recorder.close(outcome=outcome, triggered=True, trigger=trigger)
    reached("closed")
    return AttemptResult(outcome, triggered=True, trigger=trigger, aborted_by=None, record=request.folder)


def main(file: str, folder: str, point: str, count: str) -> None:
    flown = 0

    def reached(where: str) -> None:
        nonlocal flown
        flown += where == "before"
        if where == point and flown == int(count):
            os.kill(os.getpid(), signal.SIGKILL)

    run_campaign(load_plan(Path(file)), Path(folder), lambda r: fly(r, reached), resume=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
