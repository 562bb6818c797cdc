"""Values that a test injects into the logs and sensors of a simulated drone."""

import json
from collections.abc import Iterator
from pathlib import Path

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

from perchhw.testing import Lab, SimulatedDrone, StageFailed, StageProcess
from perchhw.testing.instant import InstantLab
from sim_backend.acts import ActError
from sim_backend.crazyflie.tables import NoSuchTableEntry, ValueNotRepresentable

WATCHED = ("gyro.z", "acc.x", "pm.vbat", "pm.state", "range.zrange")


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[InstantLab]:
    cflib.crtp.init_drivers()
    lab = InstantLab(tmp_path / "lab")
    yield lab
    lab.close()


class Logged:
    """The newest of what cflib is told."""

    def __init__(self, lab: InstantLab, cf: Crazyflie) -> None:
        self._lab, self._values = lab, dict[str, float]()
        config = LogConfig("watched", period_in_ms=10)
        for name in WATCHED:
            config.add_variable(name, "float")
        cf.log.add_config(config)
        config.data_received_cb.add_callback(lambda _t, values, _c: self._values.update(values))
        config.start()

    def after(self, seconds: float) -> dict[str, float]:
        self._lab.run_for(seconds)
        return dict(self._values)


@pytest.fixture
def drone(lab: InstantLab) -> SimulatedDrone:
    return lab.drones[0]


@pytest.fixture
def logged(lab: InstantLab, drone: SimulatedDrone, tmp_path: Path) -> Iterator[Logged]:
    with SyncCrazyflie(drone.uri, cf=Crazyflie(rw_cache=str(tmp_path / "cache"))) as scf:
        yield Logged(lab, scf.cf)


def test_a_log_says_what_the_test_wants_until_it_is_released(
    lab: InstantLab, drone: SimulatedDrone, logged: Logged
) -> None:
    assert logged.after(0.1)["range.zrange"] == 0.0
    drone.set_log("range.zrange", 420)
    drone.set_log("pm.vbat", 3.05)
    seen = logged.after(0.1)
    assert seen["range.zrange"] == 420.0
    assert seen["pm.vbat"] == pytest.approx(3.05)
    assert drone.voltage > 4.0
    assert logged.after(6.0)["pm.state"] == 0.0  # the drone itself knows better
    drone.release_log("pm.vbat")
    assert logged.after(0.1)["pm.vbat"] == pytest.approx(drone.voltage, abs=0.1)
    events = [json.loads(line) for line in (lab.folder / "events.jsonl").read_text().splitlines()]
    assert [event["value"] for event in events] == [420, 3.05, None]


def test_a_battery_that_is_measured_low_is_low_to_the_drone(drone: SimulatedDrone, logged: Logged) -> None:
    drone.offset_voltage(-1.1)
    seen = logged.after(6.0)
    assert seen["pm.vbat"] == pytest.approx(drone.voltage - 1.1, abs=0.1)
    assert seen["pm.state"] == 3.0  # low power


def test_sensors_show_too_much_at_once_and_no_more_with_every_call(
    drone: SimulatedDrone, logged: Logged
) -> None:
    logged.after(0.3)
    drone.offset_gyro(z=0.5)
    drone.offset_gyro(z=0.2)
    drone.offset_accelerometer(x=0.981)
    for _ in range(2):  # also when the noise is drawn anew, every second
        seen = logged.after(0.9)
        assert seen["gyro.z"] == pytest.approx(11.459, abs=1.0)  # deg/s
        assert seen["acc.x"] == pytest.approx(0.1, abs=0.05)  # g
    drone.offset_gyro()
    assert logged.after(0.3)["gyro.z"] == pytest.approx(0.0, abs=1.0)


def test_what_is_not_there_cannot_be_injected(drone: SimulatedDrone) -> None:
    with pytest.raises(NoSuchTableEntry, match=r"pm\.none"):
        drone.set_log("pm.none", 1.0)
    with pytest.raises(ValueNotRepresentable, match="70000 does not fit U16"):
        drone.set_log("range.zrange", 70000)
    with pytest.raises(ActError, match="gyro, accelerometer, voltage"):
        drone._offset("compass", 0.0, 0.0, 0.0)


def test_the_lab_of_a_process_does_the_same(tmp_path: Path) -> None:
    with StageProcess(parked=True) as stage:
        lab = Lab(stage, tmp_path / "lab")
        drone = lab.drones[0]
        drone.set_log("pm.vbat", 3.05)
        drone.offset_voltage(-0.5)
        with pytest.raises(StageFailed, match=r"pm\.none"):
            drone.set_log("pm.none", 1.0)
        with pytest.raises(StageFailed, match="parked"):
            drone.offset_gyro(z=1.0)
        lab.close()
