"""Carrying out the supervisor's commands on the link, without ever holding up the supervisor."""

import queue
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING

from onboard.app_interface import Parameter
from onboard.clock import Clock
from onboard.errors import PerchhwError
from onboard.link.landing_app import arm_approach, check_vehicle, release
from onboard.vehicle import Vehicle
from onboard.vehicle.onboard_constants import vehicle_crc32
from perchhw.errors import FlightStackError
from perchhw.flight.mission import AttemptPlan
from perchhw.supervisor import CommandDone, CommandFailed, Event
from perchhw.supervisor.events import (
    URGENT_COMMANDS,
    Arm,
    ArmApproach,
    Brake,
    Command,
    Disarm,
    EmergencyStop,
    FlyCourse,
    GoTo,
    Land,
    StartApproach,
    TakeOff,
    UploadPolicy,
)

if TYPE_CHECKING:
    from calibration.gap.suggest.course import Course
    from onboard.link import DroneLink


class CommandRefusedOnboard(FlightStackError):
    """The drone's landing app refused a command."""


class CommandRunner:
    """Runs commands in order on a thread of its own, urgent ones on a second; results come back as events.

    This one knows the commands that every flight has.

    Args:
        link: the open link; its calls have deadlines of their own.
        events: where :class:`CommandDone` and :class:`CommandFailed` are put.
    """

    def __init__(self, link: "DroneLink", events: "queue.Queue[Event]") -> None:
        self._link = link
        self._events = events
        self._normal = ThreadPoolExecutor(1, "commands")
        self._urgent = ThreadPoolExecutor(1, "urgent-commands")

    def submit(self, command: Command) -> None:
        """Start to carry out `command`."""
        lane = self._urgent if isinstance(command, URGENT_COMMANDS) else self._normal
        lane.submit(self._carry_out, command).add_done_callback(partial(self._report, command))

    def _report(self, command: Command, result: "Future[int | None]") -> None:
        """Say what came of `command`. An error of any kind is a failed command: the supervisor aborts."""
        if result.cancelled():
            return
        error = result.exception()
        if error is None:
            self._events.put(CommandDone(command, result.result()))
        elif isinstance(error, PerchhwError):
            self._events.put(CommandFailed(command, str(error)))
        else:
            self._events.put(CommandFailed(command, f"error in perchhw: {error!r}"))

    def _carry_out(self, command: Command) -> int | None:
        link = self._link
        match command:
            case Arm():
                link.arm()
            case TakeOff(height, duration):
                link.takeoff(height, duration)
            case GoTo(position, duration):
                link.go_to(*position, 0.0, duration)
            case Land(duration):
                link.land(0.0, duration)
            case Disarm():
                link.stop_motors()
                link.disarm()
            case EmergencyStop():
                link.emergency_stop()
            case _:
                raise CommandRefusedOnboard(f"this kind of flight has no {type(command).__name__}")
        return None

    def close(self) -> None:
        """Wait for what is running (its deadline bounds the wait) and drop what is not."""
        for lane in (self._normal, self._urgent):
            lane.shutdown(wait=True, cancel_futures=True)


class LandingCommands(CommandRunner):
    """The commands of a landing attempt.

    Args:
        link, events: as :class:`CommandRunner`.
        plan: what is flown.
        bundle: the policy bundle to upload.
        vehicle: what the host believes the drone to be; its firmware must have been built for it.
    """

    def __init__(
        self,
        link: "DroneLink",
        events: "queue.Queue[Event]",
        plan: AttemptPlan,
        bundle: bytes,
        vehicle: Vehicle,
    ) -> None:
        super().__init__(link, events)
        self._plan = plan
        self._bundle = bundle
        self._vehicle = vehicle

    def _carry_out(self, command: Command) -> int | None:
        link = self._link
        match command:
            case UploadPolicy():
                check_vehicle(link, vehicle_crc32(self._vehicle), self._vehicle.name)
                return link.upload_policy(self._bundle)
            case ArmApproach():
                arm_approach(link, self._plan.approach)
            case StartApproach():
                link.set_param(Parameter.GO, 1)
            case Brake():
                link.set_param(Parameter.ABORT, 1)
            case Land():
                # The app that has the drone hands it over and tells the planner where it is: the descent
                # comes second.
                release(link)
                return super()._carry_out(command)
            case _:
                return super()._carry_out(command)
        return None


SETPOINT_PERIOD = 0.02
"""s between two setpoints of a course: 50 Hz leaves the radio room for poses and logs."""


class CourseCommands(CommandRunner):
    """The commands of a test flight: its course goes out as a stream of setpoints.

    Args:
        link, events: as :class:`CommandRunner`.
        course: what is flown.
        clock: monotonic clock, s.
    """

    def __init__(
        self, link: "DroneLink", events: "queue.Queue[Event]", course: "Course", clock: Clock
    ) -> None:
        super().__init__(link, events)
        self._course = course
        self._clock = clock
        self._finished = threading.Event()
        self._ended = threading.Event()
        self._sending = threading.Lock()
        self._stream: Future[None] | None = None
        self._streaming = ThreadPoolExecutor(1, "setpoints")

    def _carry_out(self, command: Command) -> int | None:
        match command:
            case FlyCourse():
                self._stream = self._streaming.submit(self._send_course)
                self._stream.add_done_callback(lambda _: self._finished.set())
                self._finished.wait()
                if self._stream.done():
                    self._stream.result()
            case Land():
                with self._sending:
                    self._ended.set()
                    if self._stream is not None:
                        self._link.end_setpoints()
                return super()._carry_out(command)
            case _:
                return super()._carry_out(command)
        return None

    def _send_course(self) -> None:
        """Send the course in real time, then its last setpoint, until the landing ends it."""
        course, begin, count = self._course, self._clock(), 0
        while True:
            elapsed = self._clock() - begin
            sample = course.index_at(elapsed)
            with self._sending:
                if self._ended.is_set():
                    return
                self._link.send_full_state(*course.setpoint(sample))
            if elapsed > course.duration:
                self._finished.set()
            count += 1
            if self._ended.wait(max(0.0, begin + count * SETPOINT_PERIOD - self._clock())):
                return

    def close(self) -> None:
        """End the stream, then as :meth:`CommandRunner.close`."""
        self._ended.set()
        self._streaming.shutdown(wait=True)
        super().close()
