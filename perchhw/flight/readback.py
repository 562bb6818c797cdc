"""What was asked of the drone itself rather than logged by it: settings that matter, and our two switches."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from onboard.app_interface import Parameter
from onboard.link.errors import LinkError

if TYPE_CHECKING:
    from onboard.link import DroneLink

_COMMON: Final = {
    "stabilizer.estimator": 2,  # Kalman; the complementary filter takes no poses
    "powerDist.idleThrust": 0,  # else motors turn as soon as they are armed
    "motorPowerSet.enable": 0,  # else the bench's override has the motors, and no stop reaches them
}
TEST_FLIGHT_SETTINGS: Mapping[str, int] = _COMMON
"""Stock firmware; its controller may be any."""
LANDING_SETTINGS: Mapping[str, int] = {"stabilizer.controller": 6, **_COMMON}
"""Our firmware: the controller is the landing app (out of tree)."""

OWN_LAW: Mapping[str, int] = {Parameter.OWN_LAW: 1}
"""Beside these, where our law shall fly take-off, hover and level-out too."""


@dataclass
class ReadBack:
    """The newest answers of the drone.

    Attributes:
        parameters_ok: every setting is as it must be; None before it was asked.
        parameters_problem: which one is not, in words.
        policy_armed, trajectory_armed: the landing app's switches; None when not asked, or not answered.
    """

    parameters_ok: bool | None = None
    parameters_problem: str | None = None
    policy_armed: bool | None = None
    trajectory_armed: bool | None = None
    _needed: Mapping[str, int] | None = field(default=None, init=False, repr=False)

    def check_settings(self, link: "DroneLink", needed: Mapping[str, int]) -> None:
        """Read every setting that is `needed` and compare."""
        self._needed = needed
        self.check_again(link)

    def check_again(self, link: "DroneLink") -> None:
        """Read them once more: somebody else may have changed them since."""
        needed = self._needed
        if needed is None:
            return
        problems = [text for name, value in needed.items() if (text := _problem(link, name, value))]
        self.parameters_ok = not problems
        self.parameters_problem = "; ".join(problems) or None

    def refuse(self, problem: str) -> None:
        """Count `problem` as one more that the parameters have."""
        self.parameters_ok = False
        self.parameters_problem = "; ".join(filter(None, (self.parameters_problem, problem)))

    def switches_are(self, on: bool | None) -> None:
        """Both switches read back as `on`; None while that is not known."""
        self.policy_armed = self.trajectory_armed = on


def _problem(link: "DroneLink", name: str, needed: int) -> str | None:
    try:
        value = link.param(name)
    except LinkError as error:
        return f"{name} is not known: {error}"
    return None if value == needed else f"{name} is {value:g}, need {needed}"
