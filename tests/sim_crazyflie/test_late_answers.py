"""The drone answers late, as a real one does: echo first, then the callback, then the control loop."""

import math
import struct

import pytest

from onboard.app_interface import REQUEST_TIMEOUT_MS, LandingState, Parameter, TrajectoryStatus
from onboard.firmware.constants import vehicle_crc32
from onboard.landing.state_machine import HAND_OVER_CLIMB, HAND_OVER_SPEED
from onboard.trajectory import ApproachPlan
from onboard.vehicle import load_vehicle
from sim_backend.crazyflie.crtp import Packet
from sim_backend.crazyflie.ports.param import ParamPort
from tests.sim_crazyflie.simulated_flight import LEGS, VEHICLE, Flight
from tests.sim_crazyflie.test_landing_app import PLAN, give, ready_to_go, run_until, state

pytestmark = pytest.mark.usefixtures("either_engine")

PARAM, READ, WRITE, MISC = 2, 1, 2, 3


class Wire:
    """A client's packets to the parameter task of a flying drone, and all that comes back."""

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        self.sent: list[Packet] = []
        self._port = ParamPort(flight.firmware.params, self.sent.append)

    def write(self, name: str, value: int) -> bytes:
        """Write a u8; the packet's payload, which is the echo's too."""
        payload = self._ident(name) + bytes([value])
        self._port.handle(Packet(PARAM, WRITE, payload))
        return payload

    def read(self, name: str) -> None:
        self._port.handle(Packet(PARAM, READ, self._ident(name)))

    def tick(self) -> None:
        self.flight.tick()
        self._port.poll()

    def take(self) -> list[tuple[int, bytes]]:
        """Channel and payload of what came since the last call, without notices of changed values."""
        sent = [(packet.channel, packet.payload) for packet in self.sent if packet.channel != MISC]
        self.sent.clear()
        return sent

    def reads(self, name: str, value: int) -> tuple[int, bytes]:
        """The answer to a read of a u8."""
        return READ, self._ident(name) + bytes([0, value])

    def _ident(self, name: str) -> bytes:
        return struct.pack("<H", self.flight.firmware.params.entry(name).ident)


def hovering_at_the_start(plan: ApproachPlan = PLAN) -> Flight:
    flight = Flight()
    flight.set_plan(plan)
    flight.fly_to_start(plan)
    return flight


def test_the_echo_stands_before_the_app_knows_of_the_write() -> None:
    wire = Wire(hovering_at_the_start())
    echo = wire.write(Parameter.TRAJECTORY_ARM, 1)
    assert wire.take() == [(WRITE, echo)]
    assert wire.flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.NONE
    assert state(wire.flight) is LandingState.IDLE
    wire.tick()
    assert state(wire.flight) is LandingState.IDLE, "the callback has only posted the request"
    wire.flight.run(REQUEST_TIMEOUT_MS / 1000.0)
    assert state(wire.flight) is LandingState.TRAJECTORY_ARMED
    assert wire.flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED


def test_the_next_packet_waits_for_the_callback_and_finds_the_answer() -> None:
    wire = Wire(hovering_at_the_start())
    wire.write(Parameter.TRAJECTORY_ARM, 1)
    wire.read(Parameter.TRAJECTORY_STATUS)
    second = wire.write(Parameter.POLICY_ARM, 0)
    assert len(wire.take()) == 1, "the echo alone"
    waited = 0
    while not (answers := wire.take()):
        wire.tick()
        waited += 1
        assert waited <= REQUEST_TIMEOUT_MS + 1
    assert waited >= 2
    assert answers == [wire.reads(Parameter.TRAJECTORY_STATUS, TrajectoryStatus.ARMED), (WRITE, second)]


def test_a_set_by_name_is_answered_after_its_callback() -> None:
    wire = Wire(hovering_at_the_start())
    names = b"perch\0trjArm\0"
    wire._port.handle(Packet(PARAM, MISC, b"\0" + names + b"\x08\1"))
    assert not wire.sent
    wire.flight.run(0.01)
    wire._port.poll()
    assert wire.sent[0].payload == b"\0" + names + b"\0"
    assert state(wire.flight) is LandingState.TRAJECTORY_ARMED


def test_while_the_control_loop_does_not_answer_the_status_is_none() -> None:
    flight = hovering_at_the_start()
    flight.write(Parameter.ACCELERATION_X, 0.0)
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.REFUSED_NUMBERS
    flight.write(Parameter.ACCELERATION_X, PLAN.ax)
    params = flight.firmware.params
    flight.post(Parameter.TRAJECTORY_ARM, 1)
    for _ in range(REQUEST_TIMEOUT_MS + 1):
        assert params.busy
        assert flight.firmware.app is not None
        params.run_callback()  # the parameter task alone: the control loop hangs
        assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.NONE
    assert not params.busy, "a callback that waits for ever would starve the other parameters"
    flight.run(0.004)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED


def test_the_plan_is_that_of_the_request() -> None:
    flight = hovering_at_the_start()
    flight.post(Parameter.TRAJECTORY_ARM, 1)
    flight.tick()  # the callback has run
    raw = flight.firmware.params.entry(Parameter.SPEED_Z)
    flight.firmware.params.write_raw(raw.ident, raw.encode(9.0))
    flight.run(0.01)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED
    give(flight, Parameter.GO)
    flight.run(PLAN.t_x + PLAN.t_z)
    assert flight.drone.state["velocity"][2] == pytest.approx(PLAN.vz, abs=0.4)


def test_an_armed_approach_is_replaced_as_a_whole_or_refused() -> None:
    flight = hovering_at_the_start()
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED, "a write that came twice"
    flight.write(Parameter.IMPACT_X, 3.0)
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.REFUSED_TOO_FAR
    assert state(flight) is LandingState.IDLE
    assert flight.param(Parameter.TRAJECTORY_ARM) == 0


def test_a_go_counts_once_and_only_at_its_time() -> None:
    flight = hovering_at_the_start()
    give(flight, Parameter.GO)
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    flight.run(0.1)
    assert state(flight) is LandingState.TRAJECTORY_ARMED, "an old go must not start a newly armed approach"
    flight.post(Parameter.GO, 1)
    assert state(flight) is LandingState.TRAJECTORY_ARMED
    flight.run(0.004)
    assert state(flight) is LandingState.APPROACH
    assert flight.param(Parameter.GO) == 0
    give(flight, Parameter.ABORT)
    run_until(flight, LandingState.HOLD)
    flight.write(Parameter.TRAJECTORY_ARM, 0)
    run_until(flight, LandingState.IDLE, 0.01)
    assert flight.go_to(PLAN.x0, PLAN.y0, PLAN.z0, 4.0) == 0
    flight.run(6.0)
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    flight.run(0.5)
    assert state(flight) is LandingState.TRAJECTORY_ARMED, "neither go nor abort is left over"


def test_the_state_can_be_asked_for() -> None:
    flight = ready_to_go()
    for wanted in (LandingState.TRAJECTORY_ARMED, LandingState.APPROACH, LandingState.FLIP, LandingState.CUT):
        if wanted is LandingState.APPROACH:
            give(flight, Parameter.GO)
        run_until(flight, wanted)
        assert flight.param(Parameter.STATE) == wanted


@pytest.mark.parametrize(
    "phase_ms", [0, *(pytest.param(between, marks=pytest.mark.soak) for between in (2, 4, 6)), 8]
)
def test_a_drone_in_motion_is_handed_over_without_a_gap(phase_ms: int) -> None:
    """The planner speaks every 10 ms, its old goal is metres away: no step of the loop may follow that."""
    flight = hovering_at_the_start()
    firmware = flight.firmware
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    give(flight, Parameter.GO)
    flight.run(1.6)
    give(flight, Parameter.ABORT)
    run_until(flight, LandingState.HOLD)
    flight.run(2.0, until=lambda: slow_enough(flight) and firmware.tick_ms() % 10 == phase_ms)
    flight.post(Parameter.TRAJECTORY_ARM, 0)
    caught, handed_over_ms = flight.position, None
    for elapsed in range(3000):
        flight.tick()
        if handed_over_ms is None and state(flight) is LandingState.IDLE:
            handed_over_ms = elapsed
            assert speed(flight) > 0.25
        assert not firmware.setpoint.is_null
        if elapsed < 200:
            assert firmware.ratios.any(), f"the motors stand still after {elapsed} ms"
        assert math.dist(firmware.setpoint.position, flight.position) < 0.3, f"after {elapsed} ms"
    assert handed_over_ms is not None
    assert handed_over_ms <= 4
    assert speed(flight) < 0.05
    assert math.dist(flight.position, caught) < 0.15, "it stays where it was caught"


@pytest.mark.further
def test_switches_cleared_at_speed_hand_over_after_the_hold_has_slowed_down() -> None:
    flight = hovering_at_the_start()
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    give(flight, Parameter.GO)
    flight.run(1.6)
    assert speed(flight) > 1.2
    flight.write(Parameter.TRAJECTORY_ARM, 0)
    assert state(flight) in (LandingState.BRAKE, LandingState.HOLD)
    assert flight.run(3.0, until=lambda: state(flight) is LandingState.IDLE) < 2.0
    assert speed(flight) <= HAND_OVER_SPEED + 0.1, "the estimate was"
    assert flight.land() == 0
    flight.run(4.0)
    assert flight.position[2] < 0.1


def slow_enough(flight: Flight) -> bool:
    """With something to spare for the estimate."""
    climb = flight.drone.state["velocity"][2]
    return speed(flight) < HAND_OVER_SPEED - 0.1 and climb < HAND_OVER_CLIMB - 0.05


def speed(flight: Flight) -> float:
    return math.hypot(*flight.drone.state["velocity"].tolist())


def test_supervisor_bits_are_up_to_40_ms_old_and_answers_are_not() -> None:
    ages = [age_of_the_armed_bit(1000 + offset) for offset in range(0, 40, 8)]
    assert ages == [40, 32, 24, 16, 8]


def age_of_the_armed_bit(after_ms: int) -> int:
    """ms until an arming at that time shows."""
    flight = Flight()
    flight.run(after_ms / 1000.0)
    supervisor = flight.firmware.supervisor
    assert supervisor.arm(True)
    assert supervisor.is_armed
    assert not flight.info.is_armed
    age = flight.run(0.1, until=lambda: flight.info.is_armed)
    assert supervisor.arm(False)
    assert not supervisor.is_armed
    assert flight.info.is_armed, "disarming shows as late"
    return round(1000 * age)


def test_an_emergency_stop_shows_in_the_bits_after_it_has_stopped() -> None:
    flight = Flight()
    flight.hover(0.5)
    flight.firmware.supervisor.emergency_stop()
    assert not flight.info.is_locked
    stopped = flight.run(0.1, until=lambda: not flight.firmware.ratios.any())
    assert stopped <= 0.041
    locked = flight.run(0.1, until=lambda: flight.info.is_locked)
    assert locked <= 0.041


def test_the_drone_reports_the_checksum_of_what_it_was_flashed_with() -> None:
    true, flashed = load_vehicle(VEHICLE, LEGS), load_vehicle("crazyflie21-stock")
    assert vehicle_crc32(true) != vehicle_crc32(flashed)
    assert Flight().param(Parameter.VEHICLE_CRC) == vehicle_crc32(true)
    other = Flight(flashed=flashed)
    assert other.param(Parameter.VEHICLE_CRC) == vehicle_crc32(flashed)
    other.firmware.reboot()
    assert other.param(Parameter.VEHICLE_CRC) == vehicle_crc32(flashed)
