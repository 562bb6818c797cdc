"""The simulated drone's high-level commander: take-off, landing, go-to and uploaded polynomial trajectories.

Commands and their errors as in bitcraze/crazyflie-firmware 2026.08 (``crtp_commander_high_level.c``,
``planner.c``, ``pptraj.c``). Left out, answered ENOEXEC: spirals and
compressed trajectories. Group mask 0 of a command means everybody.
"""

import errno
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from onboard.arrays import FloatArray, Vector
from onboard.supervisor_info import SupervisorBits
from sim_backend.crazyflie.memory import TRAJECTORY_SIZE
from sim_backend.crazyflie.setpoint import ZERO, Mode, Setpoint

NUMBER_OF_DEFINITIONS = 31
POLYNOMIAL_PIECE = struct.Struct("<33f")  # x, y, z, yaw with 8 coefficients each, then the duration
_N = np.arange(8)
_N_TWICE = _N[2:] * _N[1:7]
"""What derivatives bring down: of a power, and of one that is derived twice."""


class HighLevelCommand(IntEnum):
    """First byte of a packet on port 8."""

    SET_GROUP_MASK = 0
    TAKEOFF = 1
    LAND = 2
    STOP = 3
    GO_TO = 4
    START_TRAJECTORY = 5
    DEFINE_TRAJECTORY = 6
    TAKEOFF_2 = 7
    LAND_2 = 8
    TAKEOFF_WITH_VELOCITY = 9
    LAND_WITH_VELOCITY = 10
    SPIRAL = 11
    GO_TO_2 = 12
    START_TRAJECTORY_2 = 13


class PlannerState(IntEnum):
    """State of the planner, numbered as in the firmware."""

    IDLE = 0
    FLYING = 1
    LANDING = 3
    DISABLED = 4


@dataclass(frozen=True, slots=True)
class FlatState:
    """Where a plan is or starts from: position [m], velocity, acceleration, yaw [rad], yaw rate [rad/s]."""

    position: Vector = ZERO
    velocity: Vector = ZERO
    acceleration: Vector = ZERO
    yaw: float = 0.0
    yaw_rate: float = 0.0


def smooth_polynomial(
    duration: float, start: Vector, end: Vector
) -> tuple[float, float, float, float, float, float, float, float]:
    """Coefficients c0..c7 of the 7th order polynomial between two (value, rate, acceleration) triples.

    The jerk is zero at both ends. A duration <= 0 holds the end values.
    """
    x0, v0, a0 = start
    x1, v1, a1 = end
    if duration <= 0.0:
        return (x1, v1, a1 / 2.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    # In s = t / duration the end conditions are numbers; d are the residuals the four upper terms must close.
    t = duration
    d0 = x1 - x0 - v0 * t - a0 * t * t / 2.0
    d1 = (v1 - v0 - a0 * t) * t
    d2 = (a1 - a0) * t * t
    b4 = 35.0 * d0 - 15.0 * d1 + 2.5 * d2
    b5 = -84.0 * d0 + 39.0 * d1 - 7.0 * d2
    b6 = 70.0 * d0 - 34.0 * d1 + 6.5 * d2
    b7 = -20.0 * d0 + 10.0 * d1 - 2.0 * d2
    return (x0, v0, a0 / 2.0, 0.0, b4 / t**4, b5 / t**5, b6 / t**6, b7 / t**7)


def wrap(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    return math.atan2(math.sin(angle), math.cos(angle))


@dataclass(slots=True)
class Trajectory:
    """Polynomial pieces in a row: coefficients (pieces, 4, 8) of x, y, z, yaw and durations (pieces,) [s]."""

    coefficients: FloatArray
    durations: FloatArray
    begin: float
    timescale: float = 1.0
    reversed: bool = False
    shift: Vector = ZERO
    shift_yaw: float = 0.0

    @property
    def duration(self) -> float:
        """Total time, stretched by the time scale, s."""
        return float(self.durations.sum()) * self.timescale

    def finished(self, now: float) -> bool:
        """Whether the end was reached."""
        return now - self.begin >= self.duration

    def at(self, now: float) -> FlatState:
        """State of the plan at `now` [s]; before and after the plan it rests at its ends."""
        total = self.duration
        elapsed = min(max(now - self.begin, 0.0), total)
        at_rest = now - self.begin > total
        local = (total - elapsed if self.reversed else elapsed) / self.timescale
        index = 0
        while index < len(self.durations) - 1 and local > self.durations[index]:
            local -= float(self.durations[index])
            index += 1
        c = self.coefficients[index]
        powers = local**_N
        value = c @ powers
        rate = (c[:, 1:] * _N[1:]) @ powers[:7] / self.timescale
        acceleration = (c[:, 2:] * _N_TWICE) @ powers[:6] / self.timescale**2
        if self.reversed:
            rate = -rate
        if at_rest:
            rate = np.zeros(4)
            acceleration = np.zeros(4)
        return FlatState(
            (
                float(value[0]) + self.shift[0],
                float(value[1]) + self.shift[1],
                float(value[2]) + self.shift[2],
            ),
            (float(rate[0]), float(rate[1]), float(rate[2])),
            (float(acceleration[0]), float(acceleration[1]), float(acceleration[2])),
            float(value[3]) + self.shift_yaw,
            float(rate[3]),
        )


def move(start: FlatState, goal: FlatState, duration: float, now: float) -> Trajectory:
    """One smooth piece from `start` to `goal`, yaw the short way round."""
    yaw0 = wrap(start.yaw)
    yaw1 = yaw0 + wrap(goal.yaw - yaw0)
    rows = [
        smooth_polynomial(
            duration,
            (start.position[i], start.velocity[i], start.acceleration[i]),
            (goal.position[i], goal.velocity[i], goal.acceleration[i]),
        )
        for i in range(3)
    ]
    rows.append(smooth_polynomial(duration, (yaw0, start.yaw_rate, 0.0), (yaw1, goal.yaw_rate, 0.0)))
    return Trajectory(np.array([rows]), np.array([max(duration, 0.0)]), now)


@dataclass(frozen=True, slots=True)
class _Definition:
    location: int
    kind: int
    offset: int
    pieces: int


class HighLevelCommander:
    """Planner of one drone. `now` is the drone's own time in s."""

    def __init__(self, memory: bytearray | None = None) -> None:
        """`memory` is the drone's trajectory memory (4096 bytes), shared with port 4."""
        self.state = PlannerState.IDLE
        self.takeoff_velocity = 0.5
        self.landing_velocity = 0.5
        self.memory = bytearray(TRAJECTORY_SIZE) if memory is None else memory
        self._definitions: dict[int, _Definition] = {}
        self._group_mask = 0
        self._blocked = False
        self._trajectory: Trajectory | None = None
        # The last setpoint while flying a plan, the estimate otherwise: where the next plan starts.
        self._last = FlatState()
        self._handlers: dict[HighLevelCommand, Callable[[bytes, float], int]] = {
            HighLevelCommand.TAKEOFF: lambda p, t: self._vertical(PlannerState.FLYING, "<Bff", p, t),
            HighLevelCommand.LAND: lambda p, t: self._vertical(PlannerState.LANDING, "<Bff", p, t),
            HighLevelCommand.TAKEOFF_2: lambda p, t: self._vertical(PlannerState.FLYING, "<Bff?f", p, t),
            HighLevelCommand.LAND_2: lambda p, t: self._vertical(PlannerState.LANDING, "<Bff?f", p, t),
            HighLevelCommand.TAKEOFF_WITH_VELOCITY: lambda p, t: self._with_velocity(
                PlannerState.FLYING, p, t
            ),
            HighLevelCommand.LAND_WITH_VELOCITY: lambda p, t: self._with_velocity(PlannerState.LANDING, p, t),
            HighLevelCommand.GO_TO: lambda p, t: self._go_to("<BB5f", p, t),
            HighLevelCommand.GO_TO_2: lambda p, t: self._go_to("<BBB5f", p, t),
            HighLevelCommand.START_TRAJECTORY: lambda p, t: self._start("<BBBBf", p, t),
            HighLevelCommand.START_TRAJECTORY_2: lambda p, t: self._start("<BBBBBf", p, t),
        }

    def command(self, command: int, payload: bytes, now: float) -> int:
        """Carry out one command of port 8; the answer's errno (0, EBUSY or ENOEXEC)."""
        try:
            if command == HighLevelCommand.SET_GROUP_MASK:
                self._group_mask = payload[0]
                return 0
            if command == HighLevelCommand.STOP:
                if self._addressed(payload[0]):
                    self.stop()
                return 0
            if command == HighLevelCommand.DEFINE_TRAJECTORY:
                return self._define(payload)
            if command not in self._handlers:
                return errno.ENOEXEC
            if self._blocked:
                return errno.EBUSY
            return self._handlers[HighLevelCommand(command)](payload, now)
        except (struct.error, IndexError):
            return errno.ENOEXEC

    def stop(self) -> None:
        """Forget the plan; the setpoint becomes null (motors off)."""
        self.state = PlannerState.IDLE

    def block(self, blocked: bool) -> None:
        """Refuse commands while the drone may not fly; a running plan is stopped."""
        if blocked and not self._blocked and self.state is not PlannerState.DISABLED:
            self.stop()
        self._blocked = blocked

    def hold(self, here: FlatState, now: float) -> None:
        """Stay at `here`: a go-to of no duration, for an app that hands the drone back.

        A command that comes before the next setpoint, 10 ms at most, starts from here as well: the firmware's
        ``commanderRelaxPriority``, which the app calls, tells the planner where the drone is.
        """
        self._last = here
        goal = FlatState(here.position, yaw=here.yaw)
        self._begin(move(goal, goal, 0.0, now), PlannerState.FLYING)

    def tell_state(self, estimate: FlatState) -> None:
        """Where the drone is, when another commander hands over."""
        self._last = estimate

    def setpoint(self, estimate: FlatState, now: float) -> Setpoint | None:
        """The setpoint at `now`; the null setpoint when idle, None when disabled. Called at 100 Hz."""
        if self.state in (PlannerState.FLYING, PlannerState.LANDING) and self._trajectory is not None:
            goal = self._trajectory.at(now)
            if self.state is PlannerState.LANDING and self._trajectory.finished(now):
                self.state = PlannerState.IDLE
            self._last = goal
            return _as_setpoint(goal)
        self._last = estimate
        return Setpoint() if self.state is PlannerState.IDLE else None

    def finished(self, now: float) -> bool:
        """Whether the last plan reached its end (true before the first)."""
        return self._trajectory is None or self._trajectory.finished(now)

    def info_bits(self, now: float) -> SupervisorBits:
        """Bits 8 to 10 of the supervisor's report."""
        bits = SupervisorBits(0)
        if self.state & PlannerState.FLYING:
            bits |= SupervisorBits.HIGH_LEVEL_ACTIVE
        if self.finished(now):
            bits |= SupervisorBits.HIGH_LEVEL_FINISHED
        if self.state is PlannerState.DISABLED:
            bits |= SupervisorBits.HIGH_LEVEL_DISABLED
        return bits

    def _addressed(self, group: int) -> bool:
        return group == 0 or bool(group & self._group_mask)

    def _begin(self, trajectory: Trajectory, state: PlannerState) -> int:
        self._trajectory = trajectory
        self.state = state
        return 0

    def _vertical(self, state: PlannerState, layout: str, payload: bytes, now: float) -> int:
        group, height, *rest = struct.unpack(layout, payload)
        yaw, use_current, duration = rest if len(rest) == 3 else (0.0, False, rest[0])
        goal_yaw = self._last.yaw if use_current else yaw
        return self._plan_vertical(state, group, height, goal_yaw, duration, now)

    def _with_velocity(self, state: PlannerState, payload: bytes, now: float) -> int:
        group, height, relative, yaw, use_current, velocity = struct.unpack("<Bf?f?f", payload)
        landing = state is PlannerState.LANDING
        if relative:
            height = self._last.position[2] + (-height if landing else height)
        speed = velocity if velocity > 0 else (self.landing_velocity if landing else self.takeoff_velocity)
        duration = abs(height - self._last.position[2]) / speed
        goal_yaw = self._last.yaw if use_current else yaw
        return self._plan_vertical(state, group, height, goal_yaw, duration, now)

    def _plan_vertical(
        self, state: PlannerState, group: int, height: float, yaw: float, duration: float, now: float
    ) -> int:
        if not self._addressed(group):
            return 0
        refused = (
            self.state is PlannerState.LANDING
            if state is PlannerState.LANDING
            else self.state is not PlannerState.IDLE
        )
        if refused:
            return 1  # as the firmware's planner does: a plain 1, not an errno
        x, y, _ = self._last.position
        start = FlatState(self._last.position, yaw=self._last.yaw)
        return self._begin(move(start, FlatState((x, y, height), yaw=yaw), duration, now), state)

    def _go_to(self, layout: str, payload: bytes, now: float) -> int:
        group, relative, *flags, x, y, z, yaw, duration = struct.unpack(layout, payload)
        if not self._addressed(group):
            return 0
        linear = bool(flags and flags[0])
        start = self._last
        if self.state in (PlannerState.FLYING, PlannerState.LANDING) and self._trajectory is not None:
            start = self._trajectory.at(now)
        if relative:
            p = start.position
            x, y, z, yaw = x + p[0], y + p[1], z + p[2], yaw + start.yaw
        goal = FlatState((x, y, z), yaw=yaw)
        if linear and duration > 0:
            velocity = (
                (x - start.position[0]) / duration,
                (y - start.position[1]) / duration,
                (z - start.position[2]) / duration,
            )
            turn = wrap(yaw - start.yaw) / duration
            start = FlatState(start.position, velocity, yaw=start.yaw, yaw_rate=turn)
            goal = replace(goal, velocity=velocity, yaw_rate=turn)
        return self._begin(move(start, goal, duration, now), PlannerState.FLYING)

    def _define(self, payload: bytes) -> int:
        identity, location, kind, offset, pieces = struct.unpack("<BBBIB", payload)
        if identity >= NUMBER_OF_DEFINITIONS:
            return errno.ENOEXEC
        self._definitions[identity] = _Definition(location, kind, offset, pieces)
        return 0

    def _start(self, layout: str, payload: bytes, now: float) -> int:
        group, *flags, identity, timescale = struct.unpack(layout, payload)
        # Layout 1 has (relative, reversed), layout 2 (relative position, relative yaw, reversed).
        relative, relative_yaw, backwards = (flags[0], 0, flags[1]) if len(flags) == 2 else flags
        if not self._addressed(group) or identity >= NUMBER_OF_DEFINITIONS:
            return 0
        definition = self._definitions.get(identity)
        if definition is None:
            return 0  # the firmware ignores it silently, too
        size = definition.pieces * POLYNOMIAL_PIECE.size
        outside = definition.offset + size > TRAJECTORY_SIZE
        if definition.kind != 0 or definition.pieces == 0 or outside or not timescale > 0:
            return errno.ENOEXEC
        raw = bytes(self.memory[definition.offset : definition.offset + size])
        table = np.array(list(POLYNOMIAL_PIECE.iter_unpack(raw)))
        trajectory = Trajectory(
            table[:, :32].reshape(-1, 4, 8), table[:, 32], now, timescale, reversed=bool(backwards)
        )
        if relative:
            first = trajectory.at(now)
            here = self._last.position
            p = first.position
            trajectory.shift = (here[0] - p[0], here[1] - p[1], here[2] - p[2])
            if relative_yaw:
                trajectory.shift_yaw = wrap(self._last.yaw - first.yaw)
        return self._begin(trajectory, PlannerState.FLYING)


def _as_setpoint(goal: FlatState) -> Setpoint:
    return Setpoint(
        mode_x=Mode.ABSOLUTE,
        mode_y=Mode.ABSOLUTE,
        mode_z=Mode.ABSOLUTE,
        mode_yaw=Mode.ABSOLUTE,
        position=goal.position,
        velocity=goal.velocity,
        acceleration=goal.acceleration,
        yaw=goal.yaw,
        rates=(0.0, 0.0, goal.yaw_rate),
    )
