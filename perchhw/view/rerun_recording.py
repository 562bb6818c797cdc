"""A flight as a Rerun recording: the drone in 3-D, its trail, the ceiling, cues, rates and battery over time.

Written to a file; no viewer is started and nothing goes over a network. Time is the run's clock, from the
first sample on (timeline ``time``); quaternions are scalar-last, as Rerun's.
"""

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calibration.flights import Flight
from calibration.flights.perchhw_run import flight_from_run
from calibration.flights.run_folder import RunRecord, read_run
from onboard.arrays import FloatArray
from onboard.errors import InputError
from onboard.vehicle import Vehicle
from perchhw.errors import FlightStackError
from perchhw.label import landing_geometry
from perchhw.record.folder import make_folder

if TYPE_CHECKING:
    import rerun


TIMELINE = "time"
_APPLICATION = "perchhw"
_TRAIL_POINTS = 2000
_DRONE = "world/drone"

_SERIES: dict[str, tuple[str, ...]] = {
    "cues": ("tau", "theta_x", "d_ceil"),
    "policy": ("trigger_value",),
    "rates": ("gx", "gy", "gz"),
    "velocity": ("vx", "vy", "vz"),
    "battery": ("vbat",),
    "state": ("landing_state",),
}


class ViewError(FlightStackError, InputError):
    """The view cannot be made; the message says what to install or give."""


def write_rrd(run_folder: Path, vehicle: Vehicle, out: Path) -> Path:
    """Write the run as a Rerun recording.

    Args:
        run_folder: the run.
        vehicle: its geometry is drawn.
        out: the file to write (``.rrd``).

    Returns:
        `out`.

    Raises:
        ViewError: rerun-sdk is not installed.
        RunFolderError, UnusableFlightError: the record cannot be read, or holds nothing to show.
    """
    if importlib.util.find_spec("rerun") is None:
        raise ViewError("the view needs rerun-sdk: pip install 'perchhw[view]'")
    import rerun as rr

    run = read_run(run_folder)
    flight = flight_from_run(run)
    make_folder(out.parent)
    recording = rr.RecordingStream(_APPLICATION, recording_id=run_folder.name)
    recording.save(out, default_blueprint=_blueprint())
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _log_room(recording, flight)
    _log_vehicle(recording, vehicle)
    _log_pose(recording, flight)
    _log_series(recording, flight)
    _log_events(recording, run, flight)
    recording.flush()
    recording.disconnect()
    return out


def open_in_viewer(recording: Path) -> None:
    """Open the recording in the Rerun viewer that is installed; returns at once."""
    subprocess.Popen([sys.executable, "-m", "rerun", str(recording)])


def _blueprint() -> "rerun.blueprint.Blueprint":
    import rerun.blueprint as rrb

    plots = [rrb.TimeSeriesView(origin=f"plots/{name}", name=name) for name in _SERIES]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(origin="world", name="room"),
            rrb.Vertical(*plots[:4]),
            column_shares=[3, 2],
        ),
        collapse_panels=True,
    )


def _log_room(recording: "rerun.RecordingStream", flight: Flight) -> None:
    """Ceiling and floor as thin slabs over the area that was flown."""
    import rerun as rr

    if flight.ceiling_z is None or not flight.has("x", "y"):
        return
    _, position = flight.series("x", "y")
    low, high = position.min(axis=0) - 0.5, position.max(axis=0) + 0.5
    middle, half = (low + high) / 2, (high - low) / 2
    slabs = (("ceiling", flight.ceiling_z + 0.01, (190, 196, 204, 90)), ("floor", -0.01, (120, 126, 134, 60)))
    for name, z, colour in slabs:
        box = rr.Boxes3D(
            centers=[[*middle, z]], half_sizes=[[*half, 0.01]], colors=[colour], fill_mode="solid"
        )
        recording.log(f"world/{name}", box, static=True)


def _log_vehicle(recording: "rerun.RecordingStream", vehicle: Vehicle) -> None:
    """Arms, propellers and legs, in the body frame."""
    import rerun as rr

    body = vehicle.body
    motors = np.array(
        [
            (sx * body.arm_x.value, sy * body.arm_y.value, body.propeller_height_z.value)
            for sx, sy in ((1, -1), (-1, -1), (-1, 1), (1, 1))
        ]
    )
    arms = rr.LineStrips3D(
        [[motors[0], motors[2]], [motors[1], motors[3]]], colors=[(40, 46, 54)], radii=0.003
    )
    recording.log(f"{_DRONE}/arms", arms, static=True)
    angles = np.linspace(0.0, 2.0 * np.pi, 33)
    rim = body.propeller_radius.value * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(33)])
    colours = [(210, 105, 30), (90, 96, 104), (90, 96, 104), (210, 105, 30)]  # the front pair stands out
    rims = rr.LineStrips3D([rim + motor for motor in motors], colors=colours, radii=0.0015)
    recording.log(f"{_DRONE}/propellers", rims, static=True)
    legs = vehicle.legs
    if legs is None:
        return
    feet = landing_geometry(vehicle).feet
    hips = np.column_stack(
        [
            np.sign(feet[:, 0]) * legs.hip_x.value,
            np.sign(feet[:, 1]) * legs.hip_y.value,
            np.full(4, legs.hip_z.value),
        ]
    )
    strips = [[hip, foot] for hip, foot in zip(hips, feet, strict=True)]
    recording.log(
        f"{_DRONE}/legs", rr.LineStrips3D(strips, colors=[(32, 103, 176)], radii=0.002), static=True
    )
    points = rr.Points3D(feet, colors=[(32, 103, 176)], radii=legs.foot_radius.value)
    recording.log(f"{_DRONE}/feet", points, static=True)


def _times(t: FloatArray, flight: Flight) -> "rerun.TimeColumn":
    import rerun as rr

    return rr.TimeColumn(TIMELINE, duration=t - flight.t[0])


def _log_pose(recording: "rerun.RecordingStream", flight: Flight) -> None:
    """The moving body frame and its trail."""
    import rerun as rr

    if not flight.has("x", "qw"):
        return
    t, pose = flight.series("x", "y", "z", "qx", "qy", "qz", "qw")
    columns = rr.Transform3D.columns(translation=pose[:, :3], quaternion=pose[:, 3:])
    recording.send_columns(_DRONE, indexes=[_times(t, flight)], columns=columns)
    step = max(1, len(t) // _TRAIL_POINTS)
    trail = rr.LineStrips3D([pose[::step, :3]], colors=[(32, 103, 176)], radii=0.002)
    recording.log("world/trail", trail, static=True)


def _log_series(recording: "rerun.RecordingStream", flight: Flight) -> None:
    """Numbers over time, one plot a group."""
    import rerun as rr

    for group, names in _SERIES.items():
        for name in names:
            if not flight.has(name):
                continue
            t, values = flight.series(name)
            scalars = rr.Scalars.columns(scalars=values[:, 0])
            recording.send_columns(f"plots/{group}/{name}", indexes=[_times(t, flight)], columns=scalars)


def _log_events(recording: "rerun.RecordingStream", run: RunRecord, flight: Flight) -> None:
    """The record's events as text, and the trigger as a point on the path."""
    import rerun as rr

    for event in run.events:
        words = ", ".join(f"{k} {v}" for k, v in event.items() if k not in ("t", "event"))
        recording.set_time(TIMELINE, duration=float(event["t"] - flight.t[0]))
        recording.log("events", rr.TextLog(f"{event['event']}: {words}"))
    if flight.trigger is not None and flight.has("x"):
        t, position = flight.series("x", "y", "z")
        at = position[int(np.argmin(np.abs(t - flight.trigger.t)))]
        point = rr.Points3D([at], colors=[(192, 57, 43)], radii=0.015, labels=["trigger"])
        recording.log("world/trigger", point, static=True)
