"""The improved vehicle: the file that was given, with the effects that were found, each with its source."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from calibration.gap.data.found_effect import FoundEffect
from calibration.gap.estimate.acceptance import NINETY_FIVE
from calibration.gap.replay.hover import HoverCommand, hover_command, up_to_full_duty
from calibration.gap.search.naming import Named
from onboard.attitude_margins import DELAY_LIMIT, PHASE_LIMIT_DEG, vehicle_margins
from onboard.battery import thrust_from_voltage
from onboard.controller import ControllerGains, controller_gains
from onboard.gravity import GRAVITY
from onboard.mixer import mix
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import Effect, Vehicle, vehicle_to_toml
from sim_backend.physics.parameters import physics_parameters

VEHICLE_FILE = "vehicle.toml"

_ASIDE = 0.03
"""m, in hover, from which on it is worth a sentence."""

_HEIGHT = 1.0
"""m, of that hover."""

_MOST_OF_A_MOTOR = 0.9
"""Share of a motor's largest thrust up to which the law commands (:mod:`onboard.controller`)."""


def improved_vehicle(vehicle: Vehicle, effects: Sequence[FoundEffect], names: Named, source: str) -> Vehicle:
    """A vehicle with effects added, or put in the place of those that it had under the same names.

    Parameters that were not found stay neutral. `names` has the effects that are real and too small for a
    name, and the curves that have none; `source` is the provenance of the numbers.
    """
    found = {
        effect.name: {
            key: Quantity(one.value, one.unit, (one.ci95[1] - one.ci95[0]) / (2.0 * NINETY_FIVE), source)
            for key, one in effect.parameters.items()
        }
        for effect in effects
    }
    small: dict[str, dict[str, Quantity]] = {name: {} for name in names.minor}
    for v, x in names.improved.values.items():
        if v.effect in small:
            unit, error = names.improved.rule(v).unit, names.errors.get(v, 0.0)
            small[v.effect][v.parameter] = Quantity(x, unit, error, f"{source}; too small for a name")
    named = (*found.items(), *small.items())
    added = [Effect(name=name, parameters=parameters) for name, parameters in named]
    return vehicle.with_effects(added).with_unnamed(names.curves)


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
    """Where it hovers, if it does, with the law that integrates no error of the attitude and stops at the
    thrust that a vehicle file gives a motor."""
    thrust_map = improved.motors.thrust_map_compiled()
    p = physics_parameters(improved, RoomGeometry(ceiling_z=math.inf))
    voltage = float(p["open_circuit_full"])
    most = thrust_from_voltage(thrust_map, voltage)
    gains = up_to_full_duty(controller_gains(improved), most)
    held = hover_command(p, thrust_map, voltage, np.array([0.0, 0.0, _HEIGHT]))
    if held is None:
        yield "the vehicle that was found does not hover at full duty of a full battery"
        return
    aside = aside_in_hover(held, gains)
    if aside > _ASIDE:
        there = f"hover {aside:.2f} m beside its place" if math.isfinite(aside) else "tip over"
        yield (
            "our attitude law integrates no error of the attitude: with it the vehicle that was found would "
            f"{there}; balance it, or leave hover to the firmware's PID"
        )
    x, y, z = held.moments
    thrusts = mix(held.collective, x, y, z, p["arm_x"], p["arm_y"], p["thrust_to_torque"], most)
    share = max(thrusts) / improved.motors.thrust_max.value
    if share > _MOST_OF_A_MOTOR:
        yield (
            f"to hover, the vehicle that was found needs {share:.0%} of the largest thrust that its file "
            "gives a motor, by which our law is limited: measure thrust_max (`perchhw calibrate thrust`)"
        )


def aside_in_hover(held: HoverCommand, gains: ControllerGains) -> float:
    """How far (m) from its place a controller without an integral of the attitude error hovers; inf where it
    tips over.

    The vehicle hovers level, so its law must want it to lean: by the angle e whose moment kr sin(e) is the
    one that holds it. That takes m g tan(e) from an error of the position and its integral (the equations of
    :mod:`onboard.controller`).
    """
    sine = math.hypot(held.moments[0], held.moments[1]) / gains.kr_xy
    if sine >= 1.0:
        return math.inf
    push = gains.mass * GRAVITY * sine / math.sqrt(1.0 - sine * sine)
    return max(push - gains.ki_xy * gains.integral_limit, 0.0) / gains.kp_xy


def provenance(flights: int, held_out: int, seed: int) -> str:
    """Where a number of the gap finder comes from, for the file."""
    return f"gap finder: fitted to {flights} flights, checked on {held_out} others, seed {seed}"


def write_vehicle(vehicle: Vehicle, folder: Path) -> Path:
    """Write ``vehicle.toml`` into the report's folder; returns the file."""
    file = folder / VEHICLE_FILE
    file.write_text(vehicle_to_toml(vehicle), encoding="utf-8")
    return file
