"""By what a flight and its simulated landings part, in the order of time.

Only what goes beyond both the scatter of the draws and what the log can tell counts as a difference.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calibration.gap.landings.outcomes.measured_motion import MeasuredMotion
from calibration.gap.landings.outcomes.prepare import RATE_ERROR
from calibration.gap.landings.outcomes.simulated_motion import SimulatedMotion, quantiles

_IN_A_ROW = 2
"""Samples outside, one after the other: one alone may be a jump of the radio's clock."""

_SAME_TIME = 2e-3  # s


@dataclass(frozen=True)
class Difference:
    """Something by which flight and simulation part.

    Attributes:
        t: s after the trigger, when it first shows.
        words: what, by how much.
    """

    t: float
    words: str


def differences(measured: MeasuredMotion, simulated: SimulatedMotion) -> tuple[Difference, ...]:
    """All that are found, the first one first; none where the log's clock is not known."""
    if not measured.clock_known:
        return ()
    return tuple(sorted(_found(measured, simulated), key=lambda one: one.t))


def _found(measured: MeasuredMotion, simulated: SimulatedMotion) -> Iterator[Difference]:
    first, middle, last = simulated.first_contacts
    seen = np.inf if measured.contact is None else measured.contact - measured.contact_error
    for axis, name in ((1, "pitch rate"), (0, "roll rate")):
        yield from _rate(measured, simulated, axis, name, float(np.fmin(first, seen)))
    touching = 2 * np.count_nonzero(np.isfinite(simulated.contacts)) > simulated.contacts.size
    if not touching:
        return
    if measured.contact is not None:
        yield from _contact(measured.contact, measured.contact_error, simulated)
        yield from _angle(measured.contact, measured, simulated)
    elif measured.gyro_t[-1] > last:
        yield Difference(float(middle), "no contact where most draws have theirs")


def _rate(
    measured: MeasuredMotion, simulated: SimulatedMotion, axis: int, name: str, until: float
) -> Iterator[Difference]:
    """A rate (rad/s) that leaves most of the draws before anything touches."""
    t, seen = measured.gyro_t, measured.gyro[:, axis]
    rows = (t > 0.0) & (t < min(until, simulated.t[-1])) & np.isfinite(seen)
    t, seen = t[rows], seen[rows]
    low, middle, high = (np.interp(t, simulated.t, one) for one in quantiles(simulated.rates[:, :, axis]))
    side = (seen > high + RATE_ERROR).astype(int) - (seen < low - RATE_ERROR).astype(int)
    for k in range(side.size - _IN_A_ROW + 1):
        if side[k] != 0 and np.all(side[k : k + _IN_A_ROW] == side[k]):
            words = f"{name} {seen[k]:+.1f} instead of {middle[k]:+.1f} rad/s, {_ms(t[k])} after the trigger"
            yield Difference(float(t[k]), words)
            return


def _contact(contact: float, error: float, simulated: SimulatedMotion) -> Iterator[Difference]:
    """A contact outside those of most draws, wherever between its two samples it was."""
    low, middle, high = simulated.first_contacts
    if contact + error < low or contact - error > high:
        sooner = "earlier" if contact < middle else "later"
        words = f"contact {_ms(abs(contact - middle))} {sooner}"
        yield Difference(min(contact, float(middle)), words)


def _angle(contact: float, measured: MeasuredMotion, simulated: SimulatedMotion) -> Iterator[Difference]:
    """A flip angle at the contact outside those of most draws at theirs, wherever the contact was."""
    if measured.turned_t[-1] < contact - _SAME_TIME:
        return  # the gyro was at its range on the way
    angle = float(measured.turned_flip_angles[-1])
    last = measured.gyro[measured.gyro_t <= contact - measured.contact_error]
    open_by = measured.contact_error * abs(float(last[-1, 1])) if len(last) else 0.0
    low, middle, high = quantiles(simulated.at_contact(simulated.flip_angles))
    if angle + open_by < low or angle - open_by > high:
        off = float(np.degrees(angle - middle))
        sooner = "less" if off < 0.0 else "more"
        yield Difference(contact, f"{abs(off):.0f} deg {sooner} flip at the contact")


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.0f} ms"
