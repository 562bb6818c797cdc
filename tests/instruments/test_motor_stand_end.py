"""Ctrl-C while a motor stand closes: nothing else would stop the motors of a drone with stock firmware."""

import itertools
import sys
from types import FrameType

from calibration.bench.instruments import motor_stand
from calibration.bench.instruments.errors import MotorsNotStopped
from calibration.bench.instruments.set_points import pwm
from onboard.link import reboot
from tests.instruments.stand import STILL, Witness, motors, unlocked
from tests.patience import PATIENCE_S, patient_link, until


class Key:
    """A trace function that presses Ctrl-C before the line number `at` of the bench's closing code is run."""

    FILE = motor_stand.__file__

    def __init__(self, at: int) -> None:
        self._to_go = at
        self.was_pressed = False

    def __call__(self, frame: FrameType, event: str, _arg: object) -> "Key | None":
        if frame.f_code.co_filename != self.FILE:
            return None
        if event == "line":
            if self._to_go == 0:
                self.was_pressed = True
                raise KeyboardInterrupt
            self._to_go -= 1
        return self


def test_ctrl_c_at_any_line_of_the_end_stops_the_motors_all_the_same(crazyflie_uri: str) -> None:
    """Also between two lines that look harmless. Before the first one it is as if nobody renewed."""
    reboot(crazyflie_uri, timeout_s=PATIENCE_S)
    with patient_link(crazyflie_uri) as drone:
        witness = Witness(drone)
        for at in itertools.count(1):
            witness.seen.clear()
            stand, key = unlocked(drone), Key(at)
            stand.spin({1: pwm(60)})
            motors(stand, (pwm(60), 0, 0, 0), witness)
            sys.settrace(key)
            try:
                stand.close()
            except (KeyboardInterrupt, MotorsNotStopped):  # the key came before the drone's word
                assert key.was_pressed
            finally:
                sys.settrace(None)
            until(lambda stand=stand: stand.stopped is not None)
            assert stand.stopped is not None
            assert stand.stopped.confirmed, at
            witness.await_ratios(STILL)
            stand.close()
            if not key.was_pressed:
                break
        assert at > 10
        witness.close()
