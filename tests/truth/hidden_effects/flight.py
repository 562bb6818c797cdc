"""One hidden flight: nuisances, disturbances and sensor noise drawn, then the compiled closed loop."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from tests.truth.hidden_effects.closed_loop import fly
from tests.truth.hidden_effects.layout import CONTROL_PERIOD, GRAVITY, STATES, TICKS_PER_SAMPLE
from tests.truth.hidden_effects.shapes import setpoints

TORQUE_SD = (2.2, 2.2, 0.7)
"""rad/s2, of the quick torque disturbance about each axis."""
TORQUE_TIME, FORCE_SD, FORCE_TIME = 0.06, 0.06, 0.4
"""s; m/s2; s."""
SLOW_TORQUE_SD, SLOW_TORQUE_TIME = (3.0, 3.0, 1.0), 2.0
TILT_DEG = (0.5, 3.0)
"""Of the markers' frame against the drone's, per flight: least and most (second tier)."""
SCALE_SD, TRIM_SD, ACCELEROMETER_BIAS_SD = 0.005, (1.0, 1.0, 0.3), 0.03
"""Per flight: of the thrust scale; rad/s2; m/s2."""
MOST_CHARGE_USED = 0.4
"""Share of the pack that earlier flights may have drawn."""


@dataclass(frozen=True)
class HiddenFlight:
    """What really happened and what was measured.

    Attributes:
        name, shape: of the flight and its trajectory.
        setpoints: shape (ticks, columns).
        gusts: disturbing force (N, world) and torque (N m, body) per tick, shape (ticks, 6).
        states: true state per tick, shape (ticks, STATES).
        log: pose 7, gyro 3, accelerometer 3, PWM 4, voltage per sample, shape (samples, 18).
        parameters: record of the vehicle in this flight, nuisances included.
    """

    name: str
    shape: str
    setpoints: np.ndarray
    gusts: np.ndarray
    states: np.ndarray
    log: np.ndarray
    parameters: np.ndarray


def hidden_flight(
    vehicle: np.ndarray, name: str, shape: str, seed: int, number: int, defects: bool = False
) -> HiddenFlight:
    """Fly `shape` with the true vehicle (record of `layout.PARAMETERS`).

    The random numbers depend on `seed` and `number` alone, so that two vehicles meet the same air. With
    `defects` a slow torque acts too, and the markers' frame is tilted.
    """
    rng = [np.random.default_rng([seed, number, use]) for use in range(4)]
    p = vehicle.copy()
    used = _nuisances(p, rng[0])
    if defects:
        p["pose_turn"] += _tilt(rng[0])
    rows = setpoints(shape, rng[1], rest_height(p))
    gusts = _gusts(p, len(rows), rng[2], defects)
    samples = -(-len(rows) // TICKS_PER_SAMPLE)
    noise = rng[3].standard_normal((len(rows), 7))
    pose_noise = rng[3].standard_normal((samples, 6))
    states, log = np.empty((len(rows), STATES)), np.empty((samples, 18))
    fly(p, at_rest(p, used), rows, gusts, noise, pose_noise, states, log)
    return HiddenFlight(name, shape, rows, gusts, states, log, p)


def rest_height(p: np.ndarray) -> float:
    """Height (m) of the centre of mass on the floor: the four springs carry the weight."""
    return float(-p["corner"][:, 2].min() - p["mass"] * GRAVITY / (4 * p["floor_stiffness"]))


def at_rest(p: np.ndarray, charge_used: float) -> np.ndarray:
    """State of a vehicle that stands on the floor at x = y = 0, with `charge_used` (C) gone."""
    state = np.zeros(STATES)
    state[2], state[9], state[17], state[18] = rest_height(p), 1.0, charge_used, 1.0
    return state


def _nuisances(p: np.ndarray, rng: np.random.Generator) -> float:
    """Change the record by what differs from flight to flight; returns the charge used before (C)."""
    p["gain"] *= 1.0 + SCALE_SD * rng.standard_normal()
    p["trim"] += p["filed_inertia"] * TRIM_SD * rng.standard_normal(3)
    p["accelerometer_bias"] = ACCELEROMETER_BIAS_SD * rng.standard_normal(3)
    return float(MOST_CHARGE_USED * rng.uniform() * p["capacity"])


def _tilt(rng: np.random.Generator) -> np.ndarray:
    """Rotation vector (rad) about a horizontal axis."""
    angle, way = np.deg2rad(rng.uniform(*TILT_DEG)), rng.uniform(0.0, 2.0 * np.pi)
    return np.array([angle * np.cos(way), angle * np.sin(way), 0.0])


def _gusts(p: np.ndarray, ticks: int, rng: np.random.Generator, slow_torque: bool) -> np.ndarray:
    gusts = np.empty((ticks, 6))
    gusts[:, :3] = p["filed_mass"] * FORCE_SD * _coloured(rng, ticks, FORCE_TIME)
    gusts[:, 3:] = p["filed_inertia"] * TORQUE_SD * _coloured(rng, ticks, TORQUE_TIME)
    if slow_torque:
        gusts[:, 3:] += p["filed_inertia"] * SLOW_TORQUE_SD * _coloured(rng, ticks, SLOW_TORQUE_TIME)
    return gusts


def _coloured(rng: np.random.Generator, count: int, time: float) -> np.ndarray:
    """Three Ornstein-Uhlenbeck processes of unit variance and correlation time `time` (s)."""
    keep = np.exp(-CONTROL_PERIOD / time)
    white = rng.standard_normal((count, 3)) * np.sqrt(1.0 - keep * keep)
    white[0] /= np.sqrt(1.0 - keep * keep)
    return np.asarray(lfilter([1.0], [1.0, -keep], white, axis=0))
