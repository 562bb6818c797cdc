"""Builds of the firmware that are not what our app needs, and what the firmware says of itself."""

import numpy as np
import pytest

from sim_backend.crazyflie.build import Build, BuildError, known_decks
from sim_backend.crazyflie.supervisor import SupervisorState
from tests.sim_crazyflie.simulated_flight import Flight


def test_our_build_stays_disarmed_and_its_motors_stand_when_armed() -> None:
    flight = Flight()
    flight.run(2.0)
    assert not flight.info.is_armed
    assert not flight.info.auto_arm
    flight.arm()
    assert not flight.firmware.ratios.any()


def test_a_build_that_arms_by_itself_says_so_and_arms_again() -> None:
    flight = Flight(build=Build(auto_arm=True))
    flight.run(2.0)
    assert flight.info.auto_arm
    assert flight.info.is_armed
    assert flight.firmware.supervisor.arm(False)
    flight.run(0.2)
    assert flight.info.is_armed, "it cannot be kept disarmed"


def test_a_build_with_an_idle_thrust_is_disarmed_before_it_can_fly() -> None:
    flight = Flight(build=Build(idle_thrust=7000))
    flight.run(1.0)
    assert flight.param("powerDist.idleThrust") == 7000
    assert not flight.firmware.ratios.any()
    assert flight.firmware.supervisor.arm(True)
    assert not_armed_within_ms(flight, 20)
    flight.run(0.1)
    assert not flight.firmware.ratios.any()
    flight.write("powerDist.idleThrust", 0)
    flight.arm()
    flight.run(0.1)
    assert flight.info.is_armed


@pytest.mark.parametrize(("parameter", "wrong"), [("stabilizer.estimator", 1), ("motorPowerSet.enable", 1)])
def test_whoever_has_the_estimate_or_the_motors_keeps_the_app_disarmed(parameter: str, wrong: int) -> None:
    flight = Flight()
    flight.arm()
    flight.write(parameter, wrong)
    assert not_armed_within_ms(flight, 21)


def not_armed_within_ms(flight: Flight, milliseconds: int) -> bool:
    """Whether the app's slow task, at its next look, has taken back that somebody armed."""
    supervisor = flight.firmware.supervisor
    flight.run(0.001 * milliseconds, until=lambda: not supervisor.is_armed)
    return not supervisor.is_armed


def test_no_motor_is_below_idle_in_flight_and_none_turns_when_stopped() -> None:
    """What flies when somebody changes the configuration does not fall."""
    flight = Flight()
    flight.hover()
    flight.write("powerDist.idleThrust", 7000)
    lowest = []
    for _ in range(500):
        flight.tick()
        lowest.append(int(flight.firmware.ratios.min()))
    assert min(lowest) >= 7000
    assert flight.info.is_flying
    flight.firmware.supervisor.emergency_stop()
    flight.run(0.1)
    assert flight.firmware.supervisor.state is SupervisorState.LOCKED
    assert not flight.firmware.ratios.any()


def test_the_idle_thrust_is_back_after_a_reboot() -> None:
    flight = Flight(build=Build(idle_thrust=7000))
    flight.write("powerDist.idleThrust", 0)
    flight.firmware.reboot()
    assert flight.firmware.idle_thrust == flight.param("powerDist.idleThrust") == 7000


def test_the_firmware_knows_its_processor_and_sensors() -> None:
    flight = Flight()
    assert flight.param("cpu.flash") == 1024
    assert all(flight.param(f"cpu.id{index}") for index in range(3))
    assert flight.param("imu_sensors.BMP3XX") == 1


def test_decks_are_flags_and_a_multiranger_sees_nothing() -> None:
    bare = Flight()
    assert bare.param("deck.bcFlow2") == bare.param("deck.bcMultiranger") == 0
    equipped = Flight(build=Build(decks=known_decks(["bcFlow2", "bcMultiranger"])))
    assert equipped.param("deck.bcFlow2") == equipped.param("deck.bcMultiranger") == 1
    assert equipped.param("deck.bcLoco") == 0
    ranges = np.array([equipped.log(f"range.{d}") for d in ("front", "back", "left", "right", "up")])
    assert (ranges >= 8000).all(), "cflib takes that for no measurement"


def test_an_unknown_deck_names_the_known_ones() -> None:
    with pytest.raises(BuildError, match="bcFlow2"):
        known_decks(["flow"])
