"""Programs as users of cflib write them, by its documentation, against a lab that sends the poses itself.

Stock cflib, its own UDP driver, nothing of ours in between; what they did is read from the truth.
"""

import math
import queue
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.mem import MemoryElement, Poly4D
from cflib.crazyflie.swarm import CachedCfFactory, Swarm
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from cflib.crazyflie.syncLogger import SyncLogger
from cflib.positioning.motion_commander import MotionCommander
from cflib.positioning.position_hl_commander import PositionHlCommander
from cflib.utils.multiranger import Multiranger
from cflib.utils.reset_estimator import reset_estimator

from perchhw.testing import Lab, SimulatedDrone, StageProcess
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def stage() -> Iterator[StageProcess]:
    with StageProcess() as stage:
        yield stage


@pytest.fixture
def lab(stage: StageProcess, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Lab]:
    lab = Lab(stage, tmp_path / "lab", drones=getattr(request, "param", 1))
    cflib.crtp.init_drivers()
    yield lab
    lab.close()


@pytest.fixture
def scf(lab: Lab, tmp_path: Path) -> Iterator[SyncCrazyflie]:
    with SyncCrazyflie(lab.drones[0].uri, cf=Crazyflie(rw_cache=str(tmp_path / "cache"))) as connected:
        yield connected


def arm(lab: Lab, drone: SimulatedDrone, cf: Crazyflie) -> None:
    lab.wait_until(lambda: drone.ready, within=10.0)
    cf.supervisor.send_arming_request(True)
    lab.wait_until(lambda: drone.armed, within=5.0)
    lab.run_for(0.2)


def highest(lab: Lab, name: str = "cf1") -> float:
    """Greatest true height so far, m."""
    rows = (line.split(",") for line in (lab.folder / "truth.csv").read_text().splitlines()[1:])
    return max(float(row[4]) for row in rows if row[1] == name)


def test_motion_commander(lab: Lab, scf: SyncCrazyflie) -> None:
    drone = lab.drones[0]
    reset_estimator(scf)
    arm(lab, drone, scf.cf)
    x = drone.position[0]
    with MotionCommander(scf, default_height=0.5) as commander:
        commander.forward(0.4)
        commander.stop()
        time.sleep(0.5)
        assert drone.position[0] == pytest.approx(x + 0.4, abs=0.15)
        assert drone.position[2] == pytest.approx(0.5, abs=0.1)
        commander.turn_left(90)
    assert highest(lab) == pytest.approx(0.5, abs=0.15)
    lab.wait_until(lambda: drone.position[2] < 0.15, within=5.0)


@pytest.mark.further
def test_position_high_level_commander(lab: Lab, scf: SyncCrazyflie) -> None:
    drone = lab.drones[0]
    arm(lab, drone, scf.cf)
    x, y, _ = drone.position
    with PositionHlCommander(scf, x=x, y=y, default_height=0.5, default_velocity=0.6) as commander:
        commander.go_to(x + 0.4, y + 0.3, 0.8)
        lab.wait_until(lambda: math.dist(drone.position, (x + 0.4, y + 0.3, 0.8)) < 0.05, within=5.0)
    lab.wait_until(lambda: drone.position[2] < 0.15, within=5.0)


@pytest.mark.further
def test_autonomous_sequence_of_setpoints(lab: Lab, scf: SyncCrazyflie) -> None:
    drone = lab.drones[0]
    arm(lab, drone, scf.cf)
    x, y, _ = drone.position
    for target in ((x, y, 0.4), (x + 0.3, y, 0.4), (x + 0.3, y, 0.8)):
        for _ in range(20):
            scf.cf.commander.send_position_setpoint(*target, 0)
            time.sleep(0.1)
        assert math.dist(drone.position, target) < 0.15
    scf.cf.commander.send_stop_setpoint()
    scf.cf.commander.send_notify_setpoint_stop()
    lab.wait_until(lambda: drone.motors == (0, 0, 0, 0), within=2.0)


def test_a_trajectory_is_uploaded_and_flown(lab: Lab, scf: SyncCrazyflie) -> None:
    drone = lab.drones[0]
    memory = scf.cf.mem.get_mems(MemoryElement.TYPE_TRAJ)[0]
    straight = Poly4D.Poly([0.0, 0.0, 0.0, 0.3] + [0.0] * 4)  # 0.3 t^3 along x
    still = Poly4D.Poly()
    memory.trajectory = [Poly4D(1.0, straight, still, still, still)]
    assert memory.write_data_sync()
    scf.cf.high_level_commander.define_trajectory(1, 0, 1)
    arm(lab, drone, scf.cf)
    scf.cf.high_level_commander.takeoff(0.6, 1.5)
    lab.wait_until(lambda: drone.position[2] > 0.57, within=5.0)
    lab.run_for(0.3)
    x = drone.position[0]
    scf.cf.high_level_commander.start_trajectory(1, 1.0, relative_position=True)
    lab.wait_until(lambda: abs(drone.position[0] - x - 0.3) < 0.1, within=3.0)
    scf.cf.high_level_commander.land(0.0, 1.5)
    lab.wait_until(lambda: drone.position[2] < 0.15, within=5.0)


def test_logging_beside_the_truth(lab: Lab, scf: SyncCrazyflie) -> None:
    drone = lab.drones[0]
    config = LogConfig("Position", period_in_ms=10)
    for axis in "xyz":
        config.add_variable(f"kalman.state{axis.upper()}", "float")
    lab.wait_until(lambda: drone.ready, within=10.0)
    with SyncLogger(scf, config) as log:
        for _, (_, values, _) in zip(range(200), log, strict=False):
            seen = [values[f"kalman.state{axis}"] for axis in "XYZ"]
    assert math.dist(seen, drone.position) < 0.01


def test_a_ramp_of_thrust_that_does_not_lift_it(lab: Lab, scf: SyncCrazyflie) -> None:
    drone, commander = lab.drones[0], scf.cf.commander
    arm(lab, drone, scf.cf)
    commander.send_setpoint(0.0, 0.0, 0.0, 0)  # unlocks the thrust
    turned = []
    for thrust in (*range(10_000, 25_001, 2_500), *range(22_500, 9_999, -2_500)):
        commander.send_setpoint(0.0, 0.0, 0.0, thrust)
        lab.run_for(0.1)
        turned.append(sum(drone.motors) / 4)
    assert turned.index(max(turned)) == 6
    assert max(turned) > 2.0 * turned[0]
    commander.send_setpoint(0.0, 0.0, 0.0, 0)
    lab.wait_until(lambda: drone.motors == (0, 0, 0, 0), within=2.0)
    assert highest(lab) < 0.1


@pytest.mark.further
def test_a_circle_of_hover_setpoints(lab: Lab, scf: SyncCrazyflie) -> None:
    drone, commander = lab.drones[0], scf.cf.commander
    arm(lab, drone, scf.cf)

    def send(vx: float, yaw_rate: float, heights: Sequence[float]) -> None:
        for z in heights:
            commander.send_hover_setpoint(vx, 0.0, yaw_rate, z)
            lab.run_for(0.1)

    send(0.0, 0.0, [0.1, 0.2, 0.3, *([0.4] * 9)])
    x, y, _ = drone.position
    send(0.5, 144.0, [0.4] * 12)  # half a circle of 0.2 m radius
    assert drone.position[2] == pytest.approx(0.4, abs=0.1)
    assert math.dist(drone.position[:2], (x, y)) == pytest.approx(0.4, abs=0.15)
    send(0.0, 0.0, [0.3, 0.2, 0.1, 0.0])
    commander.send_stop_setpoint()
    commander.send_notify_setpoint_stop()
    lab.wait_until(lambda: drone.motors == (0, 0, 0, 0), within=2.0)


@pytest.mark.further
def test_a_hand_pushes_it_away(lab: Lab, scf: SyncCrazyflie) -> None:
    drone = lab.drones[0]
    for side in ("front", "back", "left", "right", "up"):
        drone.set_log(f"range.{side}", 32766)  # nothing in sight
    arm(lab, drone, scf.cf)
    with MotionCommander(scf, default_height=0.3) as commander, Multiranger(scf) as ranger:
        lab.wait_until(lambda: drone.position[2] > 0.25, within=5.0)
        x = drone.position[0]
        drone.set_log("range.front", 150)
        lab.wait_until(lambda: ranger.front is not None and ranger.front < 0.2, within=5.0)
        commander.start_linear_motion(-0.5, 0.0, 0.0)
        lab.wait_until(lambda: drone.position[0] < x - 0.2, within=5.0)
        drone.set_log("range.front", 32766)
        lab.wait_until(lambda: ranger.front is None, within=5.0)
        commander.stop()
    lab.wait_until(lambda: drone.position[2] < 0.15, within=5.0)


def test_parameters_are_listed_watched_and_set(lab: Lab, scf: SyncCrazyflie) -> None:
    parameters, heard = scf.cf.param, queue.SimpleQueue[tuple[str, str]]()
    parameters.add_update_callback(group="ring", cb=lambda name, value: heard.put((name, value)))
    listed = {f"{group}.{name}" for group, names in parameters.toc.toc.items() for name in names}
    assert {"ring.effect", "stabilizer.estimator", "kalman.pNAcc_xy"} <= listed
    before = parameters.get_value("ring.effect")
    parameters.set_value("ring.effect", "10")
    while heard.get(timeout=PATIENCE_S) != ("ring.effect", "10"):
        pass
    assert parameters.get_value("ring.effect") == "10" != before
    lab.drones[0].reboot()
    with SyncCrazyflie(lab.drones[0].uri, cf=Crazyflie()) as again:
        again.wait_for_params()
        assert again.cf.param.get_value("ring.effect") == before


@pytest.mark.further
@pytest.mark.parametrize("lab", [2], indirect=True)
def test_a_swarm_takes_off_and_lands(lab: Lab, tmp_path: Path) -> None:
    uris = [drone.uri for drone in lab.drones]
    by_uri = dict(zip(uris, lab.drones, strict=True))

    def fly(scf: SyncCrazyflie) -> None:
        drone = by_uri[scf.cf.link_uri]
        arm(lab, drone, scf.cf)
        scf.cf.high_level_commander.takeoff(0.5, 1.5)
        lab.wait_until(lambda: drone.position[2] > 0.47, within=8.0)
        scf.cf.high_level_commander.land(0.0, 1.5)
        lab.wait_until(lambda: drone.position[2] < 0.15, within=8.0)

    with Swarm(uris, factory=CachedCfFactory(rw_cache=str(tmp_path / "cache"))) as swarm:
        swarm.reset_estimators()
        swarm.parallel_safe(fly)
    for drone in lab.drones:
        assert highest(lab, drone.name) == pytest.approx(0.5, abs=0.1)
