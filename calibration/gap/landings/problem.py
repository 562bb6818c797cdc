"""A landing as a problem of inference: start, commands, samples with their weights, and the ceiling."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calibration.gap.data.record import NotUsed
from calibration.gap.landings.kernels import (
    COLUMNS,
    DT,
    NUISANCES,
    POSITION,
    QUATERNION,
    Case,
    Seen,
    best_start,
    displace,
    fly,
    gyro_residuals,
)
from calibration.gap.landings.segments import LandingSegment, commanded_thrusts, on_steps
from calibration.gap.landings.start_state import StartState, start_state
from calibration.gap.replay.inputs import below_no_ceiling
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle
from sim_backend.physics.parameters import PARAMETERS, parameter_batch
from sim_backend.physics.state import new_states

HORIZON = 0.4
"""s after the contact that are compared: the shock, the other feet, the first swings."""

EARLY = 0.3
"""s after the contact in which the rates are compared."""

RATE_FLOOR = 0.6
"""rad/s: how well the equations are expected to hold at all (docs/physics.md: peak rates within 2 to 4 %)."""
ATTITUDE_FLOOR = 0.012
"""rad, likewise."""
POSITION_FLOOR = 1e-3
"""m, likewise."""

_TIME_ERROR_TRACKED, _TIME_ERROR_RADIO = 0.0015, 0.004  # s of a single gyro sample
_SPACING = 0.0075  # s: poses closer than this say the same again
_ROOM_TOLERANCE = 0.06  # m
_CEILING_SCATTER = 2e-3  # m, sag of boards and error of marker frames from landing to landing


@dataclass(frozen=True)
class Problem:
    """One landing, ready for the kernels.

    Attributes:
        start: its start; sigma complete.
        ceiling: m, prior mean of the ceiling's height.
        targets: (steps, 4), N.
        motors_known: whether the commands were logged.
    """

    segment: LandingSegment
    start: StartState
    ceiling: float
    targets: FloatArray
    seen: Seen
    motors_known: bool

    @property
    def residuals(self) -> int:
        """Number of residuals."""
        return int(3 * len(self.seen.gyro) + 6 * len(self.seen.pose))


def pose_problems(
    landings: Sequence[LandingSegment], vehicle: Vehicle
) -> tuple[list[Problem], list[NotUsed]]:
    """Landings as problems, one ceiling for all that motion capture saw; and those that contradict it."""
    posed = [_problem(landing, vehicle) for landing in landings]
    alone, refused = _one_room(posed)
    tracked = [p.ceiling for p in alone if p.segment.tracked]
    if len(tracked) < 3:
        return alone, refused
    room = float(np.median(tracked))
    scatter = 1.48 * float(np.median(np.abs(np.array(tracked) - room)))
    sigma = float(np.hypot(_CEILING_SCATTER, scatter / np.sqrt(len(tracked))))
    return [_in_room(p, room, sigma) if p.segment.tracked else p for p in alone], refused


def _one_room(problems: Sequence[Problem]) -> tuple[list[Problem], list[NotUsed]]:
    """Leave out the landings whose pose puts the contact where no ceiling is: their start is not known."""
    room = float(np.median([problem.ceiling for problem in problems])) if len(problems) > 2 else None
    kept, refused = [], []
    for problem in problems:
        off = 0.0 if room is None else problem.ceiling - room
        if abs(off) > _ROOM_TOLERANCE:
            reason = f"its pose puts the contact {off * 1e3:+.0f} mm from the ceiling of the other landings"
            refused.append(NotUsed(problem.segment.name, reason))
        else:
            kept.append(problem)
    return kept, refused


def _in_room(problem: Problem, room: float, sigma: float) -> Problem:
    """The problem with the ceiling of the room, unless its own landing contradicts it."""
    own = problem.start.sigma[0]
    if abs(problem.ceiling - room) > 4.0 * np.hypot(own, sigma):
        return problem
    changed = problem.start.sigma.copy()
    changed[0] = sigma
    return replace(problem, ceiling=room, start=replace(problem.start, sigma=changed))


def _problem(landing: LandingSegment, vehicle: Vehicle) -> Problem:
    parameters = below_no_ceiling(vehicle)
    commands = commanded_thrusts(landing.flight, vehicle)
    start = start_state(landing, parameters, commands)
    end = min(landing.after + HORIZON, float(landing.gyro_t[-1]))
    steps = int(np.ceil((end - start.t) / DT)) + 8
    targets = np.zeros((steps, 4)) if commands is None else on_steps(*commands, start.t, steps)
    ceiling, error = _ceiling(landing, start, parameters, targets)
    start.sigma[0] = error
    gyro, gyro_weight = _gyro(landing, start.t, end, float(vehicle.sensing.gyro_noise.value))
    pose = _poses(landing, start.t, end)
    weight = np.tile([1.0 / ATTITUDE_FLOOR, 1.0 / POSITION_FLOOR], (len(pose), 1))
    limit = float(vehicle.sensing.gyro_range.value)
    seen = Seen(gyro, gyro_weight, limit, pose, weight)
    return Problem(landing, start, ceiling, targets, seen, commands is not None)


def _ceiling(
    landing: LandingSegment, start: StartState, parameters: Any, targets: FloatArray
) -> tuple[float, float]:
    """Height (m) of the vehicle's highest point at the contact, and the standard deviation of it."""
    state = start.state.copy()
    steps = max(round((landing.after - start.t) / DT), 2)
    trace = np.empty((steps + 1, COLUMNS))
    fly(state[0], parameters, targets[:steps], 1, trace)
    heights = np.array([highest(parameters, row) for row in trace])
    middle = heights[min(round((landing.contact - start.t) / DT), steps)]
    speed = abs(heights[-1] - heights[0]) / (steps * DT)
    spread = speed * (landing.after - landing.before) / np.sqrt(12.0)
    unknown = 1e-3 if landing.tracked else 0.01
    return float(middle), float(np.hypot(spread, unknown))


def highest(parameters: Any, row: FloatArray) -> float:
    """Height (m) of the highest point of legs, hull and propellers in one row of a trace."""
    x, y, z, w = row[QUATERNION : QUATERNION + 4]
    up = np.array([2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)])
    feet = parameters["hip"] + parameters["leg_length"] * parameters["leg_direction"]
    foot = float(np.max(feet @ up)) + float(parameters["foot_radius"])
    box = abs(up[0]) * parameters["body_half_x"] + abs(up[1]) * parameters["body_half_y"]
    box += max(up[2] * parameters["body_top_z"], up[2] * parameters["body_bottom_z"])
    disc = abs(up[0]) * parameters["arm_x"] + abs(up[1]) * parameters["arm_y"]
    disc += up[2] * parameters["propeller_height_z"] + parameters["rim_radius"] * np.hypot(*up[:2])
    return float(row[POSITION + 2] + max(foot, box, disc))


def _gyro(landing: LandingSegment, start: float, end: float, noise: float) -> tuple[FloatArray, FloatArray]:
    """Samples of the gyro with weights: noise, what the equations leave, and the time error of a sample."""
    rows = (landing.gyro_t >= start) & (landing.gyro_t <= end)
    t, rates = landing.gyro_t[rows], landing.gyro[rows]
    slope = np.gradient(rates, t, axis=0)
    time_error = _TIME_ERROR_TRACKED if landing.tracked else _TIME_ERROR_RADIO
    sigma = np.sqrt(noise**2 + RATE_FLOOR**2 + (time_error * slope) ** 2)
    return np.column_stack([t - start, rates]), np.ascontiguousarray(1.0 / sigma)


def _poses(landing: LandingSegment, start: float, end: float) -> FloatArray:
    """Poses from the start on, thinned; none where they cannot be trusted."""
    if not landing.tracked:
        return np.zeros((0, 8))
    rows = np.flatnonzero((landing.pose_t >= start) & (landing.pose_t <= end))
    kept: list[int] = []
    for k in rows:
        if not kept or landing.pose_t[k] - landing.pose_t[kept[-1]] >= _SPACING:
            kept.append(int(k))
    return np.column_stack([landing.pose_t[kept] - start, landing.pose[kept]])


def landing_trace(problem: Problem, parameters: Any, x: FloatArray, length: float) -> FloatArray:
    """Trace (steps + 1, COLUMNS) of a landing with the nuisances x, for `length` (s) after the contact."""
    steps = round((problem.segment.after - problem.start.t + length) / DT)
    targets = problem.targets[np.minimum(np.arange(steps), len(problem.targets) - 1)]
    state = problem.start.state.copy()
    batch = parameter_batch(parameters, 1)
    batch["ceiling_z"] = problem.ceiling
    displace(state[0], batch[0], x, problem.start.sigma)
    trace = np.empty((steps + 1, COLUMNS))
    fly(state[0], batch[0], np.ascontiguousarray(targets), 1, trace)
    return trace


def rate_error(problem: Problem, parameters: Any, x: FloatArray, horizon: float) -> float:
    """RMS (rad/s) of gyro minus prediction, all axes, within `horizon` (s) after the contact."""
    trace = landing_trace(problem, parameters, x, horizon + 0.02)
    contact = problem.segment.after - problem.start.t
    seen, t = problem.seen, problem.seen.gyro[:, 0]
    gyro = np.ascontiguousarray(seen.gyro[(t >= contact) & (t <= contact + horizon)])
    out = np.empty((len(gyro), 3))
    weight = np.ones((len(gyro), 3))
    gyro_residuals(trace, gyro, weight, float(x[10] * problem.start.sigma[10]), seen.limit, out)
    return float(np.sqrt(np.mean(out**2)))


def shortened(problem: Problem, horizon: float) -> Problem:
    """The problem with samples only until `horizon` (s) after the contact."""
    last = problem.segment.after + horizon - problem.start.t
    steps = min(len(problem.targets), int(np.ceil(last / DT)) + 8)
    seen = problem.seen
    gyro, pose = seen.gyro[:, 0] <= last, seen.pose[:, 0] <= last
    early = Seen(seen.gyro[gyro], seen.gyro_weight[gyro], seen.limit, seen.pose[pose], seen.pose_weight[pose])
    return replace(problem, targets=problem.targets[:steps], seen=early)


class Solver:
    """Least cost of a landing for any vehicle, over the nuisances.

    Args:
        problems: the landings.
        rng: draws the starts, the same for every vehicle, so that vehicles are compared like with like.
        random_starts: number of them. descents: how many of the starts are descended from.
        iterations: Levenberg-Marquardt steps of a descent.
        parts: steps of the physics in 1 ms.
    """

    def __init__(
        self, problems: Sequence[Problem], rng: np.random.Generator, random_starts: int = 12,
        descents: int = 2, iterations: int = 4,
        parts: int = 1,
    ) -> None:  # fmt: skip
        self.problems = tuple(problems)
        self._starts = rng.standard_normal((len(problems), random_starts, NUISANCES))
        self._descents, self._iterations = descents, iterations
        self._states, self._changed = new_states(1), np.zeros(1, dtype=PARAMETERS)
        self._parts = parts

    @property
    def counts(self) -> FloatArray:
        """Number of residuals of each landing (n,)."""
        return np.array([float(problem.residuals) for problem in self.problems])

    def costs(self, parameters: Any, warm: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Cost of each landing (n,) and its nuisances (n, NUISANCES) with one record of parameters.

        `warm`: nuisances (n, NUISANCES) of a similar vehicle, tried among the starts.
        """
        starts = np.concatenate([np.zeros((len(self.problems), 1, NUISANCES)), self._starts], axis=1)
        if warm is not None:
            starts = np.concatenate([starts, warm[:, None]], axis=1)
        return self._solve(parameters, starts, self._descents)

    def improve(self, parameters: Any, warm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As :meth:`costs`, from the nuisances `warm` (k, n, NUISANCES) alone."""
        return self._solve(parameters, np.swapaxes(warm, 0, 1), min(3, len(warm)))

    def _solve(self, parameters: Any, starts: FloatArray, descents: int) -> tuple[FloatArray, FloatArray]:
        costs, found = np.empty(len(self.problems)), np.empty((len(self.problems), NUISANCES))
        for index, problem in enumerate(self.problems):
            x = np.zeros(NUISANCES)
            case = self._case(problem, parameters)
            costs[index] = best_start(
                np.ascontiguousarray(starts[index]), descents, self._iterations, case, x
            )
            found[index] = x
        return costs, found

    def _case(self, problem: Problem, parameters: Any) -> Case:
        batch = parameter_batch(parameters, 1)
        batch["ceiling_z"] = problem.ceiling
        return Case(
            start=problem.start.state,
            parameters=batch,
            states=self._states,
            changed=self._changed,
            targets=problem.targets,
            parts=self._parts,
            sigma=problem.start.sigma,
            seen=problem.seen,
            trace=np.empty((len(problem.targets) + 1, COLUMNS)),
        )
