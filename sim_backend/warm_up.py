"""Compiles every kernel that a simulated flight calls, before the clock runs.

A kernel that is compiled (or loaded from the cache) in flight stops the world for a second. So a drone of its
own flies through everything first: take-off, tilt, an approach that is aborted, one that flips.
"""

import struct

import numpy as np

from onboard.app_interface import Parameter
from onboard.policy.model import ActionLayer, Policy
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.high_level import Command
from sim_backend.world import World

HEIGHT = 0.4
START = {
    Parameter.CEILING_Z: 2.1,
    Parameter.SPEED_X: 0.0,
    Parameter.SPEED_Z: 1.0,
    Parameter.ACCELERATION_X: 1.0,
    Parameter.ACCELERATION_Z: 3.1,
    Parameter.TAU_START: 1.5,
}
"""Straight up from about `HEIGHT`: 2.1 - 1.5 * 1.0 - 1.0 / (2 * 3.1) = 0.44 m."""


class _Pilot:
    """Flies the drone in simulated time."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._world = World(vehicle)
        self._drone = self._world.drones[0]
        self.firmware = self._drone.firmware

    def fly(self, seconds: float) -> None:
        """Simulate with poses at 100 Hz."""
        for _ in range(round(100 * seconds)):
            _, position, quaternion = self._drone.pose()
            self.firmware.localization.external_pose(*position, *quaternion)
            self.firmware.localization.external_position(*position)
            self._world.run(0.01)

    def write(self, name: str, value: float) -> None:
        """A client's write of a parameter, until the firmware's callback is done."""
        params = self.firmware.params
        entry = params.entry(name)
        params.write_raw(entry.ident, entry.encode(value))
        params.notify(entry.ident)
        while params.busy:
            self._world.step()

    def go_to(self, x: float, y: float, z: float) -> None:
        """Go there in a second."""
        payload = struct.pack("<BBB5f", 0, 0, 0, x, y, z, 0.0, 1.0)
        self.firmware.commander.high_level(Command.GO_TO_2, payload)


def warm_up(vehicle: Vehicle) -> None:
    """Make a flight of `vehicle` free of compilations in this process."""
    pilot = _Pilot(vehicle)
    firmware, commander = pilot.firmware, pilot.firmware.commander
    pilot.fly(0.3)
    firmware.supervisor.arm(True)
    pilot.fly(0.1)
    commander.high_level(Command.TAKEOFF_2, struct.pack("<BffBf", 0, HEIGHT, 0.0, 1, 1.0))
    pilot.fly(1.5)
    x, y, z = firmware.estimator.position()
    commander.setpoint_generic(struct.pack("<Bffff", 9, 1.0, 1.0, 0.0, HEIGHT))
    pilot.fly(0.1)
    commander.notify_setpoints_stop(0)
    pilot.go_to(x, y, z)
    pilot.fly(1.5)
    if firmware.app is None:
        return
    firmware.app.slot.load(_policy().compiled(), 1, 0.05)
    for name, value in (START | {Parameter.IMPACT_X: x, Parameter.IMPACT_Y: y}).items():
        pilot.write(name, value)
    for flips in (False, True):
        pilot.write(Parameter.POLICY_ARM, flips)
        pilot.write(Parameter.TRAJECTORY_ARM, 1)
        pilot.write(Parameter.GO, 1)
        pilot.fly(0.4)
        pilot.write(Parameter.ABORT, not flips)
        pilot.fly(1.0)
        pilot.write(Parameter.TRAJECTORY_ARM, 0)
        pilot.fly(0.1)
        pilot.go_to(x, y, z)
        pilot.fly(2.0)


def _policy() -> Policy:
    """Fires nearly anywhere, to flip gently."""
    return Policy(
        name="warm-up",
        scaler_mean=np.array([0.5, 0.0, 1.0], np.float32),
        scaler_std=np.ones(3, np.float32),
        support_vectors=np.zeros((1, 3), np.float32),
        dual_coefficients=np.ones(1, np.float32),
        gamma=np.float32(0.1),
        intercept=np.float32(-0.5),
        tau_min=np.float32(0.0),
        tau_max=np.float32(3.0),
        layers=(ActionLayer(np.zeros((1, 3), np.float32), np.array([-5e-3], np.float32)),),
        a_rot_min=np.float32(-9e-3),
        a_rot_max=np.float32(0.0),
        provenance={"made_by": "the simulation's warm-up"},
    )
