"""Logs as the authors' radio made them, out of good ones (notes on their data, section 1)."""

import dataclasses

import numpy as np

from calibration.flights import Flight, PoseSource


def through_the_radio(flight: Flight, rng: np.random.Generator) -> Flight:
    """A flight with an onboard estimate instead of motion capture: late, coarse, tilted; gyro blocks age."""
    data = {name: values.copy() for name, values in flight.data.items()}
    t = flight.t
    data["z"] = np.interp(t - rng.choice([0.0, 0.010]), t, data["z"])
    for axis in "xyz":
        data[axis] = np.round(data[axis] + rng.normal(0.0, 0.01), 3)
    for axis in "xy":
        data[f"g{axis}"] = np.round(data[f"g{axis}"], 2)
    age = rng.uniform(0.0, 0.010, t.size)
    for axis in "xyz":
        data[f"q{axis}"] = data[f"q{axis}"] + rng.normal(0.0, 0.015)  # 2 deg, all flight long
        data[f"g{axis}"] = np.interp(t - age, t, data[f"g{axis}"])
    return dataclasses.replace(flight, data=data, pose_source=PoseSource.ONBOARD_ESTIMATE)
