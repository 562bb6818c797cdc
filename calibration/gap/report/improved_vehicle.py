"""The improved vehicle: the file that was given, with the effects that were found, each with its source."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from calibration.gap.data.found import FoundEffect
from calibration.gap.estimate.acceptance import NINETY_FIVE
from calibration.gap.replay.hover import hover_command
from calibration.gap.search.naming import Named
from onboard.attitude_margins import DELAY_LIMIT, PHASE_LIMIT_DEG, vehicle_margins
from onboard.battery import thrust_from_voltage
from onboard.controller import controller_gains
from onboard.mixer import mix
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import Effect, Vehicle, vehicle_to_toml
from sim_backend.physics.parameters import physics_parameters

VEHICLE_FILE = "vehicle.toml"

_LEAN = 5.0
"""deg: a hover that leans more drifts off before the position's integral holds it."""

_MOST_OF_A_MOTOR = 0.9
"""Share of a motor's largest thrust up to which the law commands (:mod:`onboard.controller`)."""


def improved_vehicle(vehicle: Vehicle, effects: Sequence[FoundEffect], names: Named, source: str) -> Vehicle:
    """A vehicle with effects added, or put in the place of those that it had under the same names.

    Args:
        vehicle: as given.
        effects: found; parameters that were not found stay neutral.
        names: of the search, with the effects that are real and too small for a name, and with curves that
            have none.
        source: provenance of the numbers, for the file.
    """
    added = tuple(
        Effect(
            name=effect.name,
            parameters={
                key: Quantity(one.value, one.unit, (one.ci95[1] - one.ci95[0]) / (2.0 * NINETY_FIVE), source)
                for key, one in effect.parameters.items()
            },
        )
        for effect in effects
    )
    small = tuple(
        Effect(
            name=name,
            parameters={
                v.parameter: Quantity(
                    x,
                    names.improved.rule(v).unit,
                    names.errors.get(v, 0.0),
                    f"{source}; too small for a name",
                )
                for v, x in names.improved.values.items()
                if v.effect == name
            },
        )
        for name in names.minor
    )
    return vehicle.with_effects((*added, *small)).with_unnamed(names.curves)


def hard_to_fly(improved: Vehicle) -> Iterator[str]:
    """Sentences where the law that flies this project's vehicles may lose the one that was found."""
    yield from _hard_to_hold(improved)
    margins = vehicle_margins(improved)
    if not margins.suffice:
        wanted = f"{PHASE_LIMIT_DEG:.0f} deg and {1e3 * DELAY_LIMIT:.0f} ms are wanted"
        yield (
            f"our attitude law has margins of {margins.phase_deg:.0f} deg and {1e3 * margins.delay:.0f} ms "
            f"with the vehicle that was found ({wanted}) and may lose it in closed loop: was another law "
            "flown, or is the delay elsewhere?"
        )


def _hard_to_hold(improved: Vehicle) -> Iterator[str]:
    gains, thrust_map = controller_gains(improved), improved.motors.thrust_map_compiled()
    p = physics_parameters(improved, RoomGeometry(ceiling_z=math.inf))
    full = float(p["open_circuit_full"])
    collective, x, y, z = hover_command(p, gains, thrust_map, full)
    lean = math.degrees(math.hypot(x, y) / gains.kr_xy)
    if lean > _LEAN:
        yield (
            "our attitude law integrates no error of the attitude: with the vehicle that was found it would "
            f"lean by {lean:.0f} deg in hover; balance the vehicle, or leave hover to the firmware's PID"
        )
    most = thrust_from_voltage(thrust_map, full)
    needed = max(mix(collective, x, y, z, p["arm_x"], p["arm_y"], p["thrust_to_torque"], most))
    share = needed / improved.motors.thrust_max.value
    if share > _MOST_OF_A_MOTOR:
        yield (
            f"to hover, the vehicle that was found needs {share:.0%} of the largest thrust that its file "
            "gives a motor, by which our law is limited: measure thrust_max (`perchhw calibrate thrust`)"
        )


def provenance(flights: int, held_out: int, seed: int) -> str:
    """Where a number of the gap finder comes from, for the file."""
    return f"gap finder: fitted to {flights} flights, checked on {held_out} others, seed {seed}"


def write_vehicle(vehicle: Vehicle, folder: Path) -> Path:
    """Write ``vehicle.toml`` into the report's folder; returns the file."""
    file = folder / VEHICLE_FILE
    file.write_text(vehicle_to_toml(vehicle), encoding="utf-8")
    return file
