"""The campaign file that flies what was suggested (docs/campaigns.md)."""

from collections.abc import Sequence

from calibration.gap.suggest.landing_separation import ANGLES_DEG, LANDINGS, SPEEDS
from calibration.gap.suggest.suggestions import Suggestion
from onboard.manoeuvres import MANOEUVRES
from onboard.room import RoomGeometry
from onboard.toml_file import toml_text


def flights_file(
    suggestions: Sequence[Suggestion], name: str, drone: str, mocap: str, vehicle: str, room: RoomGeometry
) -> str | None:
    """A campaign of test flights (TOML), or None when no pair needs one."""
    times: dict[str, int] = {}
    pairs: dict[str, list[str]] = {}
    for suggestion in suggestions:
        kind = suggestion.flight
        if kind is not None and kind != LANDINGS:
            times[kind] = max(times.get(kind, 0), suggestion.times)
            pairs.setdefault(kind, []).append(" and ".join(suggestion.pair))
    if not times:
        return None
    lines = _head(name, drone, mocap, vehicle, room)
    for kind, count in times.items():
        lines += [
            "",
            *(f"# tells {pair} apart" for pair in pairs[kind]),
            "[[flight]]",
            f'kind = "{kind}"',
            f"times = {count}",
            *(f"# {key} = {rule.usual:g}  # {rule.meaning}" for key, rule in MANOEUVRES[kind].rules.items()),
        ]
    return "\n".join(lines) + "\n"


def landings_file(
    suggestions: Sequence[Suggestion], name: str, drone: str, mocap: str, vehicle: str, room: RoomGeometry
) -> str | None:
    """A campaign of landings (TOML), or None when no pair needs one."""
    wanted = [suggestion for suggestion in suggestions if suggestion.flight == LANDINGS]
    if not wanted:
        return None
    lines = _head(name, drone, mocap, vehicle, room)
    lines += [
        "",
        *(f"# tells {' and '.join(suggestion.pair)} apart" for suggestion in wanted),
        "[grid]",
        f"speeds = {list(SPEEDS)}",
        f"angles_deg = {list(ANGLES_DEG)}",
    ]
    return "\n".join(lines) + "\n"


def _head(name: str, drone: str, mocap: str, vehicle: str, room: RoomGeometry) -> list[str]:
    """What both kinds of file have in common; tables come last in TOML, so the room does, too."""
    return [
        'schema = "perchhw.campaign/1"',
        f"name = {toml_text(name)}",
        f"drone = {toml_text(drone)}",
        f"mocap = {toml_text(mocap)}",
        f"vehicle = {toml_text(vehicle)}",
        "",
        "[room]",
        f"ceiling_z = {room.ceiling_z:g}",
    ]
