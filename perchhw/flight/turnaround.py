"""Between two attempts: the drone comes off the ceiling, back to its start mark, and starts afresh."""

from collections.abc import Callable

from onboard.link import reboot
from perchhw.attempt import AttemptRequest, AttemptResult, AttemptRunner
from perchhw.flight.attempt import fly_attempt
from perchhw.flight.loop import OnPhase
from perchhw.supervisor import SafetyLimits

Confirm = Callable[[str], None]
"""Asks the operator to do something and returns when it is done."""

PUT_BACK = "Take the drone off the ceiling, put it upright on its start mark facing +x"


def put_back(drone: str, confirm: Confirm) -> None:
    """Have the operator put the drone on its start mark, then reboot it.

    The reboot clears what a landing leaves behind: the tumble lock, the emergency-stop watchdog that bit when
    the host stopped kicking it, the triggered landing app. In the simulated lab the reboot is also what makes
    the simulated operator put the drone back.

    Raises:
        DroneIsFlying: it says that it flies; it was not rebooted. DroneInUse: another process talks to it.
        LinkError: the drone did not answer to the reboot.
    """
    confirm(PUT_BACK)
    reboot(drone)


def attempt_after_attempt(
    confirm: Confirm, on_phase: OnPhase | None = None, limits: SafetyLimits | None = None
) -> AttemptRunner:
    """A runner for campaigns: puts the drone back before every attempt but the very first, then flies it."""

    def run(request: AttemptRequest) -> AttemptResult:
        if request.index > 0 or request.try_number > 1:
            put_back(request.drone, confirm)
        return fly_attempt(request, limits=limits, on_phase=on_phase)

    return run
