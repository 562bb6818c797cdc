"""Flights of the NanoBench data set (arXiv 2603.09908): one CSV or CSV.gz with a metadata YAML beside it.

Source: syediu/nanobench-iros2026 (BSD-3). What the columns are, against their README:

- ``px..pz``, ``qx..qw``: Vicon, z up, scalar-last. ``roll, pitch, yaw`` (not read) are radians.
- ``vx..vz``: a smoothing derivative of the Vicon position that looks about 70 ms ahead.
- ``imu_gyro_*`` rad/s and ``imu_acc_*`` g, body FLU. ``wx_vicon..`` (not read) are noisy.
- ``motor_motor_m1..4``: final PWM ratio, after any battery compensation; ``pwr_pm_vbat``: V under load.
- All that came by radio was interpolated onto the Vicon times, and extrapolated after a lost link, where
  numbers may be of any size; :mod:`calibration.gap.data` finds both.

The metadata repeats what file and flight tell, and one vehicle name covers several airframes: it is not read.
"""

from pathlib import Path

import numpy as np

from calibration.flights.flight import (
    POSE_CHANNELS,
    Flight,
    FlightFileError,
    PoseSource,
    UnusableFlightError,
    finite_masks,
)
from calibration.flights.flight_format import FlightFormat, csv_with
from onboard.csv_file import CsvFile, read_csv
from onboard.gravity import GRAVITY

_CHANNELS = {
    **{axis: f"p{axis}" for axis in "xyz"},
    **{f"q{part}": f"q{part}" for part in "xyzw"},
    **{f"v{axis}": f"v{axis}" for axis in "xyz"},
    **{f"g{axis}": f"imu_gyro_{axis}" for axis in "xyz"},
    **{f"a{axis}": f"imu_acc_{axis}" for axis in "xyz"},
    **{f"m{i}": f"motor_motor_m{i}" for i in (1, 2, 3, 4)},
    **{f"est_{axis}": f"est_stateEstimate_{axis}" for axis in "xyz"},
    **{f"setpoint_{axis}": f"sp_ctrltarget_{axis}" for axis in "xyz"},
    "vbat": "pwr_pm_vbat",
}
"""Our channel: their column."""

_LEAST_NORM = 0.5  # a quaternion shorter than this has no direction: an occluded frame
_SIGNATURE = {"t", "px", "qw", "imu_gyro_x", "imu_acc_x", "motor_motor_m1", "pwr_pm_vbat"}


def is_nanobench(header: tuple[str, ...]) -> bool:
    """Whether a CSV header is of this format."""
    return set(header) >= _SIGNATURE


def load_nanobench(path: Path) -> Flight:
    """Read one flight.

    Raises:
        FlightFileError: broken; names row and column.
        UnusableFlightError: fewer than two rows.
    """
    return read_csv(path, FlightFileError, may_be_torn=True).read_as(_flight)


FORMAT = FlightFormat(csv_with(is_nanobench), load_nanobench)


def _flight(file: CsvFile) -> Flight:
    path = file.path
    for name in ("t", *_CHANNELS.values()):
        file.index(name)
    if len(file.rows) < 2:
        raise UnusableFlightError(path, f"only {len(file.rows)} data rows")
    t = file.time()
    data = {ours: file.column(theirs, missing=("", "nan", "NaN")) for ours, theirs in _CHANNELS.items()}
    for axis in "xyz":
        data[f"a{axis}"] *= GRAVITY
    valid = finite_masks(data)
    norm = np.linalg.norm([data[f"q{part}"] for part in "xyzw"], axis=0)
    for name in POSE_CHANNELS:
        valid[name] &= norm > _LEAST_NORM
    return Flight(
        name=path.name.removesuffix(".gz").removesuffix(".csv"),
        source=path,
        format="nanobench",
        pose_source=PoseSource.MOCAP,
        t=t,
        data=data,
        valid=valid,
        notes=(file.torn,) if file.torn else (),
    )
