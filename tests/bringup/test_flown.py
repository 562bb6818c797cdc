"""What a hover's record says, by records made of numbers: each limit on its own."""

from pathlib import Path

import numpy as np
import pytest

from onboard.arrays import FloatArray
from onboard.battery import thrust_from_voltage
from onboard.gravity import GRAVITY
from onboard.manoeuvres import manoeuvre
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from perchhw.bringup.flights import silent
from perchhw.bringup.flown import CourseWindow, hover_findings
from perchhw.record import RunRecord, Series

VEHICLE = load_vehicle("crazyflie21-upgraded")
COURSE = manoeuvre("long_discharge").course({"seconds": 20.0}, RoomGeometry())
VOLTS = 3.6


def pwm(share: float) -> float:
    """Command at which a motor gives `share` of a quarter of the weight, by the vehicle file."""
    wanted = 0.25 * share * VEHICLE.body.mass.value * GRAVITY
    low, high = 0.0, VOLTS
    for _ in range(60):
        middle = 0.5 * (low + high)
        enough = thrust_from_voltage(VEHICLE.motors.thrust_map_compiled(), middle) > wanted
        low, high = (low, middle) if enough else (middle, high)
    return 65535.0 * low / VOLTS


def missing(
    shares: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0), shake: float = 0.0, aside: float = 0.0
) -> list[str]:
    t = np.arange(0.0, 20.0, 0.01)
    ones = np.ones_like(t)
    x, y, z = COURSE.position[0]
    wave = shake * np.sqrt(2.0) * np.sin(2.0 * np.pi * 11.0 * t)

    def topic(name: str, **columns: FloatArray | float) -> Series:
        rows = np.column_stack([column * ones for column in columns.values()])
        return Series(name, t, tuple(dict(zip(columns, row.tolist(), strict=True)) for row in rows))

    run = RunRecord(
        folder=Path(),
        info={},
        series={
            "power": topic("power", vbat=VOLTS),
            "motors": topic("motors", **{f"m{i + 1}": pwm(share) for i, share in enumerate(shares)}),
            "acceleration": topic("acceleration", ax=wave, ay=0.0, az=GRAVITY),
            "pose": topic("pose", x=x + np.where(t > 10.0, aside, 0.0), y=y, z=z),
        },
        events=({"t": 0.0, "event": "phase", "phase": "test flight"},),
        torn=(),
    )
    return [one.what for one in hover_findings(CourseWindow.of(run, COURSE), COURSE, VEHICLE) if one.missing]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_hover_is_held_against_the_vehicle_file(sign: float) -> None:
    assert missing() == []
    assert missing((1.0 + 0.13 * sign,) * 4) == []
    assert missing((1.0 + 0.17 * sign,) * 4) == ["thrust"]
    assert missing((1.0 + 0.11 * sign, 1.0, 1.0, 1.0 - 0.11 * sign)) == []
    assert missing((1.0 + 0.14 * sign, 1.0, 1.0, 1.0 - 0.14 * sign)) == ["imbalance"]
    assert missing(shake=1.9) == []
    assert missing(shake=2.1) == ["vibration"]
    assert missing(aside=0.14 * sign) == []
    assert missing(aside=0.16 * sign) == ["hold"]


def test_a_silent_policy_cannot_fire_where_every_kernel_is_one() -> None:
    policy = load_policy(shipped_policy_path("default"))
    quiet = silent(policy)
    assert float(quiet.intercept) + float(policy.dual_coefficients.sum()) < -0.9
    assert (quiet.tau_min, quiet.tau_max) == (policy.tau_min, policy.tau_max)
