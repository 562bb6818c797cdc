"""How well landings tell two effects of legs and feet apart: simulated, as courses are.

What counts is the gyro from the flip on. The start is uncertain, and one effect may fit it better than
another: both are refitted. A landing that goes its own way counts by what came before (Lorentz, or Cauchy,
as in :mod:`calibration.gap.landings.kernels`).
"""

import math
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np

from calibration.gap.landings.kernels import C2, COLUMNS, OMEGA, QUATERNION, fly
from calibration.gap.suggest.hypothesis import Hypothesis, only
from calibration.gap.suggest.separation import Separation
from onboard.arrays import FloatArray
from onboard.mixer import flip_thrusts
from onboard.policy.action import action_moment
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.room import RoomGeometry
from onboard.rotation import body_z
from onboard.vehicle import EFFECTS, Vehicle
from onboard.vehicle.effects import EffectParameter
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.state import new_state

LANDINGS = "landings"
"""Kind of flight: attempts of a landing campaign."""

SPEEDS, ANGLES_DEG = (2.0, 2.5, 3.0), (45.0, 52.5, 60.0)
"""Conditions of the campaign: where the shipped policy lands."""

SECONDS = 20.0
"""Of one attempt, from take-off to rest."""

_TAU = 0.24
_LENGTH, _FLIP = 0.75, 0.4
_RATE_NOISE = 0.15
"""rad/s, of a gyro on a frame that was just hit; its own noise is a tenth of it."""

_START_SIGMA = {"velocity": 0.02, "omega": 0.1}
_GRID_POINTS = 41
_FINEST = 1e-4
_LOG_STEPS = 10


def landing_separation(vehicle: Vehicle, true: Hypothesis, other: str, room: RoomGeometry) -> Separation:
    """How much worse another effect explains landings of the true one, on the mean of three conditions."""
    if vehicle.legs is None:
        return Separation(0.0, SECONDS)
    base = only(vehicle, lambda name: name not in (true.effect, other))
    parameters = physics_parameters(true.on(base), room)
    landings = [
        _Landing(parameters, speed, math.radians(angle))
        for speed, angle in zip(SPEEDS, ANGLES_DEG, strict=True)
    ]

    def cost(rival: Hypothesis) -> float:
        of_rival = physics_parameters(rival.on(base), room)
        return float(np.mean([landing.cost_of(of_rival) for landing in landings]))

    return Separation(0.5 * _least(cost, other), SECONDS)


def _least(cost: Callable[[Hypothesis], float], effect: str) -> float:
    """Least cost over the parameters of an effect: a coarse grid, then a pattern search from its best."""
    rules = EFFECTS[effect].parameters
    names = list(rules)

    def at(place: FloatArray) -> float:
        shares = np.clip(place, 0.0, 1.0).tolist()
        values = [_value(rule, share) for rule, share in zip(rules.values(), shares, strict=True)]
        return cost(Hypothesis(effect, dict(zip(names, values, strict=True))))

    count = max(3, round(_GRID_POINTS ** (1.0 / len(names))))
    grid = [np.array(point) for point in product(np.linspace(0.0, 1.0, count), repeat=len(names))]
    costs = [at(point) for point in grid]
    best, least = grid[int(np.argmin(costs))], min(costs)
    size = 0.5 / (count - 1)
    while size > _FINEST:
        moves = [best + size * sign * axis for axis in np.eye(len(names)) for sign in (1.0, -1.0)]
        tried = [at(move) for move in moves]
        if min(tried) < least:
            best, least = moves[int(np.argmin(tried))], min(tried)
        else:
            size *= 0.5
    return min(least, cost(Hypothesis.neutral(effect)))


def _value(rule: EffectParameter, share: float) -> float:
    """The value at a share (0..1) of the bounds: evenly in the logarithm where it cannot be negative."""
    if rule.low < 0.0:
        return rule.low + share * (rule.high - rule.low)
    low = max(rule.low, 1e-3 * rule.high)
    return low * (rule.high / low) ** share


class _Landing:
    """One approach to the ceiling at a speed (m/s) and angle (rad) with a vehicle's parameters."""

    def __init__(self, parameters: Any, speed: float, angle: float) -> None:
        self._vx, self._vz = speed * math.cos(angle), speed * math.sin(angle)
        d_ceil = _TAU * self._vz
        policy = load_policy(shipped_policy_path("default")).compiled()
        a_rot = float(action_moment(policy, _TAU, self._vx / d_ceil, d_ceil))
        self._start = new_state()
        self._start["position"][2] = parameters["ceiling_z"] - d_ceil
        self._start["velocity"] = [self._vx, 0.01, self._vz]
        self._start["omega"] = [0.05, 0.0, 0.05]
        self._start["thrust"] = 0.25 * parameters["mass"] * parameters["gravity"]
        steps = round(_LENGTH / 1e-3)
        self._targets: FloatArray = np.tile(np.array(flip_thrusts(a_rot, parameters["arm_x"])), (steps, 1))
        flown = self._trace(parameters, self._start)
        upright = [body_z(row)[2] > 0.0 for row in flown[:, QUATERNION : QUATERNION + 4]]
        turned = upright.index(False) if False in upright else round(_FLIP / 1e-3)
        self._targets[turned:] = 0.0
        self._rates = self._gyro(parameters, self._start)

    def _trace(self, parameters: Any, start: Any) -> FloatArray:
        state = start.copy()
        trace = np.empty((len(self._targets) + 1, COLUMNS))
        fly(state, parameters, self._targets, 1, trace)
        return trace

    def _gyro(self, parameters: Any, start: Any) -> FloatArray:
        """Rates at 100 Hz in units of their noise, shape (n,)."""
        rows = self._trace(parameters, start)[::_LOG_STEPS, OMEGA : OMEGA + 3]
        return np.asarray(rows.ravel() / _RATE_NOISE)

    def cost_of(self, rival: Any) -> float:
        """Cost of the true rates for a vehicle with other parameters, from its own best start."""
        rates = self._gyro(rival, self._start)
        residual = self._rates - rates
        slopes = []
        for name, sigma in _START_SIGMA.items():
            for axis in range(3):
                moved = self._start.copy()
                moved[name][axis] += 0.1 * sigma
                slopes.append((self._gyro(rival, moved) - rates) / 0.1)
        columns = np.column_stack(slopes)
        # Robust weights: where the landing went its own way, its slopes say nothing either.
        weight = 1.0 / (1.0 + residual**2 / C2)
        weighted = columns * weight[:, None]
        x = np.linalg.solve(weighted.T @ columns + np.eye(len(slopes)), weighted.T @ residual)
        left = residual - columns @ x
        moved_cost = float(np.sum(C2 * np.log1p(left**2 / C2)) + x @ x)
        return min(moved_cost, float(np.sum(C2 * np.log1p(residual**2 / C2))))
