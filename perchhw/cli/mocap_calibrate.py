"""``perchhw mocap calibrate``: marker body, ceiling and latency, measured and written into the lab file."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from onboard.json_file import as_json
from perchhw.cli import exit_codes
from perchhw.cli.bench_options import told_what_is_kept
from perchhw.cli.lab_options import LabDrone
from perchhw.cli.options import Lab
from perchhw.cli.output import emit

if TYPE_CHECKING:
    from perchhw.mocap_calibration.result import RoomFound


def calibrate(
    lab: Lab = None,
    drone: LabDrone = None,
    wand: Annotated[str, typer.Option(help="Subject whose origin is the marker that touches.")] = "wand",
    marker_radius_mm: Annotated[float, typer.Option(min=0.0, max=50.0, help="Of that marker.")] = 7.0,
    plate_mm: Annotated[
        float, typer.Option(min=-100.0, max=2000.0, help="Height of the plate's top above z = 0.")
    ] = 0.0,
    rest_height_mm: Annotated[
        float | None,
        typer.Option(
            min=1.0,
            max=200.0,
            help="Height of the body's origin above the plate it stands on. Default: by the vehicle file.",
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.5, max=6.0, help="Of the approach that is told of, m/s.")
    ] = 2.5,
    angle: Annotated[
        float, typer.Option(min=20.0, max=90.0, help="Of that approach above the horizon, deg.")
    ] = 50.0,
    within: Annotated[float, typer.Option(min=5.0, max=3600.0, help="s to wait for each step.")] = 120.0,
    out: Annotated[
        Path, typer.Option(help="Folder of this calibration; the same folder goes on where it ended.")
    ] = Path("runs/mocap-calibrate"),
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what was found; leave the lab file as it is.")
    ] = False,
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not wait for Enter: each step is seen when it is done.")
    ] = False,
) -> int:
    """Measure the room: the drone rests twice, a wand touches the ceiling four times, the drone hovers.

    Writes room.ceiling, mocap.subject_to_body and mocap.latency_s into the lab file and keeps the rest of it.

    Exit codes: 0 measured, 2 a step that was not done, or places that do not tell what is sought, 3 a safety
    rule ended the flight, 130 interrupted; the steps that are done are kept.
    """
    from datetime import UTC, datetime

    from calibration.bench.procedures.run_book import RunBook, RunBookError
    from onboard.lab_file import LabFileError, put_measured
    from perchhw.cli.bench_operator import TerminalOperator
    from perchhw.cli.prompts import confirmation
    from perchhw.lab import find_lab, flight_setup
    from perchhw.lab.flying import LIMITS
    from perchhw.mocap_calibration.session import WRITTEN, CalibrationPlan, calibrate_room
    from perchhw.screen.lines import Lines

    before = find_lab(lab)
    if before is None:
        raise LabFileError("no lab file to write into: give --lab FILE, or begin one after docs/lab_file.md")
    setup = flight_setup(before, drone=drone)
    setup.check()
    plan = CalibrationPlan(
        lab=before,
        setup=setup,
        wand=wand,
        marker_radius=1e-3 * marker_radius_mm,
        plate=1e-3 * plate_mm,
        rest_height=None if rest_height_mm is None else 1e-3 * rest_height_mm,
        within=within,
        speed=speed,
        angle_deg=angle,
        source=f"perchhw mocap calibrate, {datetime.now(UTC):%Y-%m-%d}",
    )
    book = RunBook(out, "mocap calibrate", plan.settings(), TerminalOperator(yes))
    if WRITTEN in book.steps and not dry_run:
        raise RunBookError(
            f"{out}: this calibration is finished and written; give another --out for a new one, or "
            "--dry-run to read it again"
        )
    # The steps before the flight are asked for in lines, too.
    with told_what_is_kept(out), Lines() as lines:
        found, record = calibrate_room(plan, book, confirmation(yes, lines), lines)
    if not dry_run:
        shutil.copyfile(before.file, out / "lab-before.toml")
        put_measured(Path(before.file), found.lab(before, plan.source), LIMITS)
        book.step(WRITTEN, "Written", lambda: {"lab": before.file})
    document = as_json(found) | {"lab": before.file, "written": not dry_run, "record": str(record)}
    emit(document, _in_words(found, document))
    return exit_codes.DONE


def _in_words(found: "RoomFound", document: dict[str, Any]) -> str:
    body, ceiling, trigger = document["subject_to_body"], document["ceiling"], document["trigger"]
    place = ", ".join(f"{1e3 * p['value']:+.1f} ± {1e3 * p['u95']:.1f}" for p in body["position"])
    turn = ", ".join(
        f"{degrees:+.2f} ± {u95:.2f}"
        for degrees, u95 in zip(
            found.markers.rotation.as_rotvec(degrees=True).tolist(), body["turn_u95_deg"], strict=True
        )
    )
    tilts = ", ".join(
        f"{axis} {ceiling[f'tilt_{axis}_deg']['value']:+.2f} ± {ceiling[f'tilt_{axis}_deg']['u95']:.2f}"
        for axis in "xy"
    )
    height = ceiling["height"]
    late = f"{1e3 * found.latency.value:.1f} ± {1e3 * found.latency.u95:.1f} ms"
    untold = f"{1e3 * abs(found.unreported.value):.1f} ms {'more' if found.unreported.value > 0 else 'less'}"
    tau = f"tau ± {1e3 * trigger['u95_tau_s']:.1f} ms"
    parts = ", ".join(f"{1e3 * trigger[f'u95_{n}_s']:.1f} {n}" for n in ("ceiling", "markers", "latency"))
    written = f"written: {document['lab']}" if document["written"] else f"not written: {document['lab']}"
    return "\n".join(
        [
            f"body in its markers: {place} mm, turned by {turn} deg",
            f"plate: {document['plate_tilt_deg']:.2f} deg from level",
            f"ceiling: {height['value']:.4f} ± {height['u95']:.4f} m, rises by {tilts} deg",
            f"latency: {late}, {untold} than the source reports",
            f"trigger at {trigger['climb_m_s']:.2f} m/s of climb: {tau} ({parts})",
            written,
        ]
    )
