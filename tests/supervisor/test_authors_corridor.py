"""The corridor of the approach against the flights that the paper's authors flew to their trigger."""

from pathlib import Path

import numpy as np
import pytest

from calibration.flights import Flight, open_flights
from onboard.rotation import to_matrices
from onboard.trajectory import ApproachPlan
from perchhw.supervisor import SafetyLimits
from perchhw.supervisor.corridor import Deviation, deviation

TOUCHED_THE_CEILING_FIRST = ("SVL--NL_2.00_80.00_10-27_10-54", "SVL--NL_2.75_40.00_10-27_10-04")
"""Tumbling, hence not to be allowed: their trigger came after a first contact."""
CEILING = 2.1


def planned(flight: Flight, trigger: float) -> tuple[float, ApproachPlan]:
    """When the approach of a flight began, and its plan, from the setpoints that it logged."""
    t, d = flight.t, flight.data
    moving = (np.hypot(d["setpoint_vx"], d["setpoint_vz"]) > 0.01) & (t < trigger)
    last = int(np.flatnonzero(moving)[-1])
    first = last - int(np.argmin(moving[last::-1])) + 1
    x, y = (float(d[f"setpoint_{axis}"][first]) for axis in "xy")
    level = slice(first, first + int(np.argmax(d["setpoint_vz"][first:] > 0.01)))
    z = float(np.median(d["setpoint_z"][level]))
    vx, vz = (float(d[f"setpoint_v{axis}"][last]) for axis in "xz")
    ax, az = (float(np.max(d[f"setpoint_a{axis}"][first : last + 1])) for axis in "xz")
    tx, tz = vx / ax if ax > 0.0 else 0.0, vz / az
    return float(t[first]), ApproachPlan(x, y, z, tx, tz, vx, vz, ax, az, 0.5, 0.0, CEILING)


def worst(flight: Flight, trigger: float) -> Deviation:
    """The largest deviation of each kind between the start of the approach and its trigger."""
    start, plan = planned(flight, trigger)
    t, pose = flight.series("x", "y", "z", "vx", "vy", "vz", "qx", "qy", "qz", "qw")
    axes = to_matrices(pose[:, 6:].copy())[:, :, 2]
    window = SafetyLimits().corridor_time
    found = [
        deviation(plan, s - start, window, tuple(p[:3]), tuple(p[3:6]), tuple(axis))
        for s, p, axis in zip(t[::3], pose[::3], axes[::3], strict=True)
        if start <= s < trigger
    ]
    return Deviation(*(max(values) for values in zip(*found, strict=True)))


@pytest.mark.further
def test_no_flight_of_the_authors_leaves_the_corridor_before_its_trigger(shared_data: Path) -> None:
    folder = shared_data / "habas2022" / "flights"
    flights, _ = open_flights(sorted(folder.glob("*.csv.gz")))
    limits, count = SafetyLimits(), 0
    for flight in flights:
        name = flight.source.name.removesuffix(".csv.gz")
        if flight.trigger is None or name in TOUCHED_THE_CEILING_FIRST:
            continue
        count += 1
        off = worst(flight, flight.trigger.t)
        assert off.distance < limits.corridor_distance, (name, off)
        assert off.speed < limits.corridor_speed, (name, off)
        assert np.radians(off.tilt) < limits.corridor_tilt, (name, off)
    assert count == 27


@pytest.mark.parametrize("name", TOUCHED_THE_CEILING_FIRST)
def test_a_flight_that_tumbles_leaves_it(name: str, shared_data: Path) -> None:
    (flight,), _ = open_flights([shared_data / "habas2022" / "flights" / f"{name}.csv.gz"])
    assert flight.trigger is not None
    off, limits = worst(flight, flight.trigger.t), SafetyLimits()
    assert off.speed > limits.corridor_speed
    assert np.radians(off.tilt) > limits.corridor_tilt
