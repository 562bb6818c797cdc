"""Vehicle files (TOML, schema ``perchhw.vehicle/1``): reading with full checks, and writing.

The format is described in docs/vehicle_file.md.
"""

import dataclasses
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

from onboard.gravity import GRAVITY
from onboard.quantity import Quantity
from onboard.schema import schema_problem
from onboard.thrust_map import COEFFICIENT_UNITS, ThrustMapForm
from onboard.toml_file import quantity_line, read_toml, toml_key, toml_text
from onboard.vehicle.effect_tables import check_effects, parse_effects
from onboard.vehicle.model import (
    SCHEMA,
    Air,
    Battery,
    Body,
    Legs,
    Motors,
    Sensing,
    ThrustMapDescription,
    Vehicle,
)
from onboard.vehicle.schema import (
    Measured,
    Problems,
    Range,
    VehicleFileError,
    as_table,
    as_text,
    check_keys,
    parse_quantities,
    parse_section,
)
from onboard.vehicle.unnamed import check_unnamed, parse_unnamed, unnamed_to_toml

LIBRARY = Path(__file__).parent / "library"
LEGS_FILE = LIBRARY / "legs.toml"
THRUST_MAPS_FILE = LIBRARY / "thrust_maps.toml"
LEGS_SCHEMA = "perchhw.legs/1"
THRUST_MAPS_SCHEMA = "perchhw.thrust_maps/1"
_CELL_VOLTAGE = 5.0
"""V: up to it every map is asked to rise; packs of several cells ask it up to their own full voltage."""

_SECTIONS = (
    "schema",
    "name",
    "description",
    "body",
    "motors",
    "battery",
    "legs",
    "air",
    "sensing",
    "effects",
    "unnamed",
)


def _check_schema(content: Mapping[str, object], schema: str, problems: Problems) -> None:
    problem = schema_problem(content.get("schema"), schema)
    if problem is not None:
        problems.add("schema", problem)
        problems.raise_any()


@cache  # what ships with the code stays as it is while that runs, and every vehicle file asks for it
def _library(path: Path, schema: str) -> Mapping[str, object]:
    content = read_toml(path, VehicleFileError)
    _check_schema(content, schema, Problems(str(path)))
    return MappingProxyType({name: table for name, table in content.items() if name != "schema"})


def leg_design_names() -> tuple[str, ...]:
    """Names of the leg designs that ship with the code."""
    return tuple(_library(LEGS_FILE, LEGS_SCHEMA))


def thrust_map_names() -> tuple[str, ...]:
    """Names of the thrust maps that ship with the code."""
    return tuple(_library(THRUST_MAPS_FILE, THRUST_MAPS_SCHEMA))


def read_leg_design(name: str) -> Legs:
    """A leg design that ships with the code.

    Raises:
        VehicleFileError: no such design.
    """
    designs = _library(LEGS_FILE, LEGS_SCHEMA)
    if name not in designs:
        raise VehicleFileError(f"legs: there is no design {name!r}; choose one of {', '.join(designs)}")
    problems = Problems(str(LEGS_FILE))
    legs = parse_section(Legs, designs[name], name, problems, others={"design": name})
    problems.raise_any()
    if legs is None:
        raise VehicleFileError(f"{LEGS_FILE}: {name} cannot be read")
    return legs


def read_thrust_map(name: str) -> ThrustMapDescription:
    """A thrust map that ships with the code.

    Raises:
        VehicleFileError: no such map.
    """
    maps = _library(THRUST_MAPS_FILE, THRUST_MAPS_SCHEMA)
    if name not in maps:
        raise VehicleFileError(f"thrust_map: there is no map {name!r}; choose one of {', '.join(maps)}")
    problems = Problems(str(THRUST_MAPS_FILE))
    description = _parse_full_thrust_map(maps[name], name, problems)
    problems.raise_any()
    if description is None:
        raise VehicleFileError(f"{THRUST_MAPS_FILE}: {name} cannot be read")
    return dataclasses.replace(description, name=name)


def parse_vehicle(content: Mapping[str, object], file: str) -> Vehicle:
    """A vehicle from the content of its file; `file` is the name used in messages.

    Raises:
        VehicleFileError: with every problem found, one a line.
    """
    problems = Problems(file)
    _check_schema(content, SCHEMA, problems)
    check_keys(content, "", _SECTIONS, problems)
    name = as_text(content.get("name"), "name", problems)
    description = as_text(content.get("description"), "description", problems)
    body = parse_section(Body, content.get("body"), "body", problems)
    motors = _parse_motors(content.get("motors"), problems)
    battery = parse_section(Battery, content.get("battery"), "battery", problems)
    legs = _parse_legs(content["legs"], problems) if "legs" in content else None
    air = parse_section(Air, content.get("air"), "air", problems)
    sensing = parse_section(Sensing, content.get("sensing"), "sensing", problems)
    effects = parse_effects(content.get("effects", []), problems)
    unnamed = parse_unnamed(content.get("unnamed", []), problems)
    _check_consistency(body, motors, battery, problems)
    check_effects(effects, body, motors, battery, "legs" in content, air, problems)
    if body is not None and motors is not None:
        force = 4.0 * motors.thrust_max.value
        check_unnamed(unnamed, force, force * max(body.arm_x.value, body.arm_y.value), problems)
    problems.raise_any()
    if not (name and description and body and motors and battery and air and sensing):
        raise VehicleFileError(f"{file}: cannot be used; run perchhw vehicle check on it")
    return Vehicle(
        name=name,
        description=description,
        body=body,
        motors=motors,
        battery=battery,
        legs=legs,
        air=air,
        sensing=sensing,
        effects=effects,
        unnamed=unnamed,
    )


def _parse_motors(raw: object, problems: Problems) -> Motors | None:
    table = as_table(raw, "motors", problems)
    if table is None:
        return None
    thrust_map = None
    if "thrust_map" in table:
        thrust_map = _parse_thrust_map(table["thrust_map"], problems)
    else:
        problems.add("motors.thrust_map", "is missing; add [motors.thrust_map] with a name or a form")
    return parse_section(Motors, table, "motors", problems, others={"thrust_map": thrust_map})


def _parse_thrust_map(raw: object, problems: Problems) -> ThrustMapDescription | None:
    """A map given in full, or only by the name of one that ships with the code."""
    key = "motors.thrust_map"
    table = as_table(raw, key, problems)
    if table is None:
        return None
    if set(table) == {"name"}:
        try:
            return read_thrust_map(str(table["name"]))
        except VehicleFileError as error:
            problems.add(f"{key}.name", str(error))
            return None
    full = {name: value for name, value in table.items() if name != "name"}
    description = _parse_full_thrust_map(full, key, problems)
    if description is None or "name" not in table:
        return description
    name = as_text(table["name"], f"{key}.name", problems)
    return dataclasses.replace(description, name=name)


def _parse_full_thrust_map(raw: object, key: str, problems: Problems) -> ThrustMapDescription | None:
    table = as_table(raw, key, problems)
    if table is None:
        return None
    forms = {form.name.lower(): form for form in ThrustMapForm}
    form = forms.get(str(table.get("form")))
    if form is None:
        problems.add(f"{key}.form", f"must be one of {', '.join(forms)}, not {table.get('form')!r}")
        return None
    rules = {name: Measured(unit, Range.ANY) for name, unit in COEFFICIENT_UNITS[form].items()}
    before = len(problems.messages)
    check_keys(table, key, ["form", *rules], problems)
    coefficients = parse_quantities(table, key, rules, (), problems)
    if len(problems.messages) > before:
        return None
    description = ThrustMapDescription(form=form, coefficients=coefficients)
    _check_increasing(description, _CELL_VOLTAGE, key, problems)
    return description


def _check_increasing(
    description: ThrustMapDescription, highest: float, key: str, problems: Problems
) -> None:
    """Note a map whose thrust does not rise with the voltage up to `highest` (V)."""
    c = {name: quantity.value for name, quantity in description.coefficients.items()}
    match description.form:
        case ThrustMapForm.QUADRATIC_INVERSE:
            fine = (
                c["low_a"] > 0.0
                and c["low_b"] >= 0.0
                and c["low_c"] <= c["break_thrust"]
                and c["high_a"] > 0.0
                and c["high_c"] - c["high_b"] * c["high_b"] / (4.0 * c["high_a"]) <= c["break_thrust"]
            )
            rule = "low_a, high_a > 0, low_b >= 0, and both rows must reach break_thrust"
        case ThrustMapForm.FIRMWARE_CUBIC:
            # The slope is a parabola, so ends and vertex decide; at 0 V itself it may vanish (f = c2 V2).
            vertex = -c["c2"] / (3.0 * c["c3"]) if c["c3"] != 0.0 else highest
            places = [highest, min(vertex, highest)] if vertex > 0.0 else [highest]
            fine = c["c1"] >= 0.0 and all(
                c["c1"] + v * (2.0 * c["c2"] + v * 3.0 * c["c3"]) > 0.0 for v in places
            )
            rule = f"thrust must rise with voltage from 0 to {highest:g} V"
        case ThrustMapForm.TWO_REGION_LOG:
            fine = all(c[name] > 0.0 for name in ("a1", "b1", "a2", "break_thrust"))
            fine = fine and c["break_thrust"] + c["b2"] > 0.0
            rule = "a1, b1, a2 and break_thrust must be > 0, and break_thrust + b2 too"
    if not fine:
        problems.add(key, f"the coefficients give a thrust that does not rise with the voltage: {rule}")


def _parse_legs(raw: object, problems: Problems) -> Legs | None:
    """Legs given in full, or only by the name of a design that ships with the code."""
    table = as_table(raw, "legs", problems)
    if table is None:
        return None
    design = as_text(table.get("design"), "legs.design", problems)
    if set(table) == {"design"} and design is not None:
        try:
            return read_leg_design(design)
        except VehicleFileError as error:
            problems.add("legs.design", str(error))
            return None
    return parse_section(Legs, table, "legs", problems, others={"design": design})


def _check_consistency(
    body: Body | None, motors: Motors | None, battery: Battery | None, problems: Problems
) -> None:
    """Note numbers that contradict each other."""
    if motors is not None and battery is not None and battery.open_circuit_full.value > _CELL_VOLTAGE:
        full = battery.open_circuit_full.value
        _check_increasing(motors.thrust_map, full, "motors.thrust_map", problems)
    if body is not None:
        inertia = sorted((body.inertia_xx.value, body.inertia_yy.value, body.inertia_zz.value))
        if inertia[0] + inertia[1] <= inertia[2]:
            problems.add("body", "no rigid body has these inertias: two must add up to more than the third")
        if body.body_top_z.value <= body.body_bottom_z.value:
            problems.add("body.body_top_z", "must lie above body_bottom_z")
    if motors is not None and motors.thrust_max.value <= motors.thrust_min.value:
        problems.add("motors.thrust_max", "must be more than thrust_min")
    if body is not None and motors is not None and 4.0 * motors.thrust_max.value <= GRAVITY * body.mass.value:
        problems.add("motors.thrust_max", "four motors cannot lift the mass; check thrust_max and body.mass")
    if battery is not None and battery.cutoff.value >= battery.open_circuit_full.value:
        problems.add("battery.cutoff", "must be less than open_circuit_full")


def vehicle_to_toml(vehicle: Vehicle) -> str:
    """The text of a vehicle file that reads back as the same vehicle, with every table in full."""
    lines = [
        f"schema = {json.dumps(SCHEMA)}",
        f"name = {toml_text(vehicle.name)}",
        f"description = {toml_text(vehicle.description)}",
        "",
        "[body]",
        *_quantity_lines(vehicle.body),
        "",
        "[motors]",
        *_quantity_lines(vehicle.motors),
        "",
        "[motors.thrust_map]",
    ]
    thrust_map = vehicle.motors.thrust_map
    if thrust_map.name is not None:
        lines.append(f"name = {toml_text(thrust_map.name)}")
    lines.append(f"form = {json.dumps(thrust_map.form.name.lower())}")
    lines += [quantity_line(key, quantity) for key, quantity in thrust_map.coefficients.items()]
    lines += ["", "[battery]", *_quantity_lines(vehicle.battery)]
    if vehicle.legs is not None:
        lines += ["", "[legs]", f"design = {toml_text(vehicle.legs.design)}", *_quantity_lines(vehicle.legs)]
    lines += ["", "[air]", *_quantity_lines(vehicle.air), "", "[sensing]", *_quantity_lines(vehicle.sensing)]
    for effect in vehicle.effects:
        lines += ["", "[[effects]]", f"name = {toml_text(effect.name)}"]
        lines += [quantity_line(toml_key(key), quantity) for key, quantity in effect.parameters.items()]
    lines += unnamed_to_toml(vehicle.unnamed)
    return "\n".join(lines) + "\n"


def _quantity_lines(section: Body | Motors | Battery | Legs | Air | Sensing) -> list[str]:
    values = {item.name: getattr(section, item.name) for item in dataclasses.fields(section)}
    return [quantity_line(key, value) for key, value in values.items() if isinstance(value, Quantity)]
