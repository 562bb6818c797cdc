"""What the gyro shows of a landing, without any pose.

After contact three things can happen, and the gyro tells them apart:

- four feet hold: the rates ring down within half a second and stay at zero;
- two feet hold: the vehicle swings about them as a pendulum whose frequency follows from mass, inertia and
  leg geometry (1.6 Hz for the paper's vehicle), about b_y on the fore or hind feet, about b_x on a side;
- none holds: the vehicle tumbles on and meets the floor not earlier than a free fall from the ceiling takes.

Nothing here is fitted to flights. Not visible: whether three or four feet hold, one or two; a vehicle caught
by something else than the ceiling. Body contact is visible only when the attitude at contact leaves no doubt,
which rows 20 ms apart (up to 30 deg of flip) seldom allow.
"""

import math
from dataclasses import dataclass

import numpy as np

from calibration.flights import Flight
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.rotation import integrate, normalise, to_matrix
from perchhw.label.evidence import Hold, Touch
from perchhw.label.geometry import LabelError, LandingGeometry

SETTLE_S = 0.9
"""After the trigger: flip (about 0.25 s) and ring-down (about 0.5 s) are over."""
WINDOW_S = 2.0
"""Length of the window that is judged; about three swings."""
MINIMUM_WINDOW_S = 0.6
"""Shortest window that still holds one swing."""
QUIET_RAD_S = 0.3
"""RMS rate below which the vehicle does not swing: 2 deg of swing amplitude at 1.6 Hz is 0.25 rad/s RMS."""
_CONTACT_RISE_RAD_S = 0.5
_CONTACT_SEARCH_S = (0.05, 0.6)
_STEP_S = 0.01
_SMOOTHING_S = 0.15
_JOLT_SPAN_S = 0.1
_FLOOR_JOLT_RAD_S = 10.0
"""More than a swing changes in 0.1 s: one of 55 deg at 1.6 Hz changes by 9.8 rad/s."""
_FREQUENCY_TOLERANCE = 0.35  # rigid legs are assumed; the labelled flights swing at 0.97-1.31 of the value


@dataclass(frozen=True)
class GyroEvidence:
    """What the gyro shows.

    Attributes:
        hold: what holds the vehicle.
        settled_rms_rad_s: RMS rate in the window after the landing, without the ringing of the legs.
        swing_hz: dominant frequency in the window (Hz), or None when quiet.
        swing_expected_hz: frequency of a pendulum on two feet (Hz) about the dominant axis.
        floor_jolt_rad_s: largest change of the rates within 0.1 s, later than a fall takes.
        contact_after_trigger_s: last row before the first contact (s after the trigger), or None if unseen.
        first_touch: what met the ceiling first, from the integrated attitude at contact.
    """

    hold: Hold
    settled_rms_rad_s: float
    swing_hz: float | None
    swing_expected_hz: float
    floor_jolt_rad_s: float
    contact_after_trigger_s: float | None
    first_touch: Touch


def judge_gyro(flight: Flight, trigger_t: float, geometry: LandingGeometry, ceiling_z: float) -> GyroEvidence:
    """Judge the landing of a triggered flight by its rates.

    Raises:
        LabelError: no rates, or they end too early after the trigger.
    """
    if not flight.has("gx", "gy", "gz"):
        raise LabelError(
            f"{flight.source}: neither a resting pose nor rates (gx, gy, gz): no way to label it"
        )
    t, rates = flight.series("gx", "gy", "gz")
    after = t - trigger_t
    if after[-1] < SETTLE_S + MINIMUM_WINDOW_S:
        raise LabelError(
            f"{flight.source}: rates end {after[-1]:.2f} s after the trigger; "
            f"{SETTLE_S + MINIMUM_WINDOW_S:.1f} s are needed"
        )
    contact = _contact_row(after, rates)
    grid, slow = _slow_rates(after, rates)
    window = grid >= SETTLE_S
    rms = float(np.sqrt(np.mean(np.sum(slow[window] ** 2, axis=1))))
    axis = 0 if np.var(slow[window, 0]) > np.var(slow[window, 1]) else 1
    expected = geometry.swing_hz[1 - axis]
    frequency = _dominant_hz(slow[window, axis]) if rms > QUIET_RAD_S else None
    jolt = _floor_jolt(grid, slow, _CONTACT_SEARCH_S[1] if contact is None else after[contact], ceiling_z)
    return GyroEvidence(
        hold=_hold(rms, frequency, expected, jolt),
        settled_rms_rad_s=rms,
        swing_hz=frequency,
        swing_expected_hz=expected,
        floor_jolt_rad_s=jolt,
        contact_after_trigger_s=None if contact is None else float(after[contact]),
        first_touch=_first_touch(flight, trigger_t, t, rates, contact, geometry),
    )


def _hold(rms: float, frequency: float | None, expected: float, jolt: float) -> Hold:
    if jolt > _FLOOR_JOLT_RAD_S:
        return Hold.NONE
    if rms <= QUIET_RAD_S:
        return Hold.FOUR_LEG
    if frequency is not None and abs(frequency / expected - 1.0) <= _FREQUENCY_TOLERANCE:
        return Hold.TWO_LEG
    return Hold.NONE


def _slow_rates(after: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The rates from the trigger to the end of the window on a 10 ms grid, without the ringing of the legs.

    A Hann window of 0.15 s passes the swing (1.6 Hz: 0.92) and not the legs on their hinges (10 Hz: 0.07).
    """
    grid = np.arange(0.0, min(float(after[-1]), SETTLE_S + WINDOW_S), _STEP_S)
    kernel = np.hanning(round(_SMOOTHING_S / _STEP_S) + 2)[1:-1]
    columns = [np.convolve(np.interp(grid, after, r), kernel / kernel.sum(), "same") for r in rates.T]
    return grid, np.column_stack(columns)


def _dominant_hz(rate: FloatArray) -> float:
    """Frequency (Hz) of the strongest oscillation in `rate` (on the grid), resolved finer than the window."""
    tapered = (rate - rate.mean()) * np.hanning(rate.size)
    length = 4096
    power = np.abs(np.fft.rfft(tapered, length)) ** 2
    return float(np.fft.rfftfreq(length, _STEP_S)[int(np.argmax(power))])


def _contact_row(after: FloatArray, rates: FloatArray) -> int | None:
    """Last row before the first contact, which brakes the nose-up flip (g_y falling until then)."""
    rise = np.diff(rates[:, 1])
    late = (after[1:] > _CONTACT_SEARCH_S[0]) & (after[1:] < _CONTACT_SEARCH_S[1])
    rows = np.flatnonzero(late & (rise > _CONTACT_RISE_RAD_S))
    return int(rows[0]) if rows.size else None


def _floor_jolt(grid: FloatArray, slow: FloatArray, contact_s: float, ceiling_z: float) -> float:
    """Largest change of the rates (rad/s) within 0.1 s, later than a fall from the ceiling takes."""
    earliest = contact_s + 0.8 * math.sqrt(2.0 * ceiling_z / GRAVITY)
    span = round(_JOLT_SPAN_S / _STEP_S)
    changes = np.linalg.norm(slow[span:] - slow[:-span], axis=1)
    return float(np.max(changes[grid[:-span] > earliest], initial=0.0))


def _first_touch(
    flight: Flight,
    trigger_t: float,
    t: FloatArray,
    rates: FloatArray,
    contact: int | None,
    geometry: LandingGeometry,
) -> Touch:
    """Integrate the attitude from the trigger to the rows before and after contact; both must agree."""
    if contact is None or not flight.has("qx", "qy", "qz", "qw"):
        return Touch.UNCLEAR
    pose_t, quaternions = flight.series("qx", "qy", "qz", "qw")
    start = int(np.searchsorted(pose_t, trigger_t, side="right")) - 1
    first = int(np.searchsorted(t, trigger_t))
    if start < 0 or first > contact:
        return Touch.UNCLEAR
    quaternion = normalise(quaternions[start])
    for row in range(first, contact):
        quaternion = integrate(quaternion, 0.5 * (rates[row] + rates[row + 1]), t[row + 1] - t[row])
    before = geometry.touch_margin(to_matrix(quaternion))
    last = integrate(quaternion, rates[contact], t[contact + 1] - t[contact])
    after = geometry.touch_margin(to_matrix(last))
    if before > 0.0 and after > 0.0:
        return Touch.FEET
    return Touch.BODY if before < 0.0 and after < 0.0 else Touch.UNCLEAR
