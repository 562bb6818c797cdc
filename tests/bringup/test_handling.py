"""What people do to a simulated drone: the faults that the ladder must find, by the physics."""

import numpy as np
import pytest

from onboard.gravity import GRAVITY
from onboard.vehicle import load_vehicle
from perchhw.doctor.mocap_checks import up_of
from sim_backend.fault_values import FaultError, Window
from sim_backend.faults import parse_faults
from sim_backend.handling import WIRED, wiring_of
from sim_backend.lab_faults import DroneFaults
from sim_backend.world import World

BOARD = np.array([0.1, 0.2, 0.3, 0.4])


def test_exchanged_connectors_and_a_wrong_propeller() -> None:
    assert wiring_of(DroneFaults()) == WIRED
    assert wiring_of(DroneFaults(motors_swapped=(1, 3))).delivered(BOARD) == pytest.approx(
        [0.3, 0.2, 0.1, 0.4]
    )
    assert wiring_of(DroneFaults(propeller_reversed=2)).delivered(BOARD) == pytest.approx([0.1, 0, 0.3, 0.4])
    reversed_ = wiring_of(DroneFaults(motor_reversed=4))
    assert reversed_.delivered(BOARD) == pytest.approx([0.1, 0.2, 0.3, 0.0])
    both = DroneFaults(motors_swapped=(1, 2), propeller_reversed=1)
    assert wiring_of(both).delivered(BOARD) == pytest.approx([0.0, 0.1, 0.3, 0.4])


@pytest.mark.parametrize("text", ["1", "1,1", "0,2", "1,5", "1,2,3", "a,b"])
def test_motors_that_cannot_be_exchanged(text: str) -> None:
    with pytest.raises(FaultError, match="motors_swapped"):
        parse_faults([f"motors_swapped={text}"])


def test_a_drone_in_a_hand_is_tilted_twice_and_then_put_back_on_its_mark() -> None:
    world = World(load_vehicle("crazyflie21-upgraded"), faults=DroneFaults(held_at=Window(0.5, 1.5)))
    drone = world.drones[0]
    ups = []
    for until in (0.75, 1.25):
        world.run(until - world.time)
        up = np.array(up_of(drone.pose()[2]))
        assert np.array(drone.state["specific_force"]) == pytest.approx(GRAVITY * up, abs=1e-6)
        assert not np.any(drone.state["omega"])
        ups.append(up)
    assert ups[0] == pytest.approx([-0.5, 0.0, 0.8660254], abs=1e-6)  # x points down: the nose
    assert ups[1] == pytest.approx([0.0, -0.5, 0.8660254], abs=1e-6)  # y points down: the left side
    world.run(0.5)
    assert (drone.held, drone.placements) == (None, 1)
    assert up_of(drone.pose()[2]) == pytest.approx([0.0, 0.0, 1.0], abs=0.01)


def test_a_drone_that_is_hung_turns_to_and_fro_until_it_is_put_back() -> None:
    world = World(load_vehicle("crazyflie21-upgraded"), faults=DroneFaults(hung_at=Window(0.1, 4.2)))
    drone = world.drones[0]
    world.run(0.1)
    rates = []
    for _ in range(40):
        world.run(0.1)
        assert drone.hung is not None
        assert drone.pose()[1][2] == 1.0
        rates.append(float(drone.state["omega"][2]))
    assert max(rates) == pytest.approx(-min(rates), rel=0.05)
    world.run(0.2)
    assert (drone.hung, drone.placements) == (None, 1)


def test_who_surveys_the_room_leaves_a_drone_in_the_air_alone() -> None:
    world = World(load_vehicle("crazyflie21-upgraded"), faults=DroneFaults(survey_at=Window(0.0, 3.0)))
    drone = world.drones[0]
    drone.state["position"][2] = 1.0
    world.run(0.2)
    assert (drone.turned, float(drone.state["position"][2]) > 0.7) == (False, True)
    world.run(2.3)
    assert drone.turned
