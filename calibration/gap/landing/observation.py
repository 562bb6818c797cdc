"""What a landing shows without any model: impulse, rebound, rates after the contact, swing, hanging pose."""

from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray

EARLY = 0.3
"""s after the contact in which the rates are compared."""

IMPULSE_AFTER = 0.03
"""s after the contact at which its change of velocity is taken."""

AT_REST = 0.6
"""rad/s: slower than this, everything has come to rest."""


@dataclass(frozen=True)
class Swing:
    """Oscillation of the hanging vehicle.

    Attributes:
        period: s of the strongest one. decay: 1/s of its envelope.
    """

    period: float
    decay: float


@dataclass(frozen=True)
class Observation:
    """What a landing shows. None: this flight cannot show it.

    Attributes:
        rate_before: rad/s, pitch rate of the last sample before the contact.
        peak_rate: rad/s, largest size of the pitch rate within EARLY after it.
        rebound_rate: rad/s, largest pitch rate against the flip within EARLY.
        impulse: m/s, world, change of velocity from before the contact to IMPULSE_AFTER after it, (3,).
        rebound: m/s, fastest descent within EARLY.
        swing: once the largest shocks are over.
        settling: s from the contact until the rates stay below AT_REST.
        final_tilt: rad of the body axis from the vertical at the end, pi hanging level.
        fell: whether the vehicle left the ceiling again.
    """

    rate_before: float
    peak_rate: float
    rebound_rate: float
    impulse: FloatArray | None
    rebound: float | None
    swing: Swing | None
    settling: float | None
    final_tilt: float | None
    fell: bool | None


def observe(
    t: FloatArray, rates: FloatArray, pose_t: FloatArray, pose: FloatArray, before: float, after: float,
    tracked: bool,
) -> Observation:  # fmt: skip
    """Read a landing.

    Args:
        t, rates: gyro, s and rad/s. pose_t, pose: s, quaternion and position.
        before, after: s, around the first contact.
        tracked: whether poses after the contact exist and can be trusted.
    """
    early = (t >= after) & (t <= after + EARLY)
    pitch = rates[early, 1]
    impulse = rebound = final_tilt = fell = None
    if tracked and np.count_nonzero(pose_t > after) > 10:
        impulse = _velocity(pose_t, pose, after + IMPULSE_AFTER) - _velocity(pose_t, pose, before, True)
        times = pose_t[(pose_t > after + 0.02) & (pose_t < after + EARLY - 0.02)]
        rebound = float(min((_velocity(pose_t, pose, s)[2] for s in times), default=0.0))
        final_tilt = float(_tilt(pose[-1]))
        top = float(np.max(pose[:, 6]))
        fell = bool(pose[-1, 6] < top - 0.2)
    return Observation(
        rate_before=float(rates[t <= before][-1, 1]),
        peak_rate=float(np.max(np.abs(pitch), initial=0.0)),
        rebound_rate=float(np.max(pitch, initial=0.0)),
        impulse=impulse,
        rebound=rebound,
        swing=swing_of(t, rates, after) if not fell else None,
        settling=_settling(t, rates, after),
        final_tilt=final_tilt,
        fell=fell,
    )


def swing_of(t: FloatArray, rates: FloatArray, contact: float) -> Swing | None:
    """Strongest oscillation of the pitch rate from 0.2 s after `contact` (s) on; None where there is none.

    The period is that of the highest peak of the spectrum (Hann window, zero padding), the decay that of the
    envelope of rates over blocks of 0.1 s.
    """
    rows = (t > contact + 0.2) & (t < contact + 1.2)
    if np.count_nonzero(rows) < 20 or t[rows][-1] < contact + 0.6:
        return None
    grid = np.arange(t[rows][0], t[rows][-1], 0.005)
    signal = np.interp(grid, t[rows], rates[rows, 1])
    signal = signal - signal.mean()
    if signal.std() < 0.1:
        return None
    spectrum = np.abs(np.fft.rfft(signal * np.hanning(signal.size), 4096))
    frequency = np.fft.rfftfreq(4096, 0.005)
    spectrum[(frequency < 1.0) | (frequency > 40.0)] = 0.0
    blocks = [signal[k : k + 20].std() for k in range(0, signal.size - 19, 20)]
    level = np.log(np.maximum(blocks, 1e-3))
    used = np.array(blocks) > 0.03
    if np.count_nonzero(used) < 3:
        return None
    slope = np.polyfit(np.arange(len(blocks))[used] * 0.1, level[used], 1)[0]
    return Swing(1.0 / float(frequency[np.argmax(spectrum)]), -float(slope))


def _velocity(t: FloatArray, pose: FloatArray, at: float, backward: bool = False) -> FloatArray:
    """Velocity (m/s) around `at`, from positions within 25 ms (50 ms before it when `backward`)."""
    rows = np.flatnonzero((t > at - 0.05) & (t <= at) if backward else np.abs(t - at) < 0.025)
    if rows.size < 3:
        rows = np.argsort(np.abs(t - at))[:3]
    s, p = t[rows] - at, pose[rows, 4:7]
    return np.asarray(np.polyfit(s, p, 1)[0], dtype=np.float64)


def _tilt(pose: FloatArray) -> float:
    return float(np.arccos(np.clip(1.0 - 2.0 * (pose[0] ** 2 + pose[1] ** 2), -1.0, 1.0)))


def _settling(t: FloatArray, rates: FloatArray, contact: float) -> float | None:
    busy = np.flatnonzero((np.linalg.norm(rates, axis=1) > AT_REST) & (t > contact))
    if busy.size == 0:
        return 0.0
    return float(t[busy[-1]] - contact) if busy[-1] < t.size - 3 else None
