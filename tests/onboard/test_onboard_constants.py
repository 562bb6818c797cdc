"""The checksum of the onboard constants: every one of them counts, in the documented order."""

import dataclasses
import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from onboard.firmware.constants import constants_crc32, onboard_constants, vehicle_crc32
from onboard.quantity import Quantity
from onboard.thrust_map import COEFFICIENT_UNITS, ThrustMapForm
from onboard.vehicle import Vehicle, known_vehicles, load_vehicle

VEHICLE = load_vehicle("crazyflie21-upgraded")
DOCUMENT = Path(__file__).parents[2] / "docs" / "landing_app.md"
ONBOARD_BODY = (
    "mass", "inertia_xx", "inertia_yy", "inertia_zz", "arm_x", "arm_y", "body_top_z", "propeller_height_z",
)  # fmt: skip
ONBOARD_MOTORS = ("thrust_max", "thrust_min", "time_constant_up", "time_constant_down", "thrust_to_torque")


def changed(quantity: Quantity) -> Quantity:
    """A little more: one part in a thousand, far above the rounding of float32."""
    return dataclasses.replace(quantity, value=quantity.value * 1.001 + 1e-9)


def vehicles_with_one_change() -> Iterator[tuple[str, Vehicle]]:
    """Every number that the drone takes from the file, changed alone."""
    body, motors = VEHICLE.body, VEHICLE.motors
    for name in ONBOARD_BODY:
        quantity = dataclasses.replace(getattr(body, name), value=getattr(body, name).value + 0.02)
        yield name, dataclasses.replace(VEHICLE, body=dataclasses.replace(body, **{name: quantity}))
    for name in ONBOARD_MOTORS:
        change: dict[str, Any] = {name: changed(getattr(motors, name))}
        part = dataclasses.replace(motors, **change)
        yield name, dataclasses.replace(VEHICLE, motors=part)
    for name, quantity in motors.thrust_map.coefficients.items():
        table = {**motors.thrust_map.coefficients, name: changed(quantity)}
        thrust_map = dataclasses.replace(motors.thrust_map, coefficients=table)
        yield name, dataclasses.replace(VEHICLE, motors=dataclasses.replace(motors, thrust_map=thrust_map))


def test_the_checksum_is_that_of_the_values_as_float32() -> None:
    constants = onboard_constants(VEHICLE)
    packed = struct.pack(f"<{len(constants)}f", *(constant.value for constant in constants))
    assert vehicle_crc32(VEHICLE) == constants_crc32(constants) == zlib.crc32(packed)


@pytest.mark.parametrize(
    ("name", "vehicle"), [pytest.param(*case, id=case[0]) for case in vehicles_with_one_change()]
)
def test_every_number_of_the_file_that_the_drone_uses_counts(name: str, vehicle: Vehicle) -> None:
    assert vehicle_crc32(vehicle) != vehicle_crc32(VEHICLE)


@pytest.mark.parametrize("index", range(len(onboard_constants(VEHICLE))))
def test_every_constant_counts_at_its_place(index: int) -> None:
    constants = list(onboard_constants(VEHICLE))
    constants[index] = constants[index]._replace(value=constants[index].value + 1.0)
    assert constants_crc32(tuple(constants)) != vehicle_crc32(VEHICLE)


def test_another_form_of_the_thrust_map_counts() -> None:
    motors = VEHICLE.motors
    names = COEFFICIENT_UNITS[ThrustMapForm.TWO_REGION_LOG]
    values = list(motors.thrust_map.coefficients.values())
    other = dataclasses.replace(
        motors.thrust_map,
        form=ThrustMapForm.TWO_REGION_LOG,
        coefficients=dict(zip(names, values, strict=False)),
    )
    assert vehicle_crc32(
        dataclasses.replace(VEHICLE, motors=dataclasses.replace(motors, thrust_map=other))
    ) != vehicle_crc32(VEHICLE)


def test_what_the_drone_does_not_know_does_not_count() -> None:
    same = dataclasses.replace(
        VEHICLE,
        name="other",
        legs=None,
        effects=(),
        air=dataclasses.replace(VEHICLE.air, drag_x=changed(VEHICLE.air.drag_x)),
    )
    assert vehicle_crc32(same) == vehicle_crc32(VEHICLE)


def test_known_vehicles_differ() -> None:
    assert len({vehicle_crc32(load_vehicle(name)) for name in known_vehicles()}) == len(known_vehicles())


def test_the_document_lists_the_constants_in_their_order() -> None:
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \|", DOCUMENT.read_text(encoding="utf-8"), re.MULTILINE)
    assert rows == [(str(i), constant.name) for i, constant in enumerate(onboard_constants(VEHICLE))]
