"""The commands of a test flight: its course goes out as a stream of setpoints."""

import threading
from typing import TYPE_CHECKING

from onboard.timebase import Queue, Timebase
from perchhw.flight.actions import CommandRunner
from perchhw.flight.caught import Caught
from perchhw.supervisor import Order
from perchhw.supervisor.events import FlyCourse, Land

if TYPE_CHECKING:
    from onboard.link import DroneLink
    from onboard.manoeuvres import Course

SETPOINT_PERIOD = 0.02
"""s between two setpoints of a course: 50 Hz leaves the radio room for poses and logs."""


class CourseCommands(CommandRunner):
    """A runner that streams a course on a thread of its own.

    Args:
        link, events, clock: as :class:`CommandRunner`.
        course: what is flown.
    """

    def __init__(self, link: "DroneLink", events: Queue, clock: Timebase, course: "Course") -> None:
        super().__init__(link, events, clock)
        self._course = course
        self._flown = clock.event()
        self._ended = clock.event()
        self._stream_ended = clock.event()
        self._stream_ended.set()
        self._sending = threading.Lock()
        self._streams = False
        self._failure: BaseException | None = None

    def _carry_out(self, order: Order) -> int | None:
        match order.command:
            case FlyCourse():
                self._streams = True
                self._stream_ended.clear()
                self._clock.thread(self._stream, "setpoints")
                self._flown.wait()
                if self._failure is not None:
                    raise self._failure
            case Land():
                with self._sending:
                    self._ended.set()
                    if self._streams:
                        self._link.end_setpoints()
                        self._steered_until = self._clock()
                return super()._carry_out(order)
            case _:
                return super()._carry_out(order)
        return None

    def _land_on(self, order: Order, duration: float) -> None:
        """A setpoint that came behind the order to land has the drone from the planner: it is over."""
        if self._streams:
            self._link.end_setpoints()
        super()._land_on(order, duration)

    def _stream(self) -> None:
        with Caught(self._broken):
            self._send_course()
        self._flown.set()
        self._stream_ended.set()

    def _broken(self, error: BaseException) -> None:
        self._failure = error

    def _send_course(self) -> None:
        """Send the course in its time, then its last setpoint, until the landing ends it."""
        course, begin, count = self._course, self._clock(), 0
        while True:
            elapsed = self._clock() - begin
            sample = course.index_at(elapsed)
            with self._sending:
                if self._ended.is_set():
                    return
                self._link.send_full_state(*course.setpoint(sample))
            if elapsed > course.duration:
                self._flown.set()
            count += 1
            if self._ended.wait(max(0.0, begin + count * SETPOINT_PERIOD - self._clock())):
                return

    def close(self) -> None:
        """End the stream, then as :meth:`CommandRunner.close`."""
        self._ended.set()
        self._stream_ended.wait()
        super().close()
