"""Before the twist: does the drone hang still, and which way is up?"""

import math
from dataclasses import dataclass

import numpy as np

from calibration.bench.check_table import Check, above, below, findings_of
from calibration.bench.inertia.errors import UnusableSwingError
from calibration.bench.inertia.fit import angle_between
from calibration.bench.inertia.swing import Swing
from calibration.measurement import Finding
from onboard.arrays import Vector

STILL_RATE = 0.02
"""rad/s: drift and motion at rest stay below it."""

_FEWEST = 50


@dataclass(frozen=True, slots=True)
class RestCheck:
    """What a recording at rest says.

    Attributes:
        bias: rad/s, of the gyro. noise: rad/s, standard deviation, mean of the axes.
        up: unit vector, body frame, from the accelerometer, or None without one.
        tilt: rad, between `up` and the claimed axis, or None.
        findings: of the checks; none means ready to twist.
    """

    bias: Vector
    noise: float
    up: Vector | None
    tilt: float | None
    findings: tuple[Finding, ...]


def check_rest(swing: Swing) -> RestCheck:
    """Look at some 10 s of a drone that hangs still.

    Raises:
        UnusableSwingError: fewer than 50 samples.
    """
    n = len(swing)
    if n < _FEWEST:
        raise UnusableSwingError(f"{swing.source}: {n} samples at rest, at least {_FEWEST} needed; wait 10 s")
    gyro = swing.gyro
    quarter = n // 4
    # Largest change between the means of the first and the last quarter.
    drift = float(np.max(np.abs(gyro[:quarter].mean(axis=0) - gyro[-quarter:].mean(axis=0))))
    # Neighbours differ by noise alone: what the whole varies beyond that is motion.
    noise = np.std(np.diff(gyro, axis=0), axis=0) / math.sqrt(2.0)
    excess = np.var(gyro, axis=0) - noise**2
    motion = float(np.sqrt(2.0 * max(float(np.max(excess)), 0.0)))
    up, tilt = None, None
    if swing.acceleration is not None:
        mean = swing.acceleration.mean(axis=0)
        x, y, z = (float(part) for part in mean / max(float(np.linalg.norm(mean)), 1e-12))
        up = (x, y, z)
        tilt = None if swing.axis is None else angle_between(np.array(up), swing.axis)
    bx, by, bz = (float(part) for part in gyro.mean(axis=0))
    findings = _findings(swing, drift, motion, tilt)
    return RestCheck((bx, by, bz), float(np.mean(noise)), up, tilt, tuple(findings))


def _findings(swing: Swing, drift: float, motion: float, tilt: float | None) -> list[Finding]:
    degrees = None if tilt is None else math.degrees(tilt)
    table = (
        Check(
            "short_rest",
            float(swing.time[-1] - swing.time[0]),
            below(warning=5.0),
            "{:.1f} s at rest (at least {:g})",
            "wait longer",
        ),
        Check(
            "drift",
            drift,
            above(reject=STILL_RATE),
            "the gyro drifts by {:.3f} rad/s (limit {:g})",
            "let it settle or warm up",
        ),
        Check(
            "moving",
            motion,
            above(reject=STILL_RATE),
            "it still moves with {:.3f} rad/s (limit {:g})",
            "stop it with a finger and wait",
        ),
        Check(
            "tilt",
            degrees,
            above(warning=3.0),
            "the axis hangs {:.1f} deg off the vertical (limit {:.0f})",
            "move the drone in its loops",
        ),
    )
    return findings_of(swing.source, table)
