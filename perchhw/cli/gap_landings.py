"""``perchhw gap landings``: how landings end, predicted from each flight's trigger, beside how they did."""

import itertools
import re
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from onboard.json_file import as_json
from perchhw.cli.options import FlightFormat, Legs
from perchhw.cli.output import emit, settings, written
from perchhw.consoles import console, progress_console, say
from perchhw.screen.long_work import share_done

if TYPE_CHECKING:
    from calibration.flights import Flight
    from calibration.gap.data.record import NotUsed
    from calibration.gap.landings.outcomes import LandingReport
    from calibration.gap.report.landing_pictures import LandingPicture
    from onboard.outcome import Outcome
    from onboard.vehicle import Vehicle


def landings_command(
    data: Annotated[
        list[Path],
        typer.Option(
            "--data", help="Flight files, or folders of them; labels.csv (file,outcome) beside them is read."
        ),
    ],
    vehicle: Annotated[str, typer.Option(help="Vehicle file, or the name of a known vehicle: the model.")],
    more: Annotated[list[Path] | None, typer.Argument(metavar="[PATH]...", help="More of --data.")] = None,
    format: FlightFormat = "auto",
    legs: Legs = None,
    search: Annotated[
        bool,
        typer.Option(
            "--search", help="Also look for what the vehicle lacks, by 12 or more classified flights."
        ),
    ] = False,
    draws: Annotated[int, typer.Option(min=20, help="Simulated landings a flight.")] = 200,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for landings.json, landings.html and, where --search finds something, vehicle.toml."
        ),
    ] = None,
    pictures: Annotated[
        Path | None, typer.Option(help="Folder for a PNG of each flight's motion, real and simulated.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all random numbers.")] = 0,
) -> None:
    """How likely four legs, two or none hold, simulated from each flight's trigger, beside what happened."""
    import numpy as np

    from calibration.flights import flight_files, open_flights
    from calibration.gap.data.record import NotUsed
    from calibration.gap.landings.outcomes import (
        LABELS_FILE,
        forecast,
        landing_report,
        lost_labels,
        prepare,
        read_labels,
        require_searchable,
        search_report,
    )
    from onboard.errors import InputError
    from onboard.record.folder import require_writable
    from onboard.room import RoomGeometry
    from onboard.vehicle import load_vehicle
    from sim_backend.physics.parameters import physics_parameters

    model = load_vehicle(vehicle, legs=legs)
    if model.legs is None:
        raise InputError(f"vehicle {vehicle!r} has no legs to land on: choose a design with --legs")
    for folder, option in ((out, "--out"), (pictures, "--pictures")):
        if folder is not None:
            require_writable(folder, option)
    files = [file for file in flight_files([*data, *(more or [])]) if file.name != LABELS_FILE]
    flights, unreadable = open_flights(files, format)
    sources = [flight.source for flight in flights]
    labels, lost = read_labels(sources), lost_labels(sources)
    prepared = prepare(flights, model, np.random.default_rng(seed), draws)
    refused = (*(NotUsed(str(item.file), item.reason) for item in unreadable), *lost)
    if not prepared.starts:
        reasons = _grouped((*prepared.unused, *refused)) or "there is no flight"
        raise InputError(f"no flight has a trigger to start from: {reasons}")
    told = [_outcome(start.flight, labels, model) for start in prepared.starts]
    real = [outcome for outcome, _ in told]
    if search:
        require_searchable(real)  # before minutes of simulation
    with share_done("simulating") as simulated:
        parameters = physics_parameters(model, RoomGeometry())
        found = forecast(prepared, parameters, lambda share: simulated(share, 1.0))
    labelled = [start.flight.source in labels for start in prepared.starts]
    shows_contact = [shows for _, shows in told]
    report = landing_report(prepared, found, real, labelled, model, seed, refused, shows_contact)
    if search:
        try:
            with share_done("searching") as searched:
                report = search_report(report, lambda share: searched(share, 1.0))
        except KeyboardInterrupt:
            say(progress_console(), "stopping the search, which was not finished: this is known without it")
            _give(report, out, pictures)
            raise
    _give(report, out, pictures)


def _give(report: "LandingReport", out: Path | None, pictures: Path | None) -> None:
    """Write what was found, tell it, and draw its page, which takes seconds: whoever ends it has all else."""
    if out is not None:
        _write(report, out)
    emit(report, lambda: _tell(report, out))
    if out is None and pictures is None:
        return
    say(progress_console(), f"drawing {pictures if out is None else out / _PAGE}")
    drawn = _draw(report)
    if pictures is not None:
        for file, one in zip(_file_names([one.name for one in drawn]), drawn, strict=True):
            _save(pictures, file, one.drawn, "--pictures")
    if out is not None:
        _save(out, _PAGE, _page(report, drawn))
        if not settings.as_json:
            written(sys.stdout, partial(_tell_file, "page", out / _PAGE))


_REASONS = 3  # that an error tells


def _grouped(unused: "Sequence[NotUsed]") -> str:
    """Why flights are not used, each reason once, the most frequent ones."""
    named: dict[str, list[str]] = {}
    for item in unused:
        named.setdefault(item.reason, []).append(item.name)
    told = sorted(named.items(), key=lambda entry: -len(entry[1]))[:_REASONS]
    words = [
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {reason}"
        for reason, names in told
    ]
    rest = len(unused) - sum(len(names) for _, names in told)
    return "; ".join([*words, *([f"and {rest} more flights"] if rest else [])])


def _outcome(
    flight: "Flight", labels: "dict[Path, Outcome]", vehicle: "Vehicle"
) -> "tuple[Outcome | None, bool]":
    """What people said of a flight, else what its data show; and whether that tells body contact."""
    from perchhw.label import LabelError, label_flight

    if flight.source in labels:
        return labels[flight.source], True
    if any(file.parent == flight.source.parent for file in labels):
        return None, False  # its neighbours were classified, and it was not
    try:
        label = label_flight(flight, vehicle)
    except LabelError:
        return None, False
    return label.outcome, label.shows_body_contact


_DOCUMENT, _PAGE = "landings.json", "landings.html"
_IN_NO_FILE_NAME = re.compile(r"[^\w.+-]")


def _file_names(names: Sequence[str]) -> list[str]:
    """A file for each flight: those of one name, from two folders, have a number behind it."""
    given: set[str] = set()
    files = []
    for name in names:
        stem = _IN_NO_FILE_NAME.sub("_", name)
        tries = itertools.chain([stem], (f"{stem}-{number}" for number in itertools.count(2)))
        free = next(one for one in tries if one.casefold() not in given)  # some disks know no capitals
        given.add(free.casefold())
        files.append(f"{free}.png")
    return files


def _take_away_older(report: "LandingReport", folder: Path) -> None:
    """What an earlier run wrote here and this one may not write anew; a vehicle file that is judged stays."""
    import json

    from calibration.gap.report.improved_vehicle import VEHICLE_FILE
    from onboard.vehicle import vehicle_to_toml
    from onboard.vehicle.fingerprint import fingerprint

    (folder / _PAGE).unlink(missing_ok=True)
    try:
        older = json.loads((folder / _DOCUMENT).read_text(encoding="utf-8"))
        found = fingerprint((folder / VEHICLE_FILE).read_text(encoding="utf-8"))
        ours = found == older["improved"]["vehicle_sha256"]
    except (OSError, ValueError, KeyError, TypeError):
        return  # none that such a document tells of
    if ours and found != fingerprint(vehicle_to_toml(report.vehicle)):
        (folder / VEHICLE_FILE).unlink()


def _write(report: "LandingReport", folder: Path) -> None:
    import json

    from calibration.gap.report.improved_vehicle import write_vehicle
    from onboard.record.folder import OutputFolderError

    try:
        folder.mkdir(parents=True, exist_ok=True)
        _take_away_older(report, folder)
        (folder / _DOCUMENT).write_text(json.dumps(as_json(report), indent=1) + "\n", encoding="utf-8")
        if report.improved is not None:
            write_vehicle(report.improved.vehicle, folder)
    except OSError as error:
        raise OutputFolderError(folder, error.strerror) from error


def _tell(report: "LandingReport", folder: Path | None) -> None:
    from calibration.gap.report.improved_vehicle import VEHICLE_FILE
    from perchhw.cli.gap_landings_told import tell_landings

    tell_landings(report)
    if folder is None:
        return
    if report.improved is not None:
        _tell_file("vehicle with it", folder / VEHICLE_FILE)
    _tell_file("document", folder / _DOCUMENT)


def _tell_file(what: str, file: Path) -> None:
    """On a line of its own, which nothing breaks."""
    console().print(f"{what}: {file}", markup=False, soft_wrap=True)


def _draw(report: "LandingReport") -> "list[LandingPicture]":
    from calibration.gap.report.landing_pictures import landing_pictures
    from onboard.room import RoomGeometry
    from sim_backend.physics.parameters import physics_parameters

    found = []
    with share_done("drawing") as drawn:
        for picture in landing_pictures(report, physics_parameters(report.vehicle, RoomGeometry())):
            found.append(picture)
            drawn(len(found), len(report.real))
    return found


def _page(report: "LandingReport", pictures: "list[LandingPicture]") -> bytes:
    from calibration.gap.report.landings_page import landings_page

    return landings_page(report, pictures).encode("utf-8")


def _save(folder: Path, name: str, content: bytes, option: str = "--out") -> None:
    from onboard.record.folder import OutputFolderError

    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    except OSError as error:
        raise OutputFolderError(folder, error.strerror, option) from error
