"""``perchhw gap suggest``: flights that tell apart what the data could not."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from perchhw.cli.output import emit
from perchhw.consoles import progress_console

if TYPE_CHECKING:
    from calibration.gap.suggest.suggestions import Suggestion

DEFAULT_DRONE = "udp://127.0.0.1:19850"
DEFAULT_MOCAP = "vicon://127.0.0.1:18801?subject=cf1"


def suggest_command(
    report: Annotated[Path, typer.Option(help="report.json of `gap find`.")],
    vehicle: Annotated[
        str | None,
        typer.Option(help="Vehicle that flies; default: vehicle.toml beside the report."),
    ] = None,
    legs: Annotated[str | None, typer.Option(help="Leg design instead of the vehicle's own.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Campaign file; default: suggested.toml beside the report.")
    ] = None,
    drone: Annotated[
        str, typer.Option(help="URI of the drone, for the campaign file; default: the simulated lab's.")
    ] = DEFAULT_DRONE,
    mocap: Annotated[str, typer.Option(help="URI of the mocap stream, likewise.")] = DEFAULT_MOCAP,
    ceiling: Annotated[float, typer.Option(help="Height of the ceiling, m.")] = 2.10,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="KIND", help="Choose from these kinds of flight; may be repeated."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated disturbances.")] = 0,
) -> None:
    """Choose, by simulation, the flights that separate effects which a report could not tell apart.

    Writes a campaign file: `perchhw campaign run FILE` flies it, on hardware or in the simulated lab.
    Effects of legs and feet need landings, which get a file of their own.
    """
    from calibration.gap.suggest.campaign_file import flights_file, landings_file
    from calibration.gap.suggest.open_questions import read_questions
    from calibration.gap.suggest.suggestions import Suggester
    from onboard.manoeuvres import MANOEUVRES
    from onboard.room import RoomGeometry, ceiling_height
    from onboard.vehicle import load_vehicle

    questions = read_questions(report)
    name = vehicle or _beside(report)
    if Path(name).is_file():
        name = str(Path(name).resolve())  # the campaign may be flown from elsewhere
    room = RoomGeometry(ceiling_z=ceiling_height(ceiling))
    screen = progress_console()
    search = Suggester(
        vehicle=load_vehicle(name, legs),
        room=room,
        seed=seed,
        kinds=only or tuple(MANOEUVRES),
        on_pair=lambda pair: screen.print(f"{pair[0]} or {pair[1]} ...", markup=False),
    )
    suggestions = search.suggest(questions)
    target = out or report.parent / "suggested.toml"
    landings = target.with_name(f"{target.stem}-landings{target.suffix}")
    written = []
    for path, make in ((target, flights_file), (landings, landings_file)):
        text = make(suggestions, path.stem, drone, mocap, name, room)
        if text is not None:
            _write(path, text)
            written.append(str(path))
    document = {
        "schema": "perchhw.gap_suggestion/1",
        "suggestions": suggestions,
        "campaigns": written,
    }
    emit(document, _in_words(suggestions, written))


def _beside(report: Path) -> str:
    from onboard.errors import InputError

    path = report.parent / "vehicle.toml"
    if not path.is_file():
        raise InputError(f"{path} is missing: name the vehicle that flew with --vehicle")
    return str(path)


def _write(path: Path, text: str) -> None:
    from onboard.record.folder import OutputFolderError

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputFolderError(path.parent, error.strerror) from error


def _in_words(suggestions: "list[Suggestion]", written: list[str]) -> str:
    if not suggestions:
        return "the report leaves nothing open"
    lines = []
    for suggestion in suggestions:
        pair = " or ".join(suggestion.pair)
        if suggestion.flight is None:
            what = suggestion.advice or "and no measurement that we know"
            lines.append(f"{pair}: no flight of the library tells them apart; {what}")
            continue
        best = suggestion.ranking[0][1]
        lines.append(
            f"{pair}: {suggestion.flight}, {suggestion.times} times "
            f"(expected log-likelihood ratio {best.log_likelihood_ratio:.3g} in {best.seconds:.0f} s)"
        )
    return "\n".join([*lines, *(f"fly it: perchhw campaign run {path}" for path in written)])
