"""Code in C and reference rehearse the same: nothing turns, so both have the very same inputs."""

import numpy as np
import pytest

from onboard.firmware.compiler import find_compiler
from onboard.ring import Ring
from sim_backend.engine_name import EngineName
from tests.rehearsal.desk import Desk
from tests.sim_crazyflie.simulated_flight import Flight

FORCE = 1e-5
"""N. The law's difference is 1e-6, its lead multiplies a moment's by up to 7."""


@pytest.fixture(scope="module")
def rings() -> dict[EngineName, Ring]:
    if find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot rehearse")
    with pytest.MonkeyPatch.context() as patch:
        found = {}
        for engine in EngineName:
            patch.setattr(Flight, "engine", engine)
            found[engine] = Desk().rehearse()
    return found


def test_they_record_the_same_ring(rings: dict[EngineName, Ring]) -> None:
    c, reference = rings[EngineName.C], rings[EngineName.REFERENCE]
    assert np.array_equal(c.ticks, reference.ticks)
    assert c.end_tick == reference.end_tick
    assert len(c.ticks) == 70
    law, wanted = c.periods["law"], reference.periods["law"]
    for name in ("position", "velocity", "quaternion", "gyro"):
        assert np.array_equal(law["estimate"][name], wanted["estimate"][name]), name
    assert np.array_equal(c.periods["cues"], reference.periods["cues"])
    assert np.abs(c.periods["trigger_value"] - reference.periods["trigger_value"]).max() <= 1e-6
    assert np.abs(c.periods["a_rot"] - reference.periods["a_rot"]).max() <= 1e-8
    assert np.abs(law["own_attitude"] - wanted["own_attitude"]).max() <= 1e-6
    assert np.abs(law["voltage"] - wanted["voltage"]).max() <= 1e-4
    assert np.abs(law["thrusts"] - wanted["thrusts"]).max() <= FORCE


def test_the_ring_holds_what_came_before_the_trigger_and_after(rings: dict[EngineName, Ring]) -> None:
    for ring in rings.values():
        assert ring.end_tick - ring.ticks[0] == 400
        assert 290 <= ring.ticks[-1] - ring.end_tick < 300
