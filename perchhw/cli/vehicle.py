"""``perchhw vehicle``: list, show, check and compare vehicle files."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.cli.attitude_loop import attitude_loop
from perchhw.cli.options import Legs
from perchhw.cli.output import emit
from perchhw.consoles import console

if TYPE_CHECKING:
    from rich.console import Console

    from onboard.vehicle import Vehicle

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Vehicle files: what the drone is.")

VehicleArgument = Annotated[str, typer.Argument(help="A known vehicle or the path of a vehicle file.")]


@app.command("list")
def list_() -> None:
    """Name the vehicles, leg designs and thrust maps that ship with the code, and the known effects."""
    from onboard.vehicle import (
        EFFECT_NAMES,
        known_leg_designs,
        known_thrust_maps,
        known_vehicles,
        load_vehicle,
    )

    vehicles = [{"name": name, "description": load_vehicle(name).description} for name in known_vehicles()]
    legs, thrust_maps = list(known_leg_designs()), list(known_thrust_maps())
    lines = [f"{vehicle['name']}: {vehicle['description']}" for vehicle in vehicles]
    lines.append("legs: " + ", ".join(legs))
    lines.append("thrust maps: " + ", ".join(thrust_maps))
    lines.append("effects: " + ", ".join(EFFECT_NAMES))
    result = {"vehicles": vehicles, "legs": legs, "thrust_maps": thrust_maps, "effects": list(EFFECT_NAMES)}
    emit(result, "\n".join(lines))


@app.command()
def show(
    vehicle: VehicleArgument,
    legs: Legs = None,
    toml: Annotated[bool, typer.Option("--toml", help="Print a complete vehicle file.")] = False,
) -> None:
    """Show every number of a vehicle with its uncertainty (k = 1) and source, in SI units."""
    from onboard.vehicle import load_vehicle, vehicle_to_toml

    loaded = load_vehicle(vehicle, legs=legs)
    human = _table(loaded)
    if toml:
        # Not through the console, which would break long lines.
        human = partial(typer.echo, vehicle_to_toml(loaded), nl=False)
    emit(_as_json(loaded), human)


@app.command()
def check(file: VehicleArgument) -> None:
    """Check a vehicle file; exit 2 with every problem, by file and key, when it cannot be used.

    Says the margins of the attitude loop that the drone's law closes with it, and warns below their limits.
    """
    from onboard.vehicle import check_vehicle, load_vehicle

    problems = check_vehicle(file)
    if problems:
        document = {"vehicle": file, "usable": False, "quantities": 0, "problems": problems}
        emit({**document, "attitude_margins": None, "warnings": []}, "\n".join(problems))
        raise typer.Exit(2)
    loaded = load_vehicle(file)
    loop = attitude_loop(loaded)
    document = {
        "vehicle": loaded.name,
        "usable": True,
        "quantities": len(_quantities(loaded)),
        "problems": [],
        **loop.json_shape(),
    }
    fine = f"{file}: fine, {len(_quantities(loaded))} quantities, {len(loaded.effects)} effects"
    if loaded.unnamed:
        fine += f", {len(loaded.unnamed)} curves without a name"
    emit(document, "\n".join([fine, *loop.lines()]))


@app.command()
def header(vehicle: VehicleArgument, legs: Legs = None) -> None:
    """Print the C header that a vehicle's firmware is built with; with the CRC of perch.vehCrc."""
    from onboard.firmware.constants import vehicle_crc32
    from onboard.firmware.header import vehicle_header
    from onboard.vehicle import load_vehicle

    loaded = load_vehicle(vehicle, legs=legs)
    text, crc = vehicle_header(loaded), vehicle_crc32(loaded)
    emit({"vehicle": loaded.name, "crc32": crc, "header": text}, partial(typer.echo, text, nl=False))


@app.command()
def diff(first: VehicleArgument, second: VehicleArgument) -> None:
    """Say what differs between two vehicles: values, uncertainties, and keys that only one has."""
    from onboard.vehicle import load_vehicle

    rows = differences(load_vehicle(first), load_vehicle(second))
    document = {"first": first, "second": second, "differences": rows}
    emit(document, lambda: draw_differences(console(), first, second, rows))


def differences(first: "Vehicle", second: "Vehicle") -> list[dict[str, Any]]:
    """What differs between two vehicles: ``{key, first, second}`` a quantity, None where one has it not."""
    a, b = _quantities(first), _quantities(second)
    keys = [*a, *(key for key in b if key not in a)]
    return [
        {"key": key, "first": a.get(key), "second": b.get(key)} for key in keys if a.get(key) != b.get(key)
    ]


def _quantities(vehicle: "Vehicle") -> dict[str, dict[str, Any]]:
    """Every quantity of a vehicle by its dotted key, as ``{value, unit, sigma, source}``."""
    from dataclasses import asdict, fields

    from onboard.quantity import Quantity

    found: dict[str, Quantity] = {}
    for name in ("body", "motors", "battery", "legs", "air", "sensing"):
        section = getattr(vehicle, name)
        if section is None:
            continue
        for item in fields(section):
            value = getattr(section, item.name)
            if isinstance(value, Quantity):
                found[f"{name}.{item.name}"] = value
        if name == "motors":
            coefficients = section.thrust_map.coefficients
            found.update({f"motors.thrust_map.{key}": value for key, value in coefficients.items()})
    for effect in vehicle.effects:
        found.update({f"effects.{effect.name}.{key}": value for key, value in effect.parameters.items()})
    for index, curve in enumerate(vehicle.unnamed):
        found.update({f"unnamed[{index}]: {where}": value for where, value in curve.at_knots().items()})
    return {key: asdict(value) for key, value in found.items()}


def _as_json(vehicle: "Vehicle") -> dict[str, Any]:
    return {
        "schema": "perchhw.vehicle/1",
        "name": vehicle.name,
        "description": vehicle.description,
        "legs": None if vehicle.legs is None else vehicle.legs.design,
        "thrust_map": {
            "form": vehicle.motors.thrust_map.form.name.lower(),
            "name": vehicle.motors.thrust_map.name,
        },
        "effects": [effect.name for effect in vehicle.effects],
        "quantities": _quantities(vehicle),
    }


def _text(quantity: dict[str, Any] | None) -> str:
    if quantity is None:
        return "-"
    return f"{quantity['value']:.6g} ± {quantity['sigma']:.2g} {quantity['unit']}"


def _table(vehicle: "Vehicle") -> Callable[[], None]:
    def draw() -> None:
        from rich.table import Table

        table = Table(title=f"{vehicle.name}: {vehicle.description}", title_justify="left")
        for column in ("quantity", "value", "source"):
            table.add_column(column)
        for key, quantity in _quantities(vehicle).items():
            table.add_row(key, _text(quantity), quantity["source"])
        console().print(table, markup=False)

    return draw


def draw_differences(screen: "Console", first: str, second: str, rows: list[dict[str, Any]]) -> None:
    """A table of :func:`differences`."""
    from rich.table import Table

    if not rows:
        screen.print("no difference", markup=False)
        return
    table = Table()
    for column in ("quantity", Path(first).name, Path(second).name):
        table.add_column(column)
    for row in rows:
        same_value = _text(row["first"]) == _text(row["second"])
        note = " (source differs)" if same_value else ""
        table.add_row(row["key"], _text(row["first"]), _text(row["second"]) + note)
    screen.print(table, markup=False)
