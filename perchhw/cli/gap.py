"""``perchhw gap``: where the model and measured flights disagree."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from onboard.json_file import as_json
from perchhw.cli.gap_landings import landings_command
from perchhw.cli.gap_suggest import suggest_command
from perchhw.cli.gap_walkthrough import walkthrough_command
from perchhw.cli.options import FlightFormat, Legs
from perchhw.cli.output import emit
from perchhw.consoles import console, progress_console, say
from perchhw.screen.long_work import activity

if TYPE_CHECKING:
    from calibration.flights import Flight
    from calibration.gap.data import PreparedFlights
    from calibration.gap.replay import PredictionErrors
    from calibration.gap.report import GapReport

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Compare the model with measured flights.")
app.command("landings")(landings_command)
app.command("suggest")(suggest_command)
app.command("walkthrough")(walkthrough_command)

DataOption = Annotated[
    list[Path], typer.Option("--data", help="Flight files, or folders of them; more may follow it.")
]
MoreData = Annotated[list[Path] | None, typer.Argument(metavar="[PATH]...", help="More of --data.")]
VehicleOption = Annotated[str, typer.Option(help="Vehicle file, or the name of a known vehicle: the model.")]
CeilingOption = Annotated[float | None, typer.Option(help="Height of the ceiling, m, if there is one.")]


@app.command()
def evaluate(
    data: DataOption,
    vehicle: VehicleOption,
    more: MoreData = None,
    format: FlightFormat = "auto",
    legs: Legs = None,
    ceiling: CeilingOption = None,
    horizons: Annotated[str, typer.Option(help="Seconds ahead, increasing.")] = "0.1,0.25,0.5,1.0",
    calibrate_first_s: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Fit each flight's thrust scale, lean and trim to its first seconds; score the rest.",
        ),
    ] = 0.0,
) -> None:
    """How well a model predicts flights: mean errors by horizon, and what no model could beat."""
    from calibration.gap.data.under_ceiling import under_ceiling
    from calibration.gap.replay import evaluate as predict
    from onboard.room import ceiling_height
    from onboard.vehicle import load_vehicle

    seconds = _seconds(horizons)
    model = load_vehicle(vehicle, legs=legs)
    height = None if ceiling is None else ceiling_height(ceiling)
    flights, unusable = read_records([*data, *(more or [])], format)
    records = list(flights.records) if height is None else under_ceiling(flights.records, height)
    errors = predict(records, model, seconds, calibrate_first_s)
    document = as_json(errors)
    document["unusable"] = unusable + [
        {"file": item["file"], "reason": item["reason"]} for item in document.pop("unpredicted")
    ]
    document["limitations"] = list(flights.limitations)
    document["vehicle"] = vehicle
    _warn(document)
    emit(document, lambda: _draw(errors, vehicle))


@app.command()
def find(
    data: DataOption,
    vehicle: VehicleOption,
    out: Annotated[Path, typer.Option(help="Folder for report.json, report.html and vehicle.toml.")],
    more: MoreData = None,
    format: FlightFormat = "auto",
    legs: Legs = None,
    ceiling: CeilingOption = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all random numbers.")] = 0,
) -> None:
    """Find where model and flights disagree, name what is missing, and write the improved vehicle file."""
    from calibration.gap.data.record import NotUsed
    from calibration.gap.find import GapQuestion, find_gap
    from calibration.gap.report import write_report
    from calibration.gap.report.improved_vehicle import write_vehicle
    from onboard.record.folder import require_writable
    from onboard.vehicle import load_vehicle

    model = load_vehicle(vehicle, legs=legs)
    require_writable(out)
    with activity("reading") as tell:
        flights, refused = read_flights([*data, *(more or [])], format)
        asked = GapQuestion(
            vehicle=model,
            seed=seed,
            ceiling_z=ceiling,
            unusable=[NotUsed(item["file"], item["reason"]) for item in refused],
        )
        result = find_gap(flights, asked, progress=tell)
    for item in result.report.unusable:
        left_out = with_file({"file": item.name, "reason": item.reason})
        say(progress_console(), f"unusable: {left_out}", "yellow")
    page = write_report(result.report, out, result.figures)
    write_vehicle(result.vehicle, out)
    emit(result.report, lambda: _tell(result.report, page))


def read_records(paths: list[Path], format: str) -> tuple["PreparedFlights", list[dict[str, str]]]:
    """Records of all usable flights, and the files that hold none, each with the reason.

    Raises:
        InputError: a path does not exist, or not one flight is usable.
    """
    from calibration.gap.data import prepare_flights
    from onboard.errors import InputError

    opened, unusable = read_flights(paths, format)
    prepared = prepare_flights(opened)
    unusable += [{"file": str(item.file), "reason": item.reason} for item in prepared.refused]
    if not prepared.records:
        raise InputError(f"no usable flight: {'; '.join(with_file(item) for item in unusable)}")
    return prepared, unusable


def read_flights(paths: list[Path], format: str) -> tuple[list["Flight"], list[dict[str, str]]]:
    """Flights that can be read, and the files that cannot, each with the reason."""
    from calibration.flights import flight_files, open_flights

    flights, unusable = open_flights(flight_files(paths), format)
    return flights, [{"file": str(item.file), "reason": item.reason} for item in unusable]


def with_file(unusable: dict[str, str]) -> str:
    """The reason, with the file in front where it does not name it itself."""
    file, reason = unusable["file"], unusable["reason"]
    return reason if file in reason else f"{file}: {reason}"


def _tell(report: "GapReport", page: Path) -> None:
    from rich.table import Table

    console().print(f"verdict: {report.verdict}", markup=False)
    table = Table("effect", "parameter", "value", "95 %", "right", "or", box=None, pad_edge=False)
    for effect in report.effects:
        for number, (name, one) in enumerate(effect.parameters.items()):
            table.add_row(
                effect.name if number == 0 else "",
                name,
                f"{one.value:.4g} {one.unit}",
                f"{one.ci95[0]:.4g} .. {one.ci95[1]:.4g}",
                f"{effect.probability:.2f}" if number == 0 and effect.probability is not None else "",
                ", ".join(effect.ambiguous_with) if number == 0 else "",
            )
    if report.effects:
        console().print(table)
    for refused in report.landings.unused if report.landings else ():
        say(console(), f"landing refused: {refused.name}: {refused.reason}")
    if report.unexplained.formula:
        console().print(f"unexplained: {report.unexplained.formula}", markup=False)
    for text in report.nameless.written:
        console().print(f"in the vehicle file, without a name: {text}", markup=False)
    for rejected in report.nameless.refused:
        console().print(f"not in the vehicle file: {rejected.name}: {rejected.reason}", markup=False)
    console().print(f"report: {page}", markup=False, soft_wrap=True)


def _seconds(text: str) -> tuple[float, ...]:
    from onboard.errors import InputError

    try:
        seconds = tuple(float(part) for part in text.split(","))
    except ValueError:
        seconds = ()
    if not seconds or not all(map(math.isfinite, seconds)):
        raise InputError(f"--horizons {text!r}: expected seconds such as 0.1,0.5,1.0")
    return seconds


def _warn(document: dict[str, Any]) -> None:
    """Tell the person on stderr what was left out and what to be careful with."""
    lines = [f"unusable: {with_file(item)}" for item in document["unusable"]]
    lines += [f"limit: {text}" for text in document["limitations"]]
    lines += [f"doubt: {text}" for text in document["doubts"]]
    for line in lines:
        say(progress_console(), line, "yellow")


def _draw(errors: "PredictionErrors", vehicle: str) -> None:
    from rich.table import Table

    count = len(errors.flights)
    after = f", after their first {errors.calibrated_s:g} s" if errors.calibrated_s else ""
    console().print(f"{vehicle} on {count} flight{'s'[: count > 1]}{after}: mean errors", markup=False)
    columns = ("after s", "position m", "velocity m/s", "attitude deg", "rate rad/s", "starts")
    table = Table("", *columns, box=None, pad_edge=False)
    floor = errors.floor
    blocks = [
        ("all predicted", errors.overall.open_loop),
        ("attitude given", errors.overall.given_attitude),
        ("torque estimated", errors.with_torque_estimate),
    ]
    if floor is not None:
        blocks += [("floor, all", floor.open_loop), ("floor, att. given", floor.given_attitude)]
    for name, block in blocks:
        for number, (horizon, found) in enumerate(block.items()):
            means = (found.position_m, found.velocity_m_s, found.attitude_deg, found.rate_rad_s)
            table.add_row(
                name if number == 0 else "",
                f"{horizon:g}",
                *("" if mean is None else f"{mean:.3g}" for mean in means),
                str(found.windows),
            )
    console().print(table)
    if floor is not None:
        console().print("floor: gyro and accelerometer in place of the model", markup=False)
