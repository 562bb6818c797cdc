"""`space` on the screen of a flight at real pace, and the drone that is asked whether its motors may turn."""

import threading
from pathlib import Path

from perchhw.lab_process import SimulatedLab
from tests.flight.airborne import NotInTheAir, Witness
from tests.screen.terminal import Terminal

_OFF_WITHIN_S = 5.0
_LATER_S = 0.3
"""After it moves to its start: it is in the air."""


def fly(lab: SimulatedLab, folder: Path, *more: str, columns: int = 80) -> Terminal:
    """``perchhw fly`` on a terminal of so many columns, recorded in `folder`."""
    place = ("--drone", lab.drones[0], "--mocap", lab.mocap[0], "--out", str(folder))
    return Terminal("fly", *place, "--speed", "2.5", "--angle", "50", *more, columns=columns)


def from_space_to_motors_off(lab: SimulatedLab, witness: Witness, folder: Path) -> float:
    """Press it in the air; s until the drone itself says that its motors may not turn.

    Raises:
        NotInTheAir: the flight had ended before.
    """
    with fly(lab, folder, "--put-back", "--yes") as terminal:
        terminal.wait(lambda: "moving to start" in terminal.text() or terminal.process.poll() is not None)
        threading.Event().wait(_LATER_S)
        if not witness.bits().is_flying:
            raise NotInTheAir(terminal.text())
        pressed = terminal.press(" ")
        off = witness.motors_off(_OFF_WITHIN_S)
        assert off is not None
        assert terminal.ended() == 130
        return off - pressed
