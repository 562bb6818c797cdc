"""Carrying out the supervisor's commands on the link, without ever holding up the supervisor.

Ordinary orders are carried out one after the other; urgent ones each on a thread of their own, behind
nobody. An emergency stop is none of these: it has :class:`onboard.link.stop.StopPath`.
"""

import logging
import threading
from typing import TYPE_CHECKING

from onboard.app_interface import Parameter
from onboard.errors import PerchhwError
from onboard.firmware.constants import vehicle_crc32
from onboard.link.landing_app import arm_approach, check_vehicle, disarm_policy, release
from onboard.link.strays import COMMAND_LIFETIME_S
from onboard.timebase import Event as Signal
from onboard.timebase import Queue, Timebase
from onboard.vehicle import Vehicle
from perchhw.errors import FlightStackError
from perchhw.flight.caught import Caught
from perchhw.flight.mission import AttemptPlan
from perchhw.flight.readback import ReadBack
from perchhw.supervisor import CommandDone, CommandFailed, Order
from perchhw.supervisor.events import (
    URGENT_COMMANDS,
    Arm,
    ArmApproach,
    Brake,
    Disarm,
    DisarmPolicy,
    GoTo,
    Land,
    StartApproach,
    TakeOff,
    UploadPolicy,
)

if TYPE_CHECKING:
    from onboard.link import DroneLink

_log = logging.getLogger(__name__)
_NEVER = 1 << 62


class CommandRefusedOnboard(FlightStackError):
    """The drone's landing app refused a command."""


class OrderRetired(FlightStackError):
    """The supervisor has taken an order back while it was being carried out."""


class CommandRunner:
    """Carries out orders; results come back as events that name the order.

    This one knows the commands that every flight has.

    Args:
        link: the open link; its calls have deadlines of their own.
        events: where :class:`CommandDone` and :class:`CommandFailed` are put.
        clock: time of the flight.
    """

    def __init__(self, link: "DroneLink", events: Queue, clock: Timebase) -> None:
        self._link = link
        self._events = events
        self._clock = clock
        self._oldest_in_force = 1
        self._waiting = clock.queue()
        # Guards the three below; held for a few instructions.
        self._lock = threading.Lock()
        self._unfinished = 0
        self._idle = clock.event()
        self._urgent_ended: list[Signal] = []
        self._lane_ended = clock.event()
        self._closed = clock.event()
        self._steered_until = float("-inf")
        """When the last of what takes a drone out of its landing had left, s."""
        self._idle.set()
        clock.thread(self._run_lane, "commands")

    def submit(self, order: Order) -> None:
        """Start to carry out `order`."""
        if isinstance(order.command, URGENT_COMMANDS):
            ended = self._clock.event()
            self._clock.thread(self._run_urgent, f"command-{order.number}", order, ended)
            self._urgent_ended.append(ended)  # of a thread that runs: closing waits for it
            return
        with self._lock:
            self._unfinished += 1
            self._idle.clear()
        self._waiting.put_nowait(order)

    def retire(self, oldest_in_force: int) -> None:
        """Orders older than this one are dropped where they wait, and break off at their next step."""
        self._oldest_in_force = oldest_in_force

    def in_force(self, order: Order) -> bool:
        """Whether the supervisor still wants `order`."""
        return order.number >= self._oldest_in_force

    def _run_lane(self) -> None:
        try:
            while (order := self._waiting.get()) is not None:
                if self.in_force(order):
                    self._answer(order)
                with self._lock:
                    self._unfinished -= 1
                    if self._unfinished == 0:
                        self._idle.set()
        finally:
            self._lane_ended.set()

    def _run_urgent(self, order: Order, ended: Signal) -> None:
        """At once; and once more when an older order that was just running can no longer undo it."""
        try:
            begun, overtaken = self._clock(), not self._idle.is_set()
            self._answer(order)
            if overtaken:
                self._idle.wait()
                self._answer(order, again=True)
            if isinstance(order.command, Land) and begun < self._steered_until + COMMAND_LIFETIME_S:
                self._land_again(order, order.command.duration)
        finally:
            ended.set()

    def _land_again(self, order: Order, duration: float) -> None:
        """Order the landing a second time, when no copy of what was sent before is under way.

        The planner takes a GoTo also when it lands. A copy that left before the order to land may come behind
        it, and one may leave behind it, from a thread that had it in its hands; none comes once the GoTo has
        ended for :data:`COMMAND_LIFETIME_S`. Nor is then an answer to the first order under way that could be
        taken for one to the second: this is repeated until the drone has answered it itself, and is the last
        that the planner hears. A drone that lands goes on with its descent: its planner refuses it.
        """
        self._closed.wait(COMMAND_LIFETIME_S)
        if self.in_force(order):
            with Caught(lambda error: self._failed(order, error)):
                self._land_on(order, duration)

    def _answer(self, order: Order, again: bool = False) -> None:
        """Carry out `order` and say what came of it. An error of any kind is a failed command."""
        with Caught(lambda error: self._failed(order, error)):
            if again:
                self._carry_out_again(order)
            else:
                self._events.put_nowait(CommandDone(order, self._carry_out(order)))

    def _failed(self, order: Order, error: BaseException) -> None:
        if isinstance(error, PerchhwError):
            self._events.put_nowait(CommandFailed(order, str(error)))
            return
        _log.error("error in perchhw while it carried out %s", order, exc_info=error)
        self._events.put_nowait(CommandFailed(order, f"error in perchhw: {error!r}"))

    def _carry_out(self, order: Order) -> int | None:
        link = self._link
        match order.command:
            case Arm():
                link.kick_emergency_stop_watchdog()  # a host that dies in this very moment must stop it too
                link.arm()
            case TakeOff(height, duration):
                link.takeoff(height, duration, wanted=lambda: self.in_force(order))
            case GoTo(position, duration):
                try:
                    link.go_to(*position, 0.0, duration, wanted=lambda: self.in_force(order))
                finally:
                    self._steered_until = self._clock()
            case Land(duration):
                link.land(0.0, duration, wanted=lambda: self.in_force(order))
            case Disarm():
                link.stop_motors()
                link.disarm()
            case other:
                raise CommandRefusedOnboard(f"this kind of flight has no {type(other).__name__}")
        return None

    def _carry_out_again(self, order: Order) -> None:
        """What must be repeated of an urgent order, at once; of a descent see :meth:`_land_again`."""
        if not isinstance(order.command, Land):
            self._carry_out(order)

    def _land_on(self, order: Order, duration: float) -> None:
        """Land within `duration` s, unless the drone is landing."""
        self._link.land(0.0, duration, again=True, wanted=lambda: self.in_force(order))

    def _require(self, order: Order) -> None:
        if not self.in_force(order):
            raise OrderRetired(f"{order} was taken back")

    def close(self) -> None:
        """Wait for what is running (its deadline bounds the wait) and drop what is not."""
        self._oldest_in_force = _NEVER
        self._closed.set()
        self._waiting.put_nowait(None)
        for ended in (self._lane_ended, *self._urgent_ended):
            ended.wait()


class LandingCommands(CommandRunner):
    """The commands of a landing attempt.

    Args:
        link, events, clock: as :class:`CommandRunner`.
        readback: where the switches go, as they were read back.
        plan: what is flown.
        bundle: the policy bundle to upload.
        vehicle: what the host believes the drone to be; its firmware must have been built for it. None: it
            may be another one.
    """

    def __init__(
        self,
        link: "DroneLink",
        events: Queue,
        clock: Timebase,
        readback: ReadBack,
        plan: AttemptPlan,
        bundle: bytes,
        vehicle: Vehicle | None,
    ) -> None:
        super().__init__(link, events, clock)
        self._readback = readback
        self._plan = plan
        self._bundle = bundle
        self._vehicle = vehicle

    def _carry_out(self, order: Order) -> int | None:
        link = self._link
        match order.command:
            case UploadPolicy():
                if self._vehicle is not None:
                    check_vehicle(link, vehicle_crc32(self._vehicle), self._vehicle.name)
                live = link.upload_policy(self._bundle)
                self._check_settings_again()
                return live
            case ArmApproach():
                self._arm_approach(order)
            case StartApproach():
                link.set_param(Parameter.GO, 1)
            case Brake():
                link.set_param(Parameter.ABORT, 1)
                self._disarm_policy()
            case DisarmPolicy():
                self._disarm_policy()
            case Land():
                # The app that has the drone hands it over and tells the planner where it is: the descent
                # comes second.
                self._release()
                return super()._carry_out(order)
            case _:
                return super()._carry_out(order)
        return None

    def _carry_out_again(self, order: Order) -> None:
        if isinstance(order.command, Land):
            self._release()
        super()._carry_out_again(order)

    def _release(self) -> None:
        """Take the drone back: both switches read as off, and the app has let go."""
        self._readback.switches_are(None)
        release(self._link, self._clock)
        self._readback.switches_are(False)

    def _check_settings_again(self) -> None:
        """The settings as they are now: once the upload has ended, nothing but the order to arm follows."""
        self._readback.check_again(self._link)
        if not self._readback.parameters_ok:
            raise CommandRefusedOnboard(f"parameters: {self._readback.parameters_problem}")

    def _disarm_policy(self) -> None:
        """Switch it off. A brake that works is not given up for this: the supervisor tells what stays on."""
        with Caught(lambda error: _log.warning("the policy was not switched off", exc_info=error)):
            disarm_policy(self._link)
            self._readback.policy_armed = False

    def _arm_approach(self, order: Order) -> None:
        """Hand the approach to the drone, arm it, and arm the policy."""
        self._readback.switches_are(None)
        arm_approach(self._link, self._plan.approach, self._clock, before_switch=lambda: self._require(order))
        self._readback.switches_are(True)
