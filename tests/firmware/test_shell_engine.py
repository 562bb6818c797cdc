"""The whole landing app, shell included, flies the simulated drone to the ceiling.

With ``-m further`` all tests of the app run so (``either_engine`` of tests/sim_crazyflie).
"""

import pytest

from onboard.firmware.compiler import find_compiler
from sim_backend.crazyflie import firmware
from tests.firmware.shell_engine import ShellEngine
from tests.sim_crazyflie import test_landing_app as app


@pytest.mark.further  # the same code without its shell: tests/sim_crazyflie/test_landing_app.py
def test_it_lands_on_four_feet(monkeypatch: pytest.MonkeyPatch) -> None:
    if find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot fly")
    monkeypatch.setattr(firmware, "make_engine", lambda _, vehicle: ShellEngine(vehicle))
    app.test_approach_triggers_flips_cuts_and_lands_on_four_feet()
