"""Carrying out the supervisor's commands on the link, without ever holding up the supervisor."""

import queue
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING

from onboard.app_interface import Parameter, TrajectoryStatus
from onboard.clock import Clock
from onboard.errors import PerchhwError
from perchhw.errors import FlightStackError
from perchhw.flight.mission import AttemptPlan
from perchhw.supervisor import CommandDone, CommandFailed, Event, Order, StopConfirmed, StopUnconfirmed
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

    def submit(self, order: Order) -> None:
        """Start to carry out `order`."""
        urgent = isinstance(order.command, (*URGENT_COMMANDS, EmergencyStop))
        lane = self._urgent if urgent else self._normal
        lane.submit(self._carry_out, order.command).add_done_callback(partial(self._report, order))

    def _report(self, order: Order, result: "Future[int | None]") -> None:
        """Say what came of `order`. An error of any kind is a failed command: the supervisor aborts."""
        if result.cancelled():
            return
        error = result.exception()
        if isinstance(order.command, EmergencyStop):
            self._events.put(StopConfirmed() if error is None else StopUnconfirmed(repr(error)))
        elif error is None:
            self._events.put(CommandDone(order, result.result()))
        elif isinstance(error, PerchhwError):
            self._events.put(CommandFailed(order, str(error)))
        else:
            self._events.put(CommandFailed(order, f"error in perchhw: {error!r}"))

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
        ceiling_z: height of the ceiling, m.
    """

    def __init__(
        self,
        link: "DroneLink",
        events: "queue.Queue[Event]",
        plan: AttemptPlan,
        bundle: bytes,
        ceiling_z: float,
    ) -> None:
        super().__init__(link, events)
        self._plan = plan
        self._bundle = bundle
        self._ceiling_z = ceiling_z

    def _carry_out(self, command: Command) -> int | None:
        link = self._link
        match command:
            case UploadPolicy():
                return link.upload_policy(self._bundle)
            case ArmApproach():
                self._arm_approach()
            case StartApproach():
                link.set_param(Parameter.GO, 1)
            case Brake():
                link.set_param(Parameter.ABORT, 1)
            case Land():
                # A landing app that holds the drone hands it over when its switches are cleared, and tells
                # the commander to stay where it is: so the descent comes second.
                link.set_params({Parameter.POLICY_ARM: 0, Parameter.TRAJECTORY_ARM: 0})
                return super()._carry_out(command)
            case _:
                return super()._carry_out(command)
        return None

    def _arm_approach(self) -> None:
        """Hand the approach to the drone, arm it, and arm the policy: two separate switches."""
        approach = self._plan.approach
        self._link.set_params(
            {
                Parameter.CEILING_Z: self._ceiling_z,
                Parameter.IMPACT_X: float(approach.impact_x),
                Parameter.IMPACT_Y: float(approach.y0),
                Parameter.SPEED_X: float(approach.vx),
                Parameter.SPEED_Z: float(approach.vz),
                Parameter.ACCELERATION_X: float(approach.ax),
                Parameter.ACCELERATION_Z: float(approach.az),
                Parameter.TAU_START: float(approach.tau0),
            }
        )
        self._link.set_param(Parameter.TRAJECTORY_ARM, 1)
        status = TrajectoryStatus(int(self._link.param(Parameter.TRAJECTORY_STATUS)))
        if status is not TrajectoryStatus.ARMED:
            raise CommandRefusedOnboard(
                f"the drone refused the approach: {status.name.lower().replace('_', ' ')}"
            )
        self._link.set_param(Parameter.POLICY_ARM, 1)


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
