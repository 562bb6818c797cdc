"""Hover with stock cflib: to any client the simulated drone is a Crazyflie.

    python examples/hover_with_cflib.py

Serves a lab in real time, for cflib knows no other, sends the drone the poses of its motion capture, takes
off, hovers and lands. Prints the height at which the drone says that it hovers. With a real drone and room
only the two addresses differ.
"""

from collections.abc import Callable

import cflib.crtp
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from cflib.crazyflie.syncLogger import SyncLogger

import perchhw
from mocap_bridge.bridge import PoseBridge
from onboard.supervisor_info import SupervisorBits
from perchhw.lab_process import FREE_PORTS

HEIGHT = 0.5  # m
VARIABLES = ("stateEstimate.x", "stateEstimate.z", "supervisor.info")


class ExternalPose:
    """Where the bridge sends its poses."""

    def __init__(self, crazyflie: Crazyflie) -> None:
        self._crazyflie = crazyflie

    def send_pose(self, position: tuple[float, ...], quaternion: tuple[float, ...]) -> None:
        """Send one pose: m, quaternion x y z w."""
        self._crazyflie.extpos.send_extpose(*position, *quaternion)


def wait(drone: SyncCrazyflie, holds: Callable[[float, float, int], bool], samples: int = 1) -> float:
    """Read x, z (m) and the supervisor's bits every 20 ms, until they have fitted so many times in a row, at
    most 20 s of the drone's time; gives z."""
    config = LogConfig("hover", period_in_ms=20)
    for name in VARIABLES:
        config.add_variable(name, "float")
    fitted = 0
    with SyncLogger(drone, config) as log:
        for _, (_, values, _) in zip(range(1000), log, strict=False):
            x, z, bits = (values[name] for name in VARIABLES)
            fitted = fitted + 1 if holds(x, z, int(bits)) else 0
            if fitted == samples:
                return float(z)
    raise SystemExit(f"the drone did not get there: {values}")


cflib.crtp.init_drivers()
with (
    perchhw.SimulatedLab("lab", FREE_PORTS) as lab,
    SyncCrazyflie(lab.drones[0], cf=Crazyflie(rw_cache="cache")) as drone,
    PoseBridge(lab.mocap[0], ExternalPose(drone.cf)),
):
    wait(drone, lambda x, z, bits: abs(x + 2.5) < 0.02 and bool(bits & SupervisorBits.CAN_ARM))
    drone.cf.supervisor.send_arming_request(True)
    # The drone's planner learns where it is within 10 ms of being allowed to fly; a take-off before that is
    # refused unheard, or begins at the origin.
    wait(drone, lambda x, z, bits: bool(bits & SupervisorBits.CAN_FLY), samples=5)
    drone.cf.high_level_commander.takeoff(HEIGHT, 1.5)
    height = wait(drone, lambda x, z, bits: abs(z - HEIGHT) < 0.02)
    print(f"hovers at {height:.2f} m")
    drone.cf.high_level_commander.land(0.0, 1.5)
    wait(drone, lambda x, z, bits: z < 0.1)
    drone.cf.supervisor.send_arming_request(False)
    print("landed")
