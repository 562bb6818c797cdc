"""The period as the paper's authors took it, kept to reproduce their numbers, not to use.

Their script (bhabas/sar_simulation, System_Identification/Inertia_Estimation, MIT) takes peaks of the rate
that are at least a fixed number of samples apart, drops the intervals that lie more than twice the median
deviation from the median interval, and averages the rest. With other sampling or periods the fixed number
finds noise: on their 18 shared logs of 2022 it returns a wrong period five times.
"""

import numpy as np

from calibration.bench.inertia.errors import UnusableSwingError
from calibration.bench.inertia.start import principal_axis
from calibration.bench.inertia.swing import Swing, in_order

PEAK_DISTANCE = 35
"""Samples, the authors' least distance of two peaks."""

_OUTLIER = 2.0  # median deviations from the median


def peak_period(swing: Swing, distance: int = PEAK_DISTANCE) -> float:
    """Mean time (s) between the peaks of the rate about the body axis that turns most, outliers dropped.

    Not corrected for amplitude, and only as good as `distance` fits the sampling.

    Raises:
        UnusableSwingError: fewer than two peaks, or no interval is left.
    """
    from scipy.signal import find_peaks

    ordered, _ = in_order(swing)
    channel = int(np.argmax(np.abs(principal_axis(ordered).direction)))
    peaks = find_peaks(ordered.gyro[:, channel], distance=distance)[0]
    intervals = np.diff(ordered.time[peaks])
    if not intervals.size:
        raise UnusableSwingError(
            f"{swing.source}: {len(peaks)} peak(s) at least {distance} samples apart; "
            "the paper's estimator needs two"
        )
    deviation = np.abs(intervals - np.median(intervals))
    return float(np.mean(intervals[deviation <= _OUTLIER * np.median(deviation)]))
