"""``perchhw gap landings``: how landings end, predicted from each flight's trigger, beside how they did."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from onboard.json_file import as_json
from perchhw.cli.options import FlightFormat, Legs
from perchhw.cli.output import emit
from perchhw.consoles import console, progress_console, say
from perchhw.screen.long_work import share_done

if TYPE_CHECKING:
    from calibration.flights import Flight
    from calibration.gap.data.record import NotUsed
    from calibration.gap.landings.outcomes import LandingReport
    from calibration.gap.landings.outcomes.body_contact import ContactScore
    from calibration.gap.landings.outcomes.nested import NestedScore
    from calibration.gap.landings.outcomes.scores import Count, Score
    from calibration.gap.landings.outcomes.search import OutcomeSearch
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
    for folder in (out, pictures):
        if folder is not None:
            require_writable(folder)
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
        for one in drawn:
            _save(pictures, f"{_IN_NO_FILE_NAME.sub('_', one.name)}.png", one.drawn)
    if out is not None:
        _save(out, _PAGE, _page(report, drawn))


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


def _write(report: "LandingReport", folder: Path) -> None:
    import json

    from calibration.gap.report.improved_vehicle import write_vehicle
    from onboard.record.folder import OutputFolderError

    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _DOCUMENT).write_text(json.dumps(as_json(report), indent=1) + "\n", encoding="utf-8")
        if report.improved is not None:
            write_vehicle(report.improved.vehicle, folder)
    except OSError as error:
        raise OutputFolderError(folder, error.strerror) from error


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


def _save(folder: Path, name: str, content: bytes) -> None:
    from onboard.record.folder import OutputFolderError

    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    except OSError as error:
        raise OutputFolderError(folder, error.strerror) from error


def _tell(report: "LandingReport", folder: Path | None) -> None:
    from rich.table import Table

    from calibration.gap.report.improved_vehicle import VEHICLE_FILE

    screen = console()
    listed = Table("flight", "real", "four", "two", "none", "body contact", box=None, pad_edge=False)
    for flight in as_json(report)["flights"]:
        shares = [f"{flight[key]:.2f}" for key in ("p_four", "p_two", "p_none", "p_body_contact")]
        listed.add_row(flight["name"], flight["real"] or "", *shares)
    screen.print(listed)
    if report.score is not None:
        _tell_score(report.score)
    if report.contact_score is not None:
        _tell_contact(report.contact_score)
    if report.prepared.roll is not None:
        screen.print(f"roll in the flips, not refuted: {', '.join(report.prepared.roll.left) or 'nothing'}")
    if report.search is not None:
        _tell_search(report.search)
    if report.nested is not None:
        _tell_nested(report.nested)
    for item in report.unused:
        say(progress_console(), f"not judged: {item.name}: {item.reason}")
    for sentence in (*report.words, *report.prospects):
        say(screen, sentence)
    if folder is None:
        return
    if report.improved is not None:
        screen.print(f"vehicle with it: {folder / VEHICLE_FILE}", markup=False, soft_wrap=True)
    screen.print(f"document: {folder / _DOCUMENT}", markup=False, soft_wrap=True)
    screen.print(f"page: {folder / _PAGE}", markup=False, soft_wrap=True)


def _tell_score(found: "Score") -> None:
    from calibration.gap.landings.outcomes.words import between, difference, percent

    screen, known = console(), found.brier_gain is not None
    base = (
        f", base rate {found.brier_base_rate:.2f} (in sample {found.brier_base_rate_in_sample:.2f}); "
        f"difference {difference(found.brier_gain, found.brier_gain_ci95)}"
    )
    say(screen, f"Brier {found.brier:.2f}{base if known else between(found.brier_ci95)}")
    right = found.brier_if_right
    say(
        screen,
        f"Brier of probabilities that are right {right.mean:.2f}{between(right.ci95)}; as bad as "
        f"{found.brier:.2f} or worse in {percent(right.p_value)}",
    )
    log_base = f", base rate {found.log_score_base_rate:.2f}" if known else ""
    say(screen, f"log score {found.log_score:.2f}{between(found.log_score_ci95)}{log_base}")
    if found.auc_four is not None:
        say(screen, f"AUC of four legs {found.auc_four:.2f}{between(found.auc_four_ci95)}")
    for word, count in found.counts.items():
        say(screen, f"{word}: {_counted(count)}")


def _counted(count: "Count") -> str:
    low, high = count.interval80
    outside = "" if count.inside else "; outside"
    return f"{count.real} real, {count.expected:.1f} expected (80 %: {low} to {high}{outside})"


def _tell_contact(found: "ContactScore") -> None:
    from calibration.gap.landings.outcomes.words import between, difference

    known = found.brier_gain is not None
    base = (
        f", base rate {found.brier_base_rate:.2f}, difference "
        f"{difference(found.brier_gain, found.brier_gain_ci95)}"
    )
    log_base = f", base rate {found.log_score_base_rate:.2f}"
    auc = "" if found.auc is None else f"; AUC {found.auc:.2f}{between(found.auc_ci95)}"
    say(
        console(),
        f"body contact of {found.flights} flights that held: {_counted(found.count)}; Brier "
        f"{found.brier:.2f}{base if known else ''}; log score {found.log_score:.2f}"
        f"{between(found.log_score_ci95)}{log_base if known else ''}{auc}",
    )


def _tell_search(found: "OutcomeSearch") -> None:
    from rich.table import Table

    from calibration.gap.landings.outcomes.words import between

    screen = console()
    columns = ("open", "Brier, left one out", "base", "from the other half", "base", "AUC of four", "values")
    table = Table(*columns, box=None, pad_edge=False)
    for fit in found.fits:
        left_out, half = fit.left_one_out, fit.halves
        values = ", ".join(
            f"{name} {one.mean:.3g} +- {one.sigma:.2g}{' (at bound)' if one.at_bound else ''}"
            for name, one in fit.values.items()
        )
        scores = (
            f"{value:.3f}"
            for value in (left_out.brier, left_out.brier_base_rate, half.brier, half.brier_base_rate)
        )
        table.add_row(
            fit.name,
            *scores,
            "" if left_out.auc_four is None else f"{left_out.auc_four:.2f}{between(left_out.auc_four_ci95)}",
            values,
        )
    screen.print(table)
    for group, gain in found.gains.items():
        verdict = (
            "wrong"
            if group in found.named
            else "cannot be told"
            if group in found.left_open
            else "another law does better"
        )
        say(
            screen,
            f"{group}: {verdict} (Brier {gain.brier:+.3f}, {gain.ci95[0]:+.3f} to {gain.ci95[1]:+.3f})",
        )


def _tell_nested(found: "NestedScore") -> None:
    """The score to quote: that of the best model is of a model which these flights chose."""
    from calibration.gap.landings.outcomes.words import between, difference

    one, half, best = found.left_one_out, found.halves, found.halves_of_best
    count = sum(found.chosen_by_halves.values())
    auc = "" if one.auc_four is None else f"; AUC of four {one.auc_four:.2f}{between(one.auc_four_ci95)}"
    (model, times), (by_halves, times_by_halves) = (
        next(iter(chosen.items())) for chosen in (found.chosen, found.chosen_by_halves)
    )
    say(
        console(),
        f"with the model chosen anew without each flight (most often {model}, {times} of {one.flights}): "
        f"Brier {one.brier:.3f}, base {one.brier_base_rate:.3f}; difference "
        f"{difference(one.brier_gain, one.brier_gain_ci95)}{auc}",
    )
    say(
        console(),
        f"with the model chosen by the other half (most often {by_halves}, {times_by_halves} of {count}): "
        f"Brier {half.brier:.3f}, base {half.brier_base_rate:.3f}; the best model of all flights on the same "
        f"halves {best.brier:.3f}",
    )
