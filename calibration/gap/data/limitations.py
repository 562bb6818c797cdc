"""What a set of flights cannot tell."""

import re
from collections.abc import Callable, Sequence

import numpy as np

from calibration.flights.flight import PoseSource
from calibration.gap.data.known_time import known_share
from calibration.gap.data.record import FlightRecord

_HALF = 0.5
_QUIET_RATE = 0.15  # rad/s rms
_QUIET_SPEED = 0.1  # m/s rms


def limitations(records: Sequence[FlightRecord]) -> tuple[str, ...]:
    """Sentences on what cannot be concluded from `records`."""
    if not records:
        return ("no usable flight: nothing can be concluded",)
    found = []
    if len(records) == 1:
        found.append("one single flight: nothing can be held out, so no effect can be confirmed")
    elif len({r.shape for r in records}) == 1:
        found.append("one trajectory shape only: no unseen shape to confirm an effect on")
    for lacks, text in _LACKS:
        names = [record.name for record in records if lacks(record)]
        if names:
            found.append(text if len(names) == len(records) else f"{text} (in {', '.join(names)})")
    return (*found, *_noted(records))


def _noted(records: Sequence[FlightRecord]) -> list[str]:
    """What readers left out, or had to infer: each kind of it once, with a flight that has it."""
    kinds: dict[str, list[str]] = {}
    for record in records:
        for note in record.notes:
            kinds.setdefault(re.sub(r"[\d.]+", "", note), []).append(f"{record.name}: {note}")
    return [
        first if not others else f"{first} (and {len(others)} more like it)"
        for first, *others in kinds.values()
    ]


def _quiet(record: FlightRecord) -> bool:
    rate = np.sqrt(np.mean(np.sum(record.rate[record.flying] ** 2, axis=1)))
    speed = np.sqrt(np.mean(np.sum(record.velocity[record.flying] ** 2, axis=1)))
    return bool(rate < _QUIET_RATE and speed < _QUIET_SPEED)


_LACKS: tuple[tuple[Callable[[FlightRecord], bool], str], ...] = (
    (
        lambda record: record.voltage is None,
        "no battery voltage: the one at which the model hovers stands for it, and empties as its pack does "
        "where the flights say so, so that thrust_scale, mass_error, battery_sag and motor_warming cannot be "
        "judged; log it (pm.vbat, vbat)",
    ),
    (
        lambda record: record.specific_force is None,
        "no accelerometer: forces are those that poses show over 0.16 s, and pose_offset cannot be judged",
    ),
    (
        lambda record: record.pose_source is PoseSource.ONBOARD_ESTIMATE,
        "pose is the onboard estimate, which depends on the gyro: sensing effects cannot be judged",
    ),
    (
        lambda record: known_share(record) < _HALF,
        "less than half of the time in flight can be used: the rest is lost in radio gaps, or lies on "
        "straight lines as a log makes them up; what is not seen there is not judged",
    ),
    (_quiet, "hardly any excitation: lag, delay, inertia and air effects cannot be judged"),
)
"""What flights may lack, and what cannot be judged without."""
