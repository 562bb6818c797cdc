"""Tells the drone again and again that somebody looks after the motors of a bench test.

Our app on the drone stops motors whose host has vouched for them and then falls silent
(:data:`onboard.app_interface.Parameter.MOTOR_TOKEN`): the one remedy for a host that dies which needs no
supply that can be cut. Other firmware has no such parameter, and a simulated drone that is faster than the
clock of its host could not be told in time: there nothing is vouched for, as with the stock firmware.
"""

import threading
from collections.abc import Callable

from calibration.bench.instruments.errors import MotorsRefused
from onboard.app_interface import MOTOR_TOKEN_MS, Parameter
from onboard.clock import Clock
from onboard.link import DroneLink, LinkError

EVERY_S = 0.05
"""Four times within the drone's patience: three in a row may be lost, by a host that is 20 ms late."""


class MotorToken:
    """A thread that vouches while motors turn.

    Args:
        drone: open link.
        turning: whether they do.
        clock: host clock [s].

    Attributes:
        is_known: the drone has our app, which stops motors that nobody vouches for any more. A simulated one
            whose address asks for patience is not vouched for all the same; a real one's never does.
    """

    def __init__(self, drone: DroneLink, turning: Callable[[], bool], clock: Clock) -> None:
        self._drone, self._turning, self._clock = drone, turning, clock
        self.is_known = drone.has_param(Parameter.MOTOR_TOKEN)
        self._is_used = self.is_known and drone.patience <= 1.0
        self._vouched_at: float | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._vouch, name="MotorToken", daemon=True)
        if self._is_used:
            self._thread.start()

    def begin(self) -> None:
        """Vouch before the motors turn. Errors of the link."""
        if self._is_used:
            self._drone.set_param(Parameter.MOTOR_TOKEN, 1, retry_s=EVERY_S)
            self._vouched_at = self._clock()

    def check(self) -> None:
        """Raise MotorsRefused if a drone that talks was not told in time, for then it has stopped the motors.

        A drone that is silent itself is for others to judge.
        """
        if self._vouched_at is None or not self._turning() or self._drone.silence() > EVERY_S:
            return
        silent = self._clock() - self._vouched_at
        if silent > 1e-3 * MOTOR_TOKEN_MS:
            raise MotorsRefused(
                f"the drone stops its motors when it hears nothing for {1e-3 * MOTOR_TOKEN_MS:g} s, and it "
                f"has not heard us for {silent:.2f} s: the radio is bad, or this machine is busy"
            )

    def close(self) -> None:
        """Vouch no more."""
        self._closing.set()
        if self._is_used:
            self._thread.join()

    def _vouch(self) -> None:
        while not self._closing.wait(EVERY_S):
            if self._turning():
                try:
                    self.begin()
                except LinkError:
                    continue  # whoever turns the motors sees it too, and stops them
