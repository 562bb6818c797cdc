"""Why flips roll: bodies whose secret is known, turned by an equation of the test's own."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calibration.gap.landings.outcomes.roll import RollEvidence, roll_evidence
from onboard.vehicle import Vehicle, load_vehicle

SHARE = -0.157
"""Roll per pitch of the real flips."""

NO_COMMANDS = SimpleNamespace(has=lambda *names: False)


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load_vehicle("crazyflie21-upgraded")


def flips(
    vehicle: Vehicle, product: float = 0.0, unequal: float = 0.0, yaw: float = 0.0, count: int = 10
) -> list[Any]:
    """Gyro of flips: product of inertia (kg m2), unequal front motors (share), turned gyro (rad)."""
    body = vehicle.body
    tensor = np.diag([body.inertia_xx.value, body.inertia_yy.value, body.inertia_zz.value])
    tensor[0, 1] = tensor[1, 0] = product
    inverse = np.linalg.inv(tensor)
    rng = np.random.default_rng(0)
    found = []
    for _ in range(count):
        w, rates, each, dt = np.zeros(3), [], rng.uniform(0.05, 0.06), 1e-3
        for _ in range(180):
            left, right = each * (1.0 + unequal), each * (1.0 - unequal)
            torque = np.array(
                [
                    body.arm_y.value * (left - right),
                    -body.arm_x.value * (left + right),
                    vehicle.motors.thrust_to_torque.value * (left - right),
                ]
            )
            w = w + dt * inverse @ (torque - np.cross(w, tensor @ w))
            rates.append(w)
        c, s = np.cos(yaw), np.sin(yaw)
        gyro = np.array(rates)[::20] @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).T
        gyro += 0.03 * rng.standard_normal(gyro.shape)
        t = 0.02 * np.arange(len(gyro))
        start = SimpleNamespace(gyro_t=t, gyro=gyro, contact=t[-1], contact_error=0.0, flight=NO_COMMANDS)
        found.append(start)
    return found


def evidence(vehicle: Vehicle, **secret: float) -> RollEvidence:
    found = roll_evidence(flips(vehicle, **secret), vehicle, np.random.default_rng(0))
    assert found is not None
    return found


def test_a_product_of_inertia_shows_in_the_yaw(vehicle: Vehicle) -> None:
    product = -SHARE * vehicle.body.inertia_xx.value
    found = evidence(vehicle, product=product)
    causes = {cause.name: cause for cause in found.causes}
    assert found.measured["roll_per_pitch"][0] == pytest.approx(SHARE, abs=0.05)
    assert causes["inertia_products"].value == pytest.approx(product, rel=0.3)
    assert found.left == ("inertia_products",)


def test_a_turned_gyro_refutes_the_product_of_inertia(vehicle: Vehicle) -> None:
    found = evidence(vehicle, yaw=float(np.arctan(SHARE)))
    assert "inertia_products" not in found.left
    assert "gyro turned against the propellers" in found.left


def test_unequal_front_motors_are_not_refuted_by_what_they_do(vehicle: Vehicle) -> None:
    body = vehicle.body
    found = evidence(vehicle, unequal=-SHARE * body.inertia_xx.value / body.inertia_yy.value)
    causes = {cause.name: cause for cause in found.causes}
    assert "motor_imbalance" in found.left
    assert causes["motor_imbalance"].predicted["yaw_rad_s"] == pytest.approx(
        found.measured["yaw_rad_s"][0], abs=0.1
    )


@pytest.mark.parametrize(("count", "beyond"), [(5, 4.604), (10, 3.250), (15, 3.0), (28, 3.0)])
def test_few_flips_refute_less(vehicle: Vehicle, count: int, beyond: float) -> None:
    """Their standard error is itself uncertain: 1 % of Student's t (of 4 and 9 degrees, from a table)."""
    found = roll_evidence(flips(vehicle, count=count), vehicle, np.random.default_rng(0))
    assert found is not None
    assert found.refuted_beyond == pytest.approx(beyond, abs=1e-3)
