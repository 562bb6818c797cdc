"""``perchhw log``: list, export, label, report, view and replay recorded flights."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from onboard.json_file import as_json
from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE
from perchhw.cli.options import FlightFormat, Legs, Policy
from perchhw.cli.output import emit
from perchhw.cli.view import view
from perchhw.consoles import console, progress_console, say

if TYPE_CHECKING:
    from rich.table import Table

    from calibration.flights import Flight
    from onboard.vehicle import Vehicle
    from perchhw.record.listing import RunSummary

app = typer.Typer(add_completion=False)

_RunFolder = Annotated[Path, typer.Argument(help="A run folder.")]


@app.command("list")
def list_runs(root: Annotated[Path, typer.Argument(help="Folder that holds runs.")] = Path("runs")) -> int:
    """List the runs below a folder."""
    from perchhw.record.listing import find_runs

    runs, broken = find_runs(root)
    for problem in broken:
        progress_console().print(f"skipped: {problem}", style="yellow", markup=False)
    emit({"runs": runs, "broken": broken}, lambda: _draw_runs(root, runs))
    return 0


def _draw_runs(root: Path, runs: "list[RunSummary]") -> None:
    from itertools import groupby

    table = _table_of_runs()
    parents = {run.folder.parent for run in runs}
    for parent, together in groupby(runs, key=lambda run: run.folder.parent):
        if len(parents) > 1:
            table.add_row(f"in {os.path.relpath(parent, root)}:")  # a run may be the root itself
        for run in together:
            table.add_row(*_cells(run))
    console().print(table)
    for state in sorted({_state_of(run) for run in runs} & _STATES.keys()):
        console().print(f"{state}: {_STATES[state]}")


def _table_of_runs() -> "Table":
    from rich.table import Column, Table

    name = Column("run", no_wrap=True)  # RUN is typed elsewhere
    outcome = Column("outcome", overflow="fold", min_width=len("dry_run_passed"))
    return Table(
        name, "m/s", "deg", outcome, "fired", "record", box=None, pad_edge=False, collapse_padding=True
    )


def _cells(run: "RunSummary") -> tuple[str, ...]:
    return (
        run.folder.name,
        "" if run.speed is None else f"{run.speed:g}",
        "" if run.angle_deg is None else f"{run.angle_deg:g}",
        run.outcome or "",
        {True: "yes", False: "no", None: ""}[run.triggered],
        _state_of(run),
    )


_STATES = {
    "cut off": "a damaged copy, copy it again",
    "open": "its flight still writes it, or was killed",
}
"""What the record of a run is where it is not closed and whole, in words."""


def _state_of(run: "RunSummary") -> str:
    return "cut off" if run.cut_off else "closed" if run.closed else "open"


@app.command()
def export(
    run: _RunFolder,
    to: Annotated[
        str, typer.Option(help="csv, parquet, foxglove or ros2 (one MCAP file with messages of theirs).")
    ] = "csv",
    out: Annotated[Path | None, typer.Option(help="Folder to write to; default: export/ in the run.")] = None,
    rate: Annotated[float, typer.Option(help="Rate of resampled.*, all channels on one clock, Hz.")] = 100.0,
) -> int:
    """Write a run for other tools: one file per topic and flight.* with all channels, or one MCAP file."""
    from perchhw.record.export import ExportError, ExportFormat, export_run
    from perchhw.record.run import read_run

    if to not in tuple(ExportFormat):
        raise ExportError(f"--to {to}: not a known format; use {', '.join(ExportFormat)}")
    record = read_run(run)
    files = export_run(record, out or run / "export", ExportFormat(to), rate)
    for note in record.torn:
        progress_console().print(note, style="yellow", markup=False)
    emit(
        {"run": str(run), "files": [str(f) for f in files], "torn": list(record.torn)},
        "\n".join(str(f) for f in files),
    )
    return 0


@app.command()
def label(
    files: Annotated[list[Path], typer.Argument(help="Run folders or flight files.")],
    format: FlightFormat = "auto",
    vehicle: Annotated[
        str | None, typer.Option(help=f"Vehicle; default: the record's own, else {DEFAULT_VEHICLE}.")
    ] = None,
    legs: Legs = None,
    ceiling_z: Annotated[float | None, typer.Option(help="Height of the ceiling, m.")] = None,
) -> int:
    """Give the landing outcome of flights, with the evidence for it.

    A file that is broken or holds no usable flight is named with the reason, and the rest go on; when nothing
    could be labelled, the exit code is 2.
    """
    from calibration.flights import open_flight
    from onboard.errors import InputError
    from onboard.room import ceiling_height
    from onboard.vehicle import load_vehicle
    from perchhw.label import LabelError, label_flight

    if vehicle is not None:
        load_vehicle(vehicle, legs)  # a wrong option is no fault of the files
    if ceiling_z is not None:
        ceiling_height(ceiling_z)
    labels: list[dict[str, Any]] = []
    unusable: list[dict[str, str]] = []
    for file in files:
        try:
            flight = open_flight(file, format)
            result = label_flight(flight, _vehicle_of(flight, vehicle, legs), ceiling_z)
        except (InputError, LabelError) as error:
            unusable.append({"file": str(file), "reason": str(error)})
            continue
        labels.append({"file": str(file), **as_json(result), "notes": list(flight.notes)})
    document: dict[str, Any] = {"flights": labels, "unusable": unusable}
    if len(files) == 1 and labels:
        document["outcome"] = labels[0]["outcome"]
    for entry in unusable:
        say(progress_console(), f"unusable: {_with_file(entry)}", "yellow")
    emit(document, lambda: _draw_labels(labels) if labels else None)
    return 0 if labels else 2


def _with_file(unusable: dict[str, str]) -> str:
    """The reason, with the file in front where it does not name it itself."""
    file, reason = unusable["file"], unusable["reason"]
    return reason if file in reason else f"{file}: {reason}"


def _vehicle_of(flight: "Flight", vehicle: str | None, legs: str | None) -> "Vehicle":
    from onboard.record.run_record import read_info
    from onboard.vehicle import load_vehicle

    if vehicle is None and flight.format == "perchhw":
        config = read_info(flight.source)["config"]
        vehicle, legs = config.get("vehicle"), legs or config.get("legs")
    return load_vehicle(vehicle or DEFAULT_VEHICLE, legs)


def _draw_labels(labels: list[dict[str, Any]]) -> None:
    from rich.table import Column, Table

    name, outcome = Column("flight", no_wrap=True), Column("outcome", overflow="fold")  # as in `log list`
    table = Table(name, outcome, "by", "evidence", box=None, pad_edge=False, collapse_padding=True)
    for entry in labels:
        evidence = entry["evidence"]
        table.add_row(Path(entry["file"]).name, entry["outcome"], evidence["method"], _in_words(evidence))
    console().print(table)
    limits = sorted({limit for entry in labels for limit in entry["limits"]})
    for limit in limits:
        console().print(f"limit: {limit}", markup=False)


def _in_words(evidence: dict[str, Any]) -> str:
    """The evidence in one line."""
    if "pose" in evidence:
        pose = evidence["pose"]
        return (
            f"rests {pose['rest_distance_m'] * 1e3:.0f} mm below the ceiling, "
            f"tilt {pose['rest_tilt_deg']:.0f} deg, "
            f"body clearance {pose['body_clearance_m'] * 1e3:.0f} mm"
        )
    if "gyro" in evidence:
        gyro = evidence["gyro"]
        swing = "" if gyro["swing_hz"] is None else f" at {gyro['swing_hz']:.2f} Hz"
        rate = f"{gyro['settled_rms_rad_s']:.2f} rad/s RMS{swing} after landing"
        return f"{rate}; first touch {gyro['first_touch']}"
    if "n_feet" in evidence:
        return f"{evidence['n_feet']} feet hold"
    return f"aborted by {evidence['aborted_by']}" if evidence.get("aborted_by") else "never triggered"


@app.command()
def report(run: _RunFolder) -> int:
    """Write report.html of one flight into its folder, and say what happened, why, and what to do next."""
    from onboard.record.folder import OutputFolderError
    from perchhw.diagnosis import diagnose_run
    from perchhw.record.run import read_run
    from perchhw.report.run_report import REPORT_FILE, write_run_page

    record = read_run(run)
    for note in record.torn:
        progress_console().print(note, style="yellow", markup=False)
    try:
        found = write_run_page(record)
    except OutputFolderError:  # a full disk: what happened is told all the same
        found = diagnose_run(record)
        emit({"run": str(run), "report": None, "diagnosis": found}, found.in_words())
        raise
    path = run / REPORT_FILE
    emit(
        {"run": str(run), "report": str(path), "diagnosis": found},
        f"{found.in_words()}\nreport: {path}",
    )
    return 0


app.command()(view)


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="A run folder or flight file with cues.")],
    policy: Policy = DEFAULT_POLICY,
    format: FlightFormat = "auto",
) -> int:
    """Run a policy by the onboard arithmetic over the recorded cues: where would it have fired?"""
    from calibration.flights import open_flight
    from onboard.policy.files import find_policy, load_policy
    from perchhw.record.replay import replay_policy

    result = replay_policy(open_flight(file, format), load_policy(find_policy(policy)))
    emit({"file": str(file), "policy": policy, **as_json(result)}, result.in_words())
    return 0
