"""Compiles every kernel that a simulated flight calls, before the clock runs.

A kernel that is compiled (or loaded from the cache) in flight stops the world for a second. So a drone of its
own flies through everything first: take-off, a setpoint, an approach that is aborted. A flip calls no other
kernel.

The first time this takes long, so a second process (``python -m sim_backend.warm_up ENGINE``) compiles what
the firmware calls while this one compiles the physics; they meet in numba's cache on disk.
"""

import contextlib
import os
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator

import numpy as np

from onboard.app_interface import BUNDLE_ADDRESS, MEMORY_TYPE_APP, Parameter, Rehearsal
from onboard.gravity import GRAVITY
from onboard.kernel_cache import is_complete, note_complete
from onboard.policy.bundle import bundle_crc32, encode_bundle
from onboard.policy.model import ActionLayer, Policy
from onboard.vehicle import Vehicle, load_vehicle
from sim_backend.crazyflie.firmware import Firmware
from sim_backend.crazyflie.high_level import HighLevelCommand
from sim_backend.engine_name import EngineName
from sim_backend.world import World

KERNELS = "flight"
"""Name of all that is compiled here, in the cache."""

ANY_VEHICLE = "crazyflie21-upgraded"
"""Signatures do not depend on the vehicle."""

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

    def __init__(self, vehicle: Vehicle, engine: EngineName) -> None:
        self._world = World(vehicle, engine=engine)
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
        """A client's write of a parameter."""
        _write(self.firmware, name, value, self._world.step)

    def upload(self) -> None:
        """A client's upload of a policy."""
        _upload(self.firmware, self._world.step)

    def go_to(self, x: float, y: float, z: float) -> None:
        """Go there in a second."""
        payload = struct.pack("<BBB5f", 0, 0, 0, x, y, z, 0.0, 1.0)
        self.firmware.commander.high_level(HighLevelCommand.GO_TO_2, payload)


def is_first_start(engine: EngineName) -> bool:
    """Whether :func:`warm_up` has yet to compile for an engine, because no earlier process has."""
    return not is_complete(f"{KERNELS}-{engine}")


def warm_up(vehicle: Vehicle, engine: EngineName = EngineName.REFERENCE) -> None:
    """Make a flight of `vehicle` free of compilations in this process.

    Raises:
        NoCompiler, CompilationFailed: of the engine in C.
    """
    with _firmware_compiled_beside(engine):
        pilot = _Pilot(vehicle, engine)  # stands on its legs, by the physics
    _fly_everything(pilot)
    note_complete(f"{KERNELS}-{engine}")


@contextlib.contextmanager
def _firmware_compiled_beside(engine: EngineName) -> Iterator[None]:
    """Compile what the firmware calls in a process of its own, the first time and where it has a core.

    Whatever a process that failed has left out, the flight compiles.
    """
    if not is_first_start(engine) or _cores() < 2:
        yield
        return
    with subprocess.Popen([sys.executable, "-m", "sim_backend.warm_up", engine]) as process:
        yield
        process.wait()


def _cores() -> int:
    """Cores that this process may use; where the system does not say, all there are."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _rehearse(write: Callable[[str, float], None]) -> None:
    """A client's rehearsal on the drone's own model, for as long as a write takes."""
    write(Parameter.REHEARSE, Rehearsal.MODEL)
    write(Parameter.REHEARSE, Rehearsal.OFF)


def compile_firmware(engine: EngineName) -> None:
    """A drone that somebody holds in the air is armed and told to fly, with a policy and an approach."""
    firmware = Firmware(load_vehicle(ANY_VEHICLE), np.random.default_rng(0), engine=engine)
    _hold(firmware, 300)
    _rehearse(lambda name, value: _write(firmware, name, value, lambda: _hold(firmware, 10)))
    _upload(firmware, lambda: _hold(firmware, 10))
    firmware.supervisor.arm(True)
    _hold(firmware, 100)
    firmware.commander.high_level(HighLevelCommand.TAKEOFF_2, struct.pack("<BffBf", 0, HEIGHT, 0.0, 1, 1.0))
    for name, value in START.items():
        _write(firmware, name, value, lambda: _hold(firmware, 10))
    _write(firmware, Parameter.TRAJECTORY_ARM, 1, lambda: _hold(firmware, 10))
    _hold(firmware, 300)


def _hold(firmware: Firmware, milliseconds: int) -> None:
    """Let time pass for a drone that does not move; poses come at 100 Hz."""
    upright, still = np.array([0.0, 0.0, GRAVITY]), np.zeros(3)
    for _ in range(0, milliseconds, 10):
        firmware.localization.external_pose(0.0, 0.0, HEIGHT, 0.0, 0.0, 0.0, 1.0)
        for _ in range(10):
            firmware.step(upright, still, 4.0)


def _write(firmware: Firmware, name: str, value: float, go_on: Callable[[], None]) -> None:
    """A client's write of a parameter, until the firmware's callback is done."""
    entry = firmware.params.entry(name)
    firmware.params.write_raw(entry.ident, entry.encode(value))
    firmware.params.notify(entry.ident)
    while firmware.params.busy:
        go_on()


def _upload(firmware: Firmware, go_on: Callable[[], None]) -> None:
    """A client's upload of a policy."""
    bundle = encode_bundle(_policy())
    memory = next(memory for memory in firmware.memories if memory.type_id == MEMORY_TYPE_APP)
    memory.write(BUNDLE_ADDRESS, bundle)
    _write(firmware, Parameter.POLICY_LENGTH, len(bundle), go_on)
    _write(firmware, Parameter.POLICY_CRC, bundle_crc32(bundle), go_on)
    _write(firmware, Parameter.POLICY_COMMIT, 1, go_on)


def _fly_everything(pilot: _Pilot) -> None:
    firmware, commander = pilot.firmware, pilot.firmware.commander
    pilot.fly(0.3)
    _rehearse(pilot.write)
    pilot.upload()
    firmware.supervisor.arm(True)
    pilot.fly(0.1)
    commander.high_level(HighLevelCommand.TAKEOFF_2, struct.pack("<BffBf", 0, HEIGHT, 0.0, 1, 1.0))
    pilot.fly(1.5)
    x, y, z = firmware.estimator.position()
    commander.setpoint_generic(struct.pack("<Bffff", 9, 1.0, 1.0, 0.0, HEIGHT))
    pilot.fly(0.1)
    commander.notify_setpoints_stop(0)
    pilot.go_to(x, y, z)
    pilot.fly(0.5)
    for name, value in (START | {Parameter.IMPACT_X: x, Parameter.IMPACT_Y: y}).items():
        pilot.write(name, value)
    pilot.write(Parameter.TRAJECTORY_ARM, 1)
    pilot.write(Parameter.GO, 1)
    pilot.fly(0.4)
    pilot.write(Parameter.ABORT, 1)
    pilot.fly(0.1)


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


if __name__ == "__main__":
    compile_firmware(EngineName(sys.argv[1]))
