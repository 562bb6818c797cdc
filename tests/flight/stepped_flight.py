"""The flight's loop with the simulated drone in the same process, in steps: its waits are what moves time.

Every part that the loop calls stands behind a :class:`Trap`, which can throw when it is touched.
"""

import queue
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from mocap_bridge.health import PoseVerdict
from onboard.link.stop import StopReport
from onboard.timebase import WallTime
from perchhw.flight.actions import CommandRunner
from perchhw.flight.host_load import Lateness
from perchhw.flight.interrupts import OperatorInterrupts
from perchhw.flight.kicker import WatchdogKicker
from perchhw.flight.loop import FlightLoop
from perchhw.flight.recording import FlightRecorder
from perchhw.record import RunRecorder
from perchhw.supervisor import FlightState, Mission, Observation, Order, Phase, SafetyLimits
from sim_backend.engine_name import usable_engine
from tests.sim_crazyflie.simulated_flight import Flight

HOVER = 0.6
LONGEST_S = 60.0


class Injected(Exception):
    """What a trap throws: an error that nobody expects."""


@dataclass
class Injection:
    """Throws at one place, when the flight has come to a phase: once, or from then on. Or stands still there,
    once, for some seconds."""

    place: str = ""
    phase: Phase = Phase.TAKING_OFF
    always: bool = False
    error: type[BaseException] = Injected
    thrown: int = 0
    touched: set[str] = field(default_factory=set)
    stands_still_s: float = 0.0
    state: Any = None
    wait: Any = None

    def touch(self, place: str) -> None:
        """Somebody is about to use `place`."""
        self.touched.add(place)
        if place != self.place or (self.thrown and not self.always):
            return
        if self.thrown or (self.state is not None and self.state().phase is self.phase):
            self.thrown += 1
            if self.stands_still_s:
                self.wait(self.stands_still_s)
                return
            raise self.error(place)


class Trap:
    """Stands for `target`; every use of it passes the injection first."""

    def __init__(self, name: str, target: Any, injection: Injection) -> None:
        self._name, self._target, self._injection = name, target, injection

    def __getattr__(self, attribute: str) -> Any:
        self._injection.touch(f"{self._name}.{attribute}")
        return getattr(self._target, attribute)

    def __call__(self, *arguments: Any) -> Any:
        self._injection.touch(f"{self._name}()")
        return self._target(*arguments)


class SteppedTime(WallTime):
    """Time that goes on when the loop waits, and then with the drone. Threads are not started."""

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        super().__init__(lambda: flight.world.time)

    def thread(self, target: Any, name: str, *args: object) -> threading.Thread:
        """Not started: in here all is done by the loop's own thread."""
        return threading.Thread()

    def event(self) -> Any:
        """An event whose waits move time."""
        return _SteppedEvent(self.flight)


class _SteppedEvent(threading.Event):
    def __init__(self, flight: Flight) -> None:
        super().__init__()
        self._flight = flight

    def wait(self, timeout: float | None = None) -> bool:
        self._flight.run(timeout or 0.0)
        return self.is_set()


class SteppedQueue:
    """Answers to orders; waiting for one moves time."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._items: deque[Any] = deque()

    def put_nowait(self, item: Any) -> None:
        """Add an item."""
        self._items.append(item)

    def get(self, *, timeout: float) -> Any:
        """The oldest item, or time passes."""
        if not self._items:
            self._flight.run(timeout)
            raise queue.Empty
        return self._items.popleft()


class DirectRunner(CommandRunner):
    """Carries every order out at once."""

    def submit(self, order: Order) -> None:
        """Start and finish."""
        self._answer(order)


class DirectRecorder(FlightRecorder):
    """Writes at once: what fails is told in the step in which it does."""

    def _later(self, call: Callable[[], object]) -> None:
        if self._lost is None and not self._closed:
            with self._losing:
                call()


class TrappedLateness(Lateness):
    """How late the loop is, which passes the injection first."""

    def __init__(self, injection: Injection) -> None:
        super().__init__()
        self._injection = injection

    def note(self, late: float) -> None:
        """As the usual one."""
        self._injection.touch("lateness.note")
        super().note(late)


class DirectLink:
    """The drone's commander and supervisor without packets, and a stop path without a network."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self.lost: Exception | None = None
        self.report: StopReport | None = None

    def kick_emergency_stop_watchdog(self) -> None:
        """Its watchdog is not kicked: there is no thread here that would go on kicking."""

    def arm(self) -> None:
        """As the link's."""
        assert self._flight.firmware.supervisor.arm(True)

    def disarm(self) -> None:
        """As the link's."""
        self._flight.firmware.supervisor.arm(False)

    def takeoff(self, height: float, duration: float, **_wanted: object) -> None:
        """As the link's."""
        self._flight.takeoff(height, duration)

    def go_to(self, x: float, y: float, z: float, _yaw: float, duration: float, **_wanted: object) -> None:
        """As the link's."""
        self._flight.go_to(x, y, z, duration)

    def land(self, _height: float, duration: float, **_wanted: object) -> None:
        """As the link's."""
        self._flight.land(duration)

    def stop_motors(self) -> None:
        """The disarming that follows stops them."""

    def trigger(self) -> None:
        """Stop; the drone reports it within two rounds of its supervisor."""
        self._flight.firmware.supervisor.emergency_stop()
        self._flight.run(0.2)
        self.report = StopReport(self._flight.info.is_locked, "", 0.2, 1)

    def observe(self) -> Observation:
        """What telemetry would say."""
        flight = self._flight
        _, position, quaternion = flight.drone.pose()
        estimate = [flight.log(f"stateEstimate.{name}") for name in ("x", "y", "z", "vx", "vy", "vz")]
        attitude = [flight.log(f"stateEstimate.{name}") for name in ("qx", "qy", "qz", "qw")]
        return Observation(
            link_silence=0.01,
            pose_verdict=PoseVerdict.OK,
            pose_age=0.01,
            pose_position=position,
            pose_quaternion=quaternion,
            estimate_age=0.01,
            estimate_position=(estimate[0], estimate[1], estimate[2]),
            estimate_velocity=(estimate[3], estimate[4], estimate[5]),
            estimate_quaternion=(attitude[0], attitude[1], attitude[2], attitude[3]),
            rates_age=0.01,
            body_rates=(0.0, 0.0, 0.0),
            drone=flight.info,
            drone_age=0.01,
            battery_voltage=flight.log("pm.vbat"),
            battery_age=0.01,
            parameters_ok=True,
        )


class _Drone(Flight):
    engine = usable_engine(None)
    """The host's loop is the matter, not which code the drone runs: the faster one."""


class _Bridge:
    def set_in_flight(self, in_flight: bool) -> None:
        """A pose bridge is told whether it flies."""


@dataclass(frozen=True)
class Stepped:
    """How it ended: the supervisor's last state, the drone, the greatest speed of its way down, m/s, and how
    late the loop's looks were at most, s.
    """

    state: FlightState
    flight: Flight
    fastest_fall: float
    late_s: float


class Flown(NamedTuple):
    """What is flown: by which link, who carries the orders out, and what the supervisor works towards."""

    link: DirectLink
    commands: CommandRunner
    mission: Mission


def hover_only(flight: Flight, time: SteppedTime, events: SteppedQueue) -> Flown:
    """A hover, and a course whose end never comes."""
    link = DirectLink(flight)
    mission = Mission(
        policy_crc=0,
        start=(*flight.position[:2], HOVER),  # type: ignore[arg-type]
        hover_height=HOVER,
        approach_duration=1.0,
        test_flight=True,
    )
    return Flown(link, DirectRunner(link, events, time), mission)  # type: ignore[arg-type]


def fly(
    folder: Path,
    injection: Injection,
    recorder: type[FlightRecorder] = DirectRecorder,
    flown: Callable[[Flight, SteppedTime, SteppedQueue], Flown] = hover_only,
) -> Stepped:
    """Fly until the supervisor is done: as planned, or otherwise because of what is injected."""
    flight = _Drone()
    flight.run(1.0)
    time, events = SteppedTime(flight), SteppedQueue(flight)
    link, runner, mission = flown(flight, time, events)
    speeds: list[float] = []
    tick = flight.tick

    def tick_and_note() -> None:
        tick()
        speeds.append(float(flight.drone.state["velocity"][2]))
        assert flight.world.time < LONGEST_S, "the flight does not end"

    flight.tick = tick_and_note  # type: ignore[method-assign]

    def trap(name: str, target: Any) -> Any:
        return Trap(name, target, injection)

    link.stop_path = trap("stop_path", link)  # type: ignore[attr-defined]
    with (
        RunRecorder(folder, {}) as written,
        recorder(trap("recorder", written)) as record,
        OperatorInterrupts() as interrupts,
    ):
        loop = FlightLoop(
            clock=trap("clock", time),
            link=trap("link", link),
            bridge=trap("bridge", _Bridge()),
            telemetry=trap("telemetry", link),
            commands=trap("commands", runner),
            record=trap("record", record),
            interrupts=trap("interrupts", interrupts),
            kicker=trap("kicker", WatchdogKicker(link, time)),  # type: ignore[arg-type]
            events=trap("events", events),
            mission=mission,
            limits=SafetyLimits(),
            on_phase=trap("on_phase", lambda _state: None),
            on_look=trap("on_look", lambda _state, _observation: None),
            lateness=TrappedLateness(injection),
        )
        injection.state, injection.wait = lambda: loop.state, flight.run
        state = loop.run()
    flight.run(2.0)
    return Stepped(state, flight, -min(speeds), loop.lateness.worst)
