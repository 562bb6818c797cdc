"""The state of a vehicle just before its first contact, and how well it is known.

Poses of a short window are joined by dead reckoning: the gyro turns the body, the commanded thrusts and
gravity push it. One rotation, position and velocity then fit all poses of the window, which gives the state
at its end much better than any single pose, and without the delay of a filter. Where poses cannot be trusted
during the flip (onboard estimates), the window ends at the trigger and dead reckoning goes on to the contact.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.gap.data.rotations import accumulated
from calibration.gap.landings.kernels import DT, NUISANCES, spin
from calibration.gap.landings.segments import LandingSegment, on_steps
from onboard.arrays import FloatArray
from sim_backend.physics.state import new_states

SPIN_UP = 0.4
"""s of commands before the start that the thrusts are brought up with."""

_WINDOW = 0.1  # s of poses
LEAD = 0.004  # s from the start to the last gyro sample that shows no contact


@dataclass(frozen=True)
class StartState:
    """Start of a landing.

    Attributes:
        t: s on the flight's clock.
        state: states (1,), ready to be flown; thrusts included.
        sigma: (NUISANCES,), standard deviations of the prior; that of the ceiling is still open (0).
    """

    t: float
    state: Any
    sigma: FloatArray


def start_state(
    landing: LandingSegment, parameters: Any, commands: tuple[FloatArray, FloatArray] | None
) -> StartState:
    """State before the contact.

    Args:
        landing: the landing. parameters: of its vehicle.
        commands: times (s) and commanded thrusts (N, (n, 4)); None: unknown, taken as none.
    """
    start = landing.before - LEAD
    usable = landing.pose_t[landing.pose_t <= (start if landing.tracked else landing.trigger)]
    last = float(usable[-1])
    # At least three poses, however sparse they are.
    first = min(last - _WINDOW, float(usable[max(usable.size - 3, 0)]))
    steps = max(round((start - first) / DT), 2)
    first = start - steps * DT
    thrust, at_start = _thrusts(parameters, commands, first, steps)
    turn = _turned(landing, first, steps)
    rows = (landing.pose_t >= first - 1e-9) & (landing.pose_t <= last)
    at = np.clip(np.round((landing.pose_t[rows] - first) / DT).astype(int), 0, steps)
    measured = Rotation.from_quat(landing.pose[rows, :4])
    initial = (measured * turn[at].inv()).mean()
    attitude = initial * turn
    accel = attitude[:-1].apply([0.0, 0.0, 1.0]) * (thrust.sum(axis=1) / float(parameters["mass"]))[:, None]
    accel[:, 2] -= float(parameters["gravity"])
    gained = np.vstack([np.zeros(3), np.cumsum(accel, axis=0) * DT])
    moved = np.vstack([np.zeros(3), np.cumsum(0.5 * (gained[1:] + gained[:-1]), axis=0) * DT])
    velocity, position = np.polyfit(DT * at, landing.pose[rows, 4:7] - moved[at], 1)
    state = new_states(1)
    state["position"][0] = position + velocity * DT * steps + moved[-1]
    state["velocity"][0] = velocity + gained[-1]
    state["quaternion"][0] = attitude[-1].as_quat()
    state["omega"][0] = _rate_at(landing, np.array([start]))[0]
    state["thrust"][0] = at_start
    return StartState(start, state, _prior(landing, start - last if landing.tracked else 0.0))


def _prior(landing: LandingSegment, blind: float) -> FloatArray:
    """Standard deviations of the nuisances.

    Motion capture: what a hand-drawn marker frame (0.3 deg), 0.2 mm over a window of 0.1 s and unknown forces
    of the air leave; a clock offset that wanders by some milliseconds (flights of NanoBench: 10 ms). Onboard
    estimates: authors' data section 1, blocks up to 20 ms old, attitude before the flip within some degrees.
    `blind` (s) without a tracked pose add 0.5 m/s2 and 0.1 rad/s.
    """
    sigma = np.zeros(NUISANCES)
    tracked = landing.tracked
    sigma[1:4] = np.hypot(0.02, 0.5 * blind) if tracked else 0.15
    sigma[4:7] = np.hypot(0.006, 0.1 * blind) if tracked else 0.06
    sigma[7:10] = 0.15 if tracked else 0.5
    sigma[10] = 0.003 if tracked else 0.005
    return sigma


def _thrusts(
    parameters: Any, commands: tuple[FloatArray, FloatArray] | None, first: float, steps: int
) -> tuple[FloatArray, FloatArray]:
    """Thrusts (N, (steps, 4)) of the rotors in the steps from `first` (s), and at their end (4,)."""
    if commands is None:
        return np.zeros((steps, 4)), np.zeros(4)
    lead = round(SPIN_UP / DT)
    commanded = on_steps(*commands, first - lead * DT, lead + steps)
    state = new_states(1)
    state["thrust"][0] = commanded[0]
    out = np.empty((lead + steps, 4))
    for k in range(lead + steps):
        spin(state[0], parameters, commanded[k : k + 1])
        out[k] = state["thrust"][0]
    return out[lead:], out[-1]


def _turned(landing: LandingSegment, first: float, steps: int) -> Rotation:
    """Rotation since `first` (s) at each of the steps' ends, from the gyro."""
    middle = np.asarray(first + DT * (np.arange(steps) + 0.5), dtype=np.float64)
    return Rotation.from_quat(accumulated(_rate_at(landing, middle) * DT))


def _rate_at(landing: LandingSegment, times: FloatArray) -> FloatArray:
    """Gyro (rad/s, (n, 3)) between its samples; after the last before the contact, their straight line."""
    rows = landing.gyro_t <= landing.before
    t, rates = landing.gyro_t[rows], landing.gyro[rows]
    value = np.column_stack([np.interp(times, t, rates[:, i]) for i in range(3)])
    slope = (rates[-1] - rates[-2]) / (t[-1] - t[-2])
    return value + np.maximum(times - t[-1], 0.0)[:, None] * slope
