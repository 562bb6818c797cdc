"""``perchhw rehearse``: an approach on the desk, computed by the drone, judged by the reference."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from perchhw.cli import exit_codes
from perchhw.cli.lab_options import LabDrone, LabPolicy, LabVehicle
from perchhw.cli.options import Lab
from perchhw.cli.output import emit
from perchhw.cli.view_option import LiveView, live_view
from perchhw.rehearsal.physics import Physics

if TYPE_CHECKING:
    from perchhw.rehearsal.session import Rehearsed

app = typer.Typer(add_completion=False)


@app.command()
def rehearse(
    drone: LabDrone = None,
    speed: Annotated[float, typer.Option(help="Speed on the approach line, m/s.")] = 2.5,
    angle: Annotated[float, typer.Option(help="Angle of the approach line above the horizon, deg.")] = 50.0,
    on: Annotated[
        Physics,
        typer.Option(
            help="Who flies the approach: the host, by poses that it sends, or a model on the drone itself."
        ),
    ] = Physics.HOST,
    policy: LabPolicy = None,
    vehicle: LabVehicle = None,
    lab: Lab = None,
    out: Annotated[
        Path | None, typer.Option(help="Keep verdict and recording in a new folder inside this one.")
    ] = None,
    view: LiveView = None,
) -> int:
    """Rehearse an approach on the desk, propellers off: the drone computes it, and nothing turns.

    The drone gets policy and approach, and poses of a flight that nobody flies, or with --on drone flies a
    model of itself. What it recorded of its trigger is held against the reference on the same inputs: same
    sample, same moment, same forces.

    Exit codes: 0 passed, 1 failed, 2 input that cannot be used, 3 the drone is armed, flies or a motor turns,
    130 interrupted.
    """
    from dataclasses import asdict

    from onboard.policy.bundle import policy_crc32
    from onboard.policy.files import find_policy, load_policy
    from onboard.trajectory import fit_approach
    from onboard.vehicle import load_vehicle
    from perchhw.lab import desk_setup, find_lab
    from perchhw.record import discard_if_empty, new_run_folder
    from perchhw.rehearsal.record import save_rehearsal, verdict_document
    from perchhw.rehearsal.session import Stage
    from perchhw.rehearsal.session import rehearse as rehearse_on
    from perchhw.rehearsal.watched import record_in
    from perchhw.screen.flight_display import flight_display

    setup = desk_setup(find_lab(lab), drone=drone, vehicle=vehicle, policy=policy)
    plan = fit_approach(speed, angle, setup.room)
    loaded = load_policy(find_policy(setup.policy))
    design = load_vehicle(setup.vehicle, setup.legs)
    folder, open_record = None, None
    if view is not None:
        out = out or Path("runs")
        folder = new_run_folder(out, "rehearsal")
        open_record = record_in(
            folder,
            {
                "speed_m_s": speed,
                "angle_deg": angle,
                "on": str(on),
                "drone": setup.drone,
                "policy": setup.policy,
                "policy_crc32": f"{policy_crc32(loaded):08x}",
                "vehicle": setup.vehicle,
                "legs": setup.legs,
                "ceiling_z": float(plan.ceiling_z),
                "room": asdict(setup.room),
                "approach": {name: float(value) for name, value in plan._asdict().items()},
            },
        )
    try:
        with (
            flight_display("rehearse", setup.drone) as display,
            live_view(view, folder or Path(), display),
        ):

            def on_stage(stage: Stage, waits_for: str) -> None:
                display.stage(stage, waits_for, tuple(Stage))

            rehearsal = rehearse_on(setup.drone, plan, loaded, design, open_record, on_stage, on)
    finally:
        if folder is not None:
            discard_if_empty(folder)
    document, words = verdict_document(rehearsal), _in_words(rehearsal)
    if out is not None:
        document["record"] = str(save_rehearsal(out, rehearsal, folder))
        words += f"\nrecord: {document['record']}"
    emit(document, words)
    return exit_codes.DONE if rehearsal.verdict.passed else exit_codes.FAILED


def _in_words(rehearsal: "Rehearsed") -> str:
    verdict = rehearsal.verdict
    word = "passed" if verdict.passed else "FAILED"
    lines = [f"rehearsal {word} (on {rehearsal.physics}, engine {rehearsal.engine})"]
    lines += [f"  {failure}" for failure in verdict.failures]
    if verdict.passed:
        lines.append(
            "  drone and reference trigger on the same sample: "
            f"moment within {verdict.a_rot_difference_n_m:.1e} N m, "
            f"forces within {verdict.force_difference_n:.1e} N"
        )
    away = verdict.input_difference
    if away is not None:
        lines.append(
            f"  inputs against the ideal approach: {100.0 * away['position_m']:.1f} cm, "
            f"{away['velocity_m_s']:.2f} m/s; at the trigger tau {1000.0 * away['tau_s']:+.0f} ms, "
            f"theta_x {away['theta_x_1_s']:+.2f} 1/s"
        )
    loop = rehearsal.loop
    if loop is not None:
        lines.append(f"  control loop: {loop.mean:.0f} us a step, at most {loop.most:.0f} us of 1000")
    return "\n".join(lines)
