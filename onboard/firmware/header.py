"""The C header with a vehicle's constants, which a firmware is built with."""

import numpy as np

from onboard.firmware.constants import constants_crc32, onboard_constants
from onboard.vehicle import Vehicle

_MAP = "thrust_map_"


def vehicle_header(vehicle: Vehicle) -> str:
    """``perch_vehicle_constants.h``: one ``perch_vehicle`` (``core/vehicle.h``), and its CRC-32.

    The numbers are the float32 of :func:`onboard.firmware.constants.onboard_constants`, in their
    order, in hexadecimal, so that no compiler rounds them, with name and decimal number beside it.
    """
    constants = onboard_constants(vehicle)
    lines = [f"    {_hexadecimal(c.value)}, /* {c.name}: {c.value:.9g} */" for c in constants]
    name = "".join(letter if letter.isalnum() or letter in "-_. " else "?" for letter in vehicle.name)
    return "\n".join(
        [
            f"/* Constants of {name}: made by `perchhw vehicle header`, do not change by hand. */",
            "#ifndef PERCH_VEHICLE_CONSTANTS_H",
            "#define PERCH_VEHICLE_CONSTANTS_H",
            "",
            '#include "vehicle.h"',
            "",
            "/* What perch.vehCrc of this firmware reads. */",
            f"#define PERCH_VEHICLE_CRC 0x{constants_crc32(constants):08x}u",
            "",
            "static const perch_vehicle PERCH_VEHICLE = {",
            *_with_braces_around_the_map(lines),
            "};",
            "",
            "#endif",
            "",
        ]
    )


def _hexadecimal(value: float) -> str:
    """A float32 as a C literal, exactly."""
    return f"{float(np.float32(value)).hex()}f"


def _with_braces_around_the_map(lines: list[str]) -> list[str]:
    """The coefficients of the thrust map are an array within the structure."""
    places = [i for i, line in enumerate(lines) if f"/* {_MAP}" in line and f"{_MAP}form" not in line]
    first, end = places[0], places[-1] + 1
    return [*lines[:first], "    {", *(f"  {line}" for line in lines[first:end]), "    },", *lines[end:]]
