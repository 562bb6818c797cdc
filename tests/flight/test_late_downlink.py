"""What comes late from the drone is not new: a downlink that slips ends the flight, at real pace."""

import itertools
import threading
from pathlib import Path
from typing import Any

import numpy as np

from perchhw.lab_process import FREE_PORTS, SimulatedLab
from sim_backend.world import start_marks
from tests.flight.airborne import Airborne, when_it_flies
from tests.link.faulty_network import Faults

LIMIT_S = 0.3
START_X = start_marks(1)[0].x + 0.15
"""m; the way there takes 2 s, so slowly that no other rule notices anything."""
SLIP_S, STEP_S, WORST_S = 0.05, 0.1, 0.8
"""So much later with each step, which takes so long, up to the worst."""


def slip(air: Airborne) -> dict[str, Any]:
    """Let every packet of the drone come later and later in the hover; how the host says it ended."""
    air.take_off("moving to start")
    landing = threading.Event()

    def slip_away() -> None:
        for step in itertools.count(1):
            air.network.faults = Faults(downlink=min(step * SLIP_S, WORST_S))
            if landing.wait(STEP_S):
                air.network.faults = Faults()
                return

    slipping = threading.Thread(target=slip_away)
    slipping.start()
    try:
        air.reaches("landing")
    finally:
        landing.set()
        slipping.join()
    return air.ended()


def test_a_downlink_that_slips_in_the_hover_lands_the_drone(tmp_path: Path) -> None:
    """Each packet comes 10 ms after the last, as ever, and from longer and longer ago."""
    with (
        SimulatedLab("lab", (*FREE_PORTS, "--seed", "7")) as lab,
        Airborne(
            lab.drones[0],
            lab.mocap[0],
            tmp_path,
            np.random.default_rng(1),
            ("--telemetry-age", str(LIMIT_S), "--start-x", str(START_X)),
        ) as air,
    ):
        ended = when_it_flies(lambda: slip(air))
        assert "_age: " in str(ended["aborted_by"])
        assert f"need at most {LIMIT_S:g} s" in str(ended["aborted_by"])
        assert ended["phase"] == "done"
        assert not air.witness.bits().is_locked
