"""Where motion capture sees a vehicle: for callers in Python, to whom a call of compiled code is dear."""

from typing import Any

from onboard.arrays import Quaternion, Vector
from sim_backend.physics.effects.sensors import tracked_first

Pose = tuple[Vector, Quaternion]
"""Position (m, world) and attitude (x, y, z, w; body to world)."""


def tracked_pose(states: Any, parameters: Any) -> Pose:
    """The pose of the frame that is tracked, by the vehicle's effects.

    Args:
        states: (1,) of :data:`sim_backend.physics.state.STATE`.
        parameters: (1,) of :data:`sim_backend.physics.parameters.PARAMETERS`.
    """
    if parameters["sensors_on"].item():
        pose: Pose = tracked_first(states, parameters)
        return pose
    # The same without compiled code, which takes longer to be called than it runs.
    x, y, z = states["position"][0].tolist()
    qx, qy, qz, qw = states["quaternion"][0].tolist()
    return (x, y, z), (qx, qy, qz, qw)
