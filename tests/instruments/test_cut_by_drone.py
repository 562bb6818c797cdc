"""Motors on a battery that nobody can switch off: the drone's own app must be there to stop them."""

import pytest

from calibration.bench.instruments.errors import MotorsRefused
from perchhw.bringup.motors import UNLOCK_PHRASE, motors
from perchhw.bringup.reaction import Reaction
from tests.patience import patient_uri
from tests.sim_crazyflie.minimal_firmware import MinimalFirmware, serve


def never(motor: int, _felt: Reaction) -> str:
    raise AssertionError(f"motor {motor} was turned")


def test_bringup_turns_nothing_on_firmware_without_our_app() -> None:
    with serve(MinimalFirmware(with_app=False)) as drone:
        with pytest.raises(
            MotorsRefused, match=r"no parameter perch\.motTok.*flash the firmware with our app"
        ):
            motors(patient_uri(drone.uri), UNLOCK_PHRASE, never)
        assert drone.firmware.params["motorPowerSet.enable"] == 0
