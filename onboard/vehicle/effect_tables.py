"""The ``[[effects]]`` tables of a vehicle file: reading them, and whether the rest of the file suits them."""

from collections.abc import Sequence

from onboard.gravity import GRAVITY
from onboard.vehicle.effects import AIR_FORCES, EFFECTS, Needs, Size
from onboard.vehicle.model import Air, Battery, Body, Effect, Motors, size_of
from onboard.vehicle.schema import Measured, Problems, Range, as_table, check_keys, parse_quantities


def parse_effects(raw: object, problems: Problems) -> tuple[Effect, ...]:
    """The effects of a file, each with quantities in SI units; problems are noted by ``effects[i].key``."""
    if not isinstance(raw, list):
        problems.add("effects", "must be an array of tables; write each effect under [[effects]]")
        return ()
    effects: list[Effect] = []
    for index, item in enumerate(raw):
        key = f"effects[{index}]"
        table = as_table(item, key, problems)
        if table is None:
            continue
        name = table.get("name")
        if not isinstance(name, str) or name not in EFFECTS:
            problems.add(f"{key}.name", f"{name!r} is not an effect; known: {', '.join(EFFECTS)}")
            continue
        if any(effect.name == name for effect in effects):
            problems.add(f"{key}.name", f"effect {name!r} is given twice; keep one")
            continue
        before = len(problems.messages)
        check_keys(table, key, ["name", *EFFECTS[name].parameters], problems)
        rules = {
            parameter: Measured(rule.unit, Range.ANY) for parameter, rule in EFFECTS[name].parameters.items()
        }
        optional = [
            parameter for parameter, rule in EFFECTS[name].parameters.items() if rule.neutral is not None
        ]
        parameters = parse_quantities(table, key, rules, optional, problems)
        if len(problems.messages) == before:
            if not parameters:
                names = ", ".join(EFFECTS[name].parameters)
                problems.add(key, f"effect {name!r} needs at least one of its parameters: {names}")
            effects.append(Effect(name=name, parameters=parameters))
    return tuple(effects)


def _check_bounds(effect: Effect, size: Size, key: str, problems: Problems) -> None:
    """Note values that no vehicle of this size has."""
    for name, quantity in effect.parameters.items():
        rule = EFFECTS[effect.name].parameters[name].for_size(size)
        if not rule.low <= quantity.value <= rule.high:
            problems.add(
                f"{key}.{name}.value",
                f"is {quantity.value:g} {rule.unit}; {rule.meaning}: it must be between {rule.low:g} and "
                f"{rule.high:g} {rule.unit}",
            )


def check_effects(
    effects: Sequence[Effect],
    body: Body | None,
    motors: Motors | None,
    battery: Battery | None,
    has_legs: bool,
    air: Air | None,
    problems: Problems,
) -> None:
    """Note effects that exclude each other, that have nothing to act on, or that make no body."""
    names = [effect.name for effect in effects]
    for index, effect in enumerate(effects):
        key = f"effects[{index}]"
        for other in EFFECTS[effect.name].excludes:
            if other in names[:index]:
                problems.add(
                    f"{key}.name", f"{effect.name!r} and {other!r} describe the same thing; keep one"
                )
        for need in EFFECTS[effect.name].needs:
            missing = _missing(need, names, motors, has_legs, air)
            if missing:
                problems.add(f"{key}.name", f"{effect.name!r} has nothing to act on: {missing}")
    if body is not None and motors is not None and battery is not None:
        for index, effect in enumerate(effects):
            _check_bounds(effect, size_of(body, motors, battery), f"effects[{index}]", problems)
    if body is not None and motors is not None:
        _check_body(effects, body, motors, problems)


def _missing(
    need: Needs, names: Sequence[str], motors: Motors | None, has_legs: bool, air: Air | None
) -> str | None:
    """What to add to the file for a need that is not met; None when it is (or its section is broken)."""
    match need:
        case Needs.LEGS:
            return None if has_legs else "add [legs]"
        case Needs.ROTOR_SPEED:
            if motors is None or motors.thrust_coefficient is not None:
                return None
            return 'add motors.thrust_coefficient = { value, unit = "N s2/rad2", sigma, source }'
        case Needs.AIR_FORCE:
            drags = (0.0,) if air is None else (air.drag_x.value, air.drag_y.value, air.drag_z.value)
            if air is None or any(drags) or any(name in AIR_FORCES for name in names):
                return None
            return f"give [air] a drag, or add one of the effects {', '.join(AIR_FORCES)}"


def _check_body(effects: Sequence[Effect], body: Body, motors: Motors, problems: Problems) -> None:
    """Note errors of mass and inertia that leave no rigid body, or one that does not fly."""
    inertia = {axis: getattr(body, f"inertia_{axis}").value for axis in ("xx", "yy", "zz")}
    for index, effect in enumerate(effects):
        values = effect.values()
        if effect.name == "inertia_error":
            true = sorted(inertia[axis] * (1.0 + values[axis]) for axis in inertia)
            if true[0] + true[1] <= true[2]:
                problems.add(
                    f"effects[{index}]",
                    "no rigid body has these inertias: with the error two must add up to more than the third",
                )
        if effect.name == "mass_error":
            mass = body.mass.value * (1.0 + values["relative"])
            if 4.0 * motors.thrust_max.value <= GRAVITY * mass:
                problems.add(f"effects[{index}]", f"four motors cannot lift the true mass of {mass:g} kg")
