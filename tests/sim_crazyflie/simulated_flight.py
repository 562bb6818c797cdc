"""Flying a simulated drone in simulated time, without sockets: the hands of an operator and a mocap room."""

import struct
from collections import deque
from collections.abc import Callable

import pytest

from onboard.app_interface import Parameter
from onboard.policy.bundle import bundle_crc32
from onboard.supervisor_info import SupervisorInfo
from onboard.trajectory import ApproachPlan
from onboard.vehicle import Vehicle, load_vehicle
from sim_backend.crazyflie.build import OURS, Build
from sim_backend.crazyflie.high_level import HighLevelCommand
from sim_backend.engine_name import EngineName, usable_engine
from sim_backend.lab_faults import DroneFaults
from sim_backend.world import World

VEHICLE, LEGS = "crazyflie21-upgraded-stored", "semi-narrow-long"  # feet that always hold


class Flight:
    """One drone in a world of its own, with poses at 100 Hz that arrive 10 ms late."""

    engine = usable_engine(None)
    """What drones run unless a test says otherwise: as in a lab, the code in C, which is twice as fast."""

    def __init__(
        self,
        seed: int = 0,
        faults: DroneFaults | None = None,
        flashed: Vehicle | None = None,
        vehicle: Vehicle | None = None,
        build: Build = OURS,
    ) -> None:
        vehicle = vehicle or load_vehicle(VEHICLE, LEGS)
        self.world = World(
            vehicle, flashed=flashed, seed=seed, faults=faults, build=build, engine=self.engine
        )
        self.drone = self.world.drones[0]
        self.firmware = self.drone.firmware
        self.poses = True
        self._queue: deque[tuple[int, tuple[float, ...]]] = deque()

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> float:
        """Simulate; ends early when `until` holds. Returns the time that passed."""
        for passed in range(round(seconds * 1000)):
            if until is not None and until():
                return passed / 1000
            self.tick()
        return seconds

    def tick(self) -> None:
        ticks = self.world.ticks
        if ticks % 10 == 0:
            _, position, quaternion = self.drone.pose()
            self._queue.append((ticks + 10, (*position, *quaternion)))
        while self._queue and self._queue[0][0] <= ticks:
            pose = self._queue.popleft()[1]
            if self.poses:
                self.firmware.localization.external_pose(*pose)
        self.world.step()

    @property
    def info(self) -> SupervisorInfo:
        return SupervisorInfo(self.firmware.supervisor.info_bits())

    @property
    def position(self) -> list[float]:
        position: list[float] = self.drone.state["position"].tolist()
        return position

    def write(self, name: str, value: float) -> None:
        """A client's write of a parameter; returns when its next packet would be served."""
        self.post(name, value)
        while self.firmware.params.busy:
            self.tick()

    def post(self, name: str, value: float) -> None:
        """A client's write of a parameter, as far as its echo: the firmware has not acted yet."""
        assert not self.firmware.params.busy, "the parameter task takes one packet after the other"
        entry = self.firmware.params.entry(name)
        self.firmware.params.write_raw(entry.ident, entry.encode(value))
        self.firmware.params.notify(entry.ident)

    def param(self, name: str) -> float:
        return self.firmware.params[name]

    def log(self, name: str) -> float:
        return self.firmware.logs[name]

    def arm(self) -> None:
        self.run(1.0)
        assert self.firmware.supervisor.arm(True)
        self.run(0.2)

    def high_level(self, command: HighLevelCommand, layout: str, *values: float) -> int:
        return self.firmware.commander.high_level(int(command), struct.pack(layout, *values))

    def takeoff(self, height: float, duration: float = 2.0) -> int:
        return self.high_level(HighLevelCommand.TAKEOFF_2, "<BffBf", 0, height, 0.0, 1, duration)

    def go_to(self, x: float, y: float, z: float, duration: float) -> int:
        return self.high_level(HighLevelCommand.GO_TO_2, "<BBB5f", 0, 0, 0, x, y, z, 0.0, duration)

    def land(self, duration: float = 2.0) -> int:
        return self.high_level(HighLevelCommand.LAND_2, "<BffBf", 0, 0.0, 0.0, 1, duration)

    def hover(self, height: float = 0.5) -> None:
        self.arm()
        assert self.takeoff(height) == 0
        self.run(4.0)

    def upload(self, bundle: bytes) -> int:
        """Stage and commit a bundle; the drone's policy status."""
        slot = self.firmware.memories[1]
        for address in range(0, len(bundle), 24):
            slot.write(address, bundle[address : address + 24])
        self.write(Parameter.POLICY_LENGTH, len(bundle))
        self.write(Parameter.POLICY_CRC, bundle_crc32(bundle))
        self.write(Parameter.POLICY_COMMIT, 1)
        return int(self.param(Parameter.POLICY_STATUS))

    def set_plan(self, plan: ApproachPlan) -> None:
        for name, value in (
            (Parameter.CEILING_Z, plan.ceiling_z),
            (Parameter.IMPACT_X, plan.impact_x),
            (Parameter.IMPACT_Y, plan.y0),
            (Parameter.SPEED_X, plan.vx),
            (Parameter.SPEED_Z, plan.vz),
            (Parameter.ACCELERATION_X, plan.ax),
            (Parameter.ACCELERATION_Z, plan.az),
            (Parameter.TAU_START, plan.tau0),
        ):
            self.write(name, value)

    def fly_to_start(self, plan: ApproachPlan) -> None:
        self.hover(0.5)
        assert self.go_to(plan.x0, plan.y0, plan.z0, 4.0) == 0
        self.run(6.0)


ENGINES = [
    pytest.param(name, marks=() if name == Flight.engine else pytest.mark.further)
    for name in (*EngineName, "shell")
]
"""For a test's parameters: that of the lab, then further ones; "shell" is the code in C with its shell."""
