"""The simulated drone in simulated time: it flies, it drifts, and it keeps the real firmware's rules."""

import errno
import math
import struct

import numpy as np
import pytest

from calibration.bench.instruments.motor_token import EVERY_S
from onboard.app_interface import MOTOR_STOP_MS, MOTOR_TOKEN_MS, Parameter
from onboard.policy.bundle import encode_bundle
from sim_backend.crazyflie.high_level import HighLevelCommand, PlannerState
from sim_backend.crazyflie.interfaces import FirmwareAssertion
from sim_backend.crazyflie.kalman import P_VELOCITY
from sim_backend.crazyflie.power import PowerState
from sim_backend.crazyflie.supervisor import SupervisorState
from sim_backend.engine_name import EngineName
from sim_backend.lab_faults import DroneFaults
from tests.sim_crazyflie.simulated_flight import Flight
from tests.sim_crazyflie.small_policy import small_policy


@pytest.fixture
def flight() -> Flight:
    return Flight()


@pytest.fixture
def hovering() -> Flight:
    flight = Flight()
    flight.hover()
    return flight


def rpyt(thrust: int) -> bytes:
    return struct.pack("<fffH", 0.0, 0.0, 0.0, thrust)


def hold(x: float, y: float, z: float) -> bytes:
    return struct.pack("<Bffff", 7, x, y, z, 0.0)


def test_takes_off_and_holds_within_a_centimetre(hovering: Flight) -> None:
    mark = hovering.drone.mark
    errors = []
    for _ in range(20):
        hovering.run(0.1)
        errors.append(np.abs(np.array(hovering.position) - [mark.x, mark.y, 0.5]).max())
    assert max(errors) < 0.01
    assert hovering.info.is_flying
    estimate = np.array(hovering.firmware.estimator.position())
    assert np.abs(estimate - hovering.position).max() < 0.01


def test_goes_where_it_is_sent_and_lands(hovering: Flight) -> None:
    assert hovering.go_to(-1.5, 0.3, 1.2, 3.0) == 0
    hovering.run(4.5)
    assert hovering.position == pytest.approx([-1.5, 0.3, 1.2], abs=0.02)
    assert hovering.land() == 0
    hovering.run(5.0)
    assert hovering.position[2] < 0.1
    assert not hovering.firmware.ratios.any()
    hovering.run(6.0)
    assert not hovering.info.is_armed


def test_without_poses_the_drone_drifts_away_and_its_variance_says_so(hovering: Flight) -> None:
    estimator = hovering.firmware.estimator
    known = float(estimator.state[P_VELOCITY])

    def error() -> float:
        return float(np.linalg.norm(np.array(estimator.position()) - hovering.position))

    with_poses = error()
    hovering.poses = False
    without = []
    for _ in range(4):
        hovering.run(2.0)
        without.append(error())
    assert max(without) > 0.02 > 5 * with_poses
    assert estimator.state[P_VELOCITY] > 5 * known
    assert hovering.log("kalman.varPX") == pytest.approx(estimator.state[P_VELOCITY])


def test_high_level_commands_are_refused_while_it_may_not_fly(flight: Flight) -> None:
    flight.run(0.5)
    assert flight.takeoff(0.5) == errno.EBUSY
    flight.run(1.0)
    assert flight.position[2] < 0.1


def test_a_take_off_in_the_moment_that_flying_is_allowed_is_not_refused(flight: Flight) -> None:
    flight.run(1.0)
    assert flight.firmware.supervisor.arm(True)
    flight.run(1.0, until=lambda: flight.info.can_fly)
    assert flight.takeoff(0.5) == 0


@pytest.mark.parametrize(("wait_s", "x"), [(0.005, 0.0), (0.011, -2.5)])
def test_a_take_off_within_10_ms_of_may_fly_goes_to_the_origin(
    flight: Flight, wait_s: float, x: float
) -> None:
    flight.run(1.0)
    assert flight.firmware.supervisor.arm(True)
    flight.run(1.0, until=lambda: flight.info.can_fly)
    flight.run(wait_s)
    assert flight.takeoff(0.5) == 0
    flight.run(2.0)
    assert flight.position[0] == pytest.approx(x, abs=0.4)


def test_the_high_level_commander_hovers_on_when_the_host_is_gone(hovering: Flight) -> None:
    hovering.run(5.0)  # nobody sends anything but poses
    assert hovering.info.is_flying
    assert hovering.position[2] == pytest.approx(0.5, abs=0.02)


def test_streamed_setpoints_that_stop_level_out_then_drop_the_drone_and_lock_it(hovering: Flight) -> None:
    mark = hovering.drone.mark
    for _ in range(100):
        hovering.firmware.commander.setpoint_generic(hold(mark.x, mark.y, 0.5))
        hovering.run(0.01)
    supervisor = hovering.firmware.supervisor
    level_out = hovering.run(5.0, until=lambda: supervisor.state is SupervisorState.WARNING_LEVEL_OUT)
    assert 0.48 <= level_out <= 0.56
    assert hovering.firmware.ratios.all()
    locked = hovering.run(5.0, until=lambda: supervisor.state is SupervisorState.LOCKED)
    assert 1.98 <= level_out + locked <= 2.12
    hovering.run(1.0)
    assert hovering.position[2] < 0.1
    assert hovering.info.is_locked
    assert not hovering.firmware.supervisor.arm(True)


def test_notify_stop_hands_back_to_the_high_level_commander(hovering: Flight) -> None:
    mark = hovering.drone.mark
    for _ in range(30):
        hovering.firmware.commander.setpoint_generic(hold(mark.x + 0.2, mark.y, 0.6))
        hovering.run(0.05)
    assert hovering.firmware.high_level.state is PlannerState.IDLE
    hovering.firmware.commander.notify_setpoints_stop(0)
    assert hovering.go_to(mark.x + 0.2, mark.y, 0.6, 1.0) == 0
    hovering.run(4.0)
    assert hovering.info.is_flying
    assert hovering.position[2] == pytest.approx(0.6, abs=0.02)


def test_a_velocity_setpoint_moves_at_that_velocity(hovering: Flight) -> None:
    for _ in range(200):
        hovering.firmware.commander.setpoint_generic(struct.pack("<Bffff", 8, 0.4, 0.0, 0.0, 0.0))
        hovering.run(0.01)
    assert hovering.drone.state["velocity"][0] == pytest.approx(0.4, abs=0.06)
    assert hovering.position[2] == pytest.approx(0.5, abs=0.05)


def test_roll_pitch_setpoints_tilt_in_the_documented_sense(hovering: Flight) -> None:
    hovering.firmware.commander.setpoint_rpyt(rpyt(0))
    for _ in range(25):
        # cflib negates pitch on this port: -8 on the wire is what a client calls +8 degrees, nose down
        packet = struct.pack("<fffH", 5.0, -8.0, 0.0, 42000)
        hovering.firmware.commander.setpoint_rpyt(packet)
        hovering.run(0.01)
    vx, vy, _ = hovering.drone.state["velocity"]
    assert vx > 0.05, "nose down flies forward"
    assert vy < -0.03, "right side down flies to the right"
    assert hovering.log("stabilizer.pitch") == pytest.approx(-8.0, abs=4.0)


def test_wrong_setpoint_length_is_an_assert_and_a_reboot(hovering: Flight) -> None:
    with pytest.raises(FirmwareAssertion):
        hovering.firmware.commander.setpoint_generic(b"\x08\x00")
    boots = hovering.firmware.boot_count
    hovering.firmware.assert_failed("test")
    assert hovering.firmware.boot_count == boots + 1
    assert not hovering.firmware.ratios.any()
    assert any("assert" in line for line in hovering.firmware.take_console())
    hovering.run(2.0)
    assert hovering.position[2] < 0.1
    hovering.write("system.doAssert", 1)
    assert hovering.firmware.boot_count == boots + 2
    assert any("doAssert" in line for line in hovering.firmware.take_console())


def test_stop_parameter_and_emergency_stop_drop_it(hovering: Flight) -> None:
    hovering.write("stabilizer.stop", 1)
    hovering.run(0.1)
    assert hovering.info.is_locked
    assert not hovering.firmware.ratios.any()


def test_watchdog_of_the_localization_port(hovering: Flight) -> None:
    hovering.firmware.localization.emergency_stop_watchdog()
    stopped = hovering.run(3.0, until=lambda: hovering.info.is_locked)
    assert 0.98 <= stopped <= 1.12


def test_turned_over_in_flight_it_crashes_and_recovers_upright(hovering: Flight) -> None:
    hovering.drone.state["quaternion"] = [1.0, 0.0, 0.0, 0.0]
    hovering.drone.state["position"][2] = 0.05
    hovering.run(1.5)
    assert hovering.info.is_crashed
    assert not hovering.firmware.ratios.any()
    assert hovering.takeoff(0.5) == errno.EBUSY
    assert not hovering.firmware.supervisor.recover()
    hovering.drone.place_on_start_mark()
    hovering.run(0.5)
    assert hovering.firmware.supervisor.recover()
    hovering.run(0.5)
    assert hovering.info.can_arm


def test_motor_power_set_turns_motors_of_a_disarmed_drone(flight: Flight) -> None:
    flight.run(0.5)
    flight.write("motorPowerSet.m2", 20000)
    flight.write("motorPowerSet.enable", 1)
    flight.run(0.1)
    assert flight.firmware.ratios.tolist() == [0, 20000, 0, 0]
    assert flight.log("motor.m2") == 20000
    assert flight.drone.state["thrust"][1] > 0.0
    flight.write("motorPowerSet.enable", 0)
    flight.run(0.1)
    assert not flight.firmware.ratios.any()


def test_motors_of_a_host_that_vouched_for_them_stop_when_it_falls_silent(
    either_engine: EngineName,
) -> None:
    """At every phase of the loops of 2, 10 and 40 ms, on the drone's own clock."""
    flight = Flight()
    flight.write("motorPowerSet.m1", 20000)
    for phase in range(0, 40, 3):
        flight.run(1e-3 * (40 - flight.world.ticks % 40 + phase))
        flight.write("motorPowerSet.enable", 1)
        for _ in range(2):
            flight.write(Parameter.MOTOR_TOKEN, 1)
            flight.run(4 * EVERY_S)
            assert flight.firmware.ratios[0] == 20000
        flight.post(Parameter.MOTOR_TOKEN, 1)
        stopped = flight.run(1.0, until=lambda: not flight.firmware.ratios.any())
        assert 1e-3 * MOTOR_TOKEN_MS <= stopped <= 1e-3 * MOTOR_STOP_MS
        assert flight.firmware.params["motorPowerSet.enable"] == 0


def test_pwm_has_eight_bits(hovering: Flight) -> None:
    duties = np.array([hovering.firmware._duties * 256])
    assert duties == pytest.approx(np.round(duties))
    assert duties.min() > 100


def test_battery_compensation_holds_the_thrust_on_an_empty_pack() -> None:
    ratios = []
    for voltage in (4.1, 3.6):
        flight = Flight(faults=DroneFaults(battery_voltage=voltage))
        flight.hover()
        assert flight.position[2] == pytest.approx(0.5, abs=0.015)
        ratios.append(float(flight.firmware.ratios.mean()))
    assert ratios[1] > 1.1 * ratios[0]


def test_low_battery_is_reported_after_five_seconds() -> None:
    flight = Flight(faults=DroneFaults(battery_voltage=3.15))
    flight.run(4.9)
    assert flight.log("pm.state") == PowerState.BATTERY
    flight.run(0.4)
    assert flight.log("pm.state") == PowerState.LOW_POWER
    assert flight.log("pm.vbat") == pytest.approx(3.15, abs=0.03)
    assert flight.log("pm.batteryLevel") == 10
    flight.write("pm.lowVoltage", 3.0)
    flight.run(0.2)
    assert flight.log("pm.state") == PowerState.BATTERY


def test_logs_have_the_firmwares_units(hovering: Flight) -> None:
    hovering.run(0.5)
    assert hovering.log("acc.z") == pytest.approx(1.0, abs=0.1)
    assert hovering.log("stateEstimateZ.z") == pytest.approx(1000 * hovering.log("stateEstimate.z"), abs=1)
    assert hovering.log("ctrltarget.z") == pytest.approx(0.5)
    assert hovering.log("stateEstimate.qw") == pytest.approx(1.0, abs=0.01)
    assert hovering.log("locSrv.z") == pytest.approx(0.5, abs=0.01)
    assert hovering.firmware.tick_ms() - hovering.log("locSrvZ.tick") <= 20
    assert hovering.log("estimator.rtApnd") == 100
    assert 3.2 < hovering.log("pm.vbat") < 3.7
    assert hovering.log("pm.vbatMV") == pytest.approx(1000 * hovering.log("pm.vbat"), abs=1)
    assert hovering.log("supervisor.info") == hovering.firmware.supervisor.info_bits()
    assert hovering.param("system.selftestPassed") == 1


def test_every_log_variable_can_be_sent(hovering: Flight) -> None:
    for variable in hovering.firmware.logs.entries:
        value = hovering.firmware.logs.value(variable.ident)
        # the cues are infinite while there is no approach and no ceiling
        assert math.isfinite(value) or variable.full_name in ("perch.tau", "perch.thetaX"), variable


def test_reset_of_the_estimator_clears_its_own_parameter(hovering: Flight) -> None:
    hovering.poses = False
    hovering.write("kalman.initialX", 1.5)
    hovering.write("kalman.resetEstimation", 1)
    assert hovering.firmware.estimator.position() == pytest.approx((1.5, 0.0, 0.0))
    assert hovering.param("kalman.resetEstimation") == 0


def test_nan_pose_ends_in_standing_motors_not_in_an_error(hovering: Flight) -> None:
    hovering.firmware.localization.external_pose(math.nan, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0)
    hovering.run(1.0)
    assert np.isfinite(hovering.firmware._duties).all()
    assert math.isnan(hovering.log("stateEstimate.x"))


def test_reboot_loses_ram_but_not_stored_parameters(flight: Flight) -> None:
    assert flight.upload(encode_bundle(small_policy())) == 1
    flight.write("kalman.initialZ", 0.25)
    entry = flight.firmware.params.entry("supervisor.landedTimeout")
    flight.write(entry.full_name, 1234)
    flight.firmware.params.store(entry.ident)
    flight.arm()
    flight.firmware.power_off()
    tick = flight.firmware.tick_ms()
    flight.run(0.5)
    assert flight.firmware.tick_ms() == tick, "nothing runs without power"
    flight.firmware.reboot()
    assert flight.firmware.tick_ms() == 0
    assert not flight.info.is_armed
    assert flight.param("perch.polActCrc") == 0
    assert flight.log("perch.polCrc") == 0
    assert flight.firmware.memories[1].read(0, 4) == bytes(4)
    assert flight.param("kalman.initialZ") == 0.0
    assert flight.firmware.supervisor.landed_timeout_ms == 1234
    flight.hover()
    assert flight.position[2] == pytest.approx(0.5, abs=0.02)


def test_uploaded_trajectory_is_flown_from_the_memory_port(hovering: Flight) -> None:
    memory = next(m for m in hovering.firmware.memories if m.type_id == 0x12)
    piece = [0.0] * 32
    piece[2] = 0.05  # x = 0.05 t^2
    piece[16] = 0.0
    assert memory.write(0, struct.pack("<33f", *piece, 2.0))
    assert hovering.high_level(HighLevelCommand.DEFINE_TRAJECTORY, "<BBBIB", 1, 1, 0, 0, 1) == 0
    assert hovering.high_level(HighLevelCommand.START_TRAJECTORY_2, "<BBBBBf", 0, 1, 0, 0, 1, 1.0) == 0
    x = hovering.position[0]
    hovering.run(3.0)
    assert hovering.position[0] - x == pytest.approx(0.2, abs=0.05)
    assert hovering.position[2] == pytest.approx(0.5, abs=0.02)


def test_same_seed_same_flight() -> None:
    ends = []
    for _ in range(2):
        flight = Flight(seed=7)
        flight.hover()
        ends.append(flight.position)
    assert ends[0] == ends[1]
