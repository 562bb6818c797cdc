"""Before an attempt, where the drone has flown: off the ceiling, back to its start mark, a fresh start."""

from collections.abc import Callable, Mapping

from onboard.link import reboot
from onboard.link.power import ask_supervisor
from onboard.link.stop_note import StopsSince
from perchhw.attempt import AttemptRequest, AttemptResult, AttemptRunner
from perchhw.flight.attempt import fly_attempt
from perchhw.flight.loop import OnLook, OnPhase
from perchhw.flight.recording import RecordListener
from perchhw.flight.warm_up import warm_up
from perchhw.supervisor import SafetyLimits

Confirm = Callable[[str], object]
"""Asks the operator to do something and returns when it is done."""

THE_DRONE = "the drone"
"""What a drone is called where there is no other."""


def off_the_ceiling(name: str = THE_DRONE) -> str:
    """What the operator is asked after a landing."""
    return f"Put {name} upright on its start mark facing +x (it may hang from the ceiling)"


class Turnaround:
    """Puts one drone back between its attempts, unless somebody stopped it since this was made.

    Args:
        drone: its URI.
        confirm: asks the operator for it.
        request: what the operator is asked; None: to take it off the ceiling.
        name: what it is called.

    Raises:
        LinkInputError: the URI cannot be used.
    """

    def __init__(
        self, drone: str, confirm: Confirm, request: str | None = None, name: str = THE_DRONE
    ) -> None:
        self._drone, self._confirm, self._name = drone, confirm, name
        self._request = request or off_the_ceiling(name)
        self._stops = StopsSince(drone)

    def put_back(self, request: str | None = None) -> None:
        """Have the operator put the drone on its start mark, then reboot it.

        Args:
            request: what the operator is asked this time; None: the usual.

        The reboot clears what a landing leaves behind: the tumble lock, the emergency-stop watchdog that bit
        when the host stopped kicking it, the triggered landing app. In the simulated lab the reboot is also
        what makes the simulated operator put the drone back.

        Raises:
            DroneStopped: somebody stopped it with ``perchhw stop``; a stop before the reboot is not undone.
            DroneIsFlying: it says that it flies; it was not rebooted.
            DroneInUse: another process talks to it.
            LinkError: the drone did not answer to the reboot.
        """
        self._stops.check()
        self._confirm(request or self._request)
        self._stops.check()
        reboot(self._drone)
        self._stops.check()  # from here on the flight sees that the drone is locked

    def put_back_if_needed(self) -> None:
        """As :meth:`put_back`, where the drone's own supervisor says that it cannot fly as it is.

        Every flight and every stop leaves it so. One that does not answer is left alone: who flies it hears
        why.
        """
        said = ask_supervisor(self._drone)
        if said is not None and (said.is_locked or said.is_tumbled or said.is_crashed):
            how = "is locked, as after every flight and every stop" if said.is_locked else "lies tumbled"
            who = "The drone" if self._name == THE_DRONE else self._name
            self.put_back(f"{who} {how}. Put it upright on its start mark facing +x; it will be rebooted")


def attempt_after_attempt(
    confirm: Confirm,
    on_phase: OnPhase | None = None,
    limits: SafetyLimits | None = None,
    listener: RecordListener | None = None,
    on_look: OnLook | None = None,
    begin: Callable[[AttemptRequest], object] = lambda _request: None,
    names: Mapping[str, str] | None = None,
) -> AttemptRunner:
    """A runner for campaigns: puts the drone back before every attempt, then flies it.

    Before the very first one it is left where it stands, unless it has flown or was stopped. Before the first
    attempt of a drone that is to warm up it hovers, and is put back once more. `begin` is told before either
    flight, `names` is what the drones at several addresses are called; the others are as for
    :func:`fly_attempt`.
    """
    turnarounds: dict[str, Turnaround] = {}
    before: str | None = None
    called = names or {}

    def run(request: AttemptRequest) -> AttemptResult:
        nonlocal before
        name = called.get(request.drone, THE_DRONE)
        if request.drone not in turnarounds:
            turnarounds[request.drone] = Turnaround(request.drone, confirm, name=name)
        turnaround = turnarounds[request.drone]
        if request.index > 0 or request.try_number > 1 or request.new_pack is not None:
            turnaround.put_back(_what_to_do(request, before, called))
        else:
            turnaround.put_back_if_needed()
        before = request.drone
        if request.warm_up_s > 0.0:
            begin(request)
            warm_up(request, on_phase, listener)
            turnaround.put_back(f"Put {name} upright on its start mark facing +x")
        begin(request)
        return fly_attempt(request, limits=limits, on_phase=on_phase, on_look=on_look, listener=listener)

    return run


def _what_to_do(request: AttemptRequest, before: str | None, names: Mapping[str, str]) -> str:
    """What the operator does before the attempt of `request`, after one of the drone `before`."""
    if before is None or before == request.drone:
        what = off_the_ceiling(names.get(request.drone, THE_DRONE))
    else:
        away, here = (names.get(drone, drone) for drone in (before, request.drone))
        what = f"Take {away} out of the room, put {here} upright on its start mark facing +x"
    return what if request.new_pack is None else f"{what}, with a charged battery ({request.new_pack})"
