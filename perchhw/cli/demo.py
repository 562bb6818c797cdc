"""``perchhw demo``: from policy to labelled landings in a simulated lab, over the real protocols."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE
from perchhw.cli import exit_codes
from perchhw.cli.engine_option import Engine
from perchhw.cli.output import FlightDisplay, console, emit, progress_console
from sim_backend.engine_name import EngineName, usable_engine

if TYPE_CHECKING:
    from perchhw.campaign import AttemptRow, CampaignPlan

app = typer.Typer(add_completion=False)

SPEEDS = (2.25, 2.5, 2.75)
ANGLES_DEG = (50.0, 52.5, 55.0)
"""Conditions of the demo: the middle of the range in which the paper's vehicle lands best."""


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for the demo's run (a new folder inside it).")] = Path(
        "runs"
    ),
    attempts: Annotated[int, typer.Option(min=1, help="How many approaches to fly.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the lab's noise and of the order.")] = 1,
    engine: Engine = None,
) -> int:
    """Start a simulated lab, upload the shipped policy, fly approaches, label the landings, write a report.

    Exit codes: 0 every attempt was flown, 3 attempts were aborted by a safety rule.
    """
    from perchhw.campaign import run_campaign
    from perchhw.cli.campaign import live_table
    from perchhw.cli.prompts import confirmation
    from perchhw.flight.turnaround import attempt_after_attempt
    from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
    from perchhw.record import new_run_folder
    from perchhw.report import write_campaign_report

    screen = progress_console()
    flown_by = usable_engine(engine)
    arguments = [*FREE_PORTS, *LOCKSTEP, "--seed", str(seed), "--engine", flown_by]
    screen.print("Starting the simulated lab (the first start compiles it, up to half a minute) ...")
    with SimulatedLab("lab", arguments) as lab:
        folder = new_run_folder(out, "demo")
        plan = demo_plan(lab.drones[0], lab.mocap[0], attempts, seed)
        with live_table() as show:
            rows = run_campaign(
                plan,
                folder,
                attempt_after_attempt(confirmation(yes=True), FlightDisplay(phases=False)),
                on_change=show,
            )
    report = write_campaign_report(folder)
    recording = _recording(rows)
    _emit(folder, plan, rows, report, recording, flown_by)
    return exit_codes.SAFETY if any(row.outcome == "aborted" for row in rows) else exit_codes.DONE


def demo_plan(drone: str, mocap: str, attempts: int, seed: int) -> "CampaignPlan":
    """The demo as a campaign: the first `attempts` of a shuffled grid."""
    from onboard.room import RoomGeometry
    from perchhw.campaign import CampaignPlan

    conditions = len(SPEEDS) * len(ANGLES_DEG)
    return CampaignPlan(
        name="demo",
        drone=drone,
        mocap=mocap,
        policy=DEFAULT_POLICY,
        vehicle=DEFAULT_VEHICLE,
        legs=None,
        seed=seed,
        order="shuffled",
        speeds=SPEEDS,
        angles_deg=ANGLES_DEG,
        repeats=-(-attempts // conditions),
        room=RoomGeometry(),
        approach={},
        aborted_in_a_row=3,
        attempts=attempts,
    )


def _recording(rows: "list[AttemptRow]") -> Path | None:
    """The last landing as a Rerun recording beside its record, when rerun-sdk is installed."""
    from importlib.util import find_spec

    from onboard.vehicle import load_vehicle
    from perchhw.view.rerun_recording import write_rrd

    landed = [row.record for row in rows if row.record is not None and row.triggered]
    if not landed or find_spec("rerun") is None:
        return None
    return write_rrd(landed[-1], load_vehicle(DEFAULT_VEHICLE), landed[-1] / "flight.rrd")


def _emit(
    folder: Path,
    plan: "CampaignPlan",
    rows: "list[AttemptRow]",
    report: Path,
    recording: Path | None,
    engine: EngineName,
) -> None:
    from onboard.policy.files import load_policy, policy_crc32, shipped_policy_path
    from perchhw.campaign.table import attempts_table

    document: dict[str, Any] = {
        "attempts": [
            {
                "speed": row.speed,
                "angle_deg": row.angle_deg,
                "triggered": bool(row.triggered),
                "outcome": None if row.outcome is None else row.outcome.value,
            }
            for row in rows
        ],
        "policy_crc32": policy_crc32(load_policy(shipped_policy_path(plan.policy))),
        "engine": engine.value,
        "run": str(folder),
        "report": str(report),
        "recording": None if recording is None else str(recording),
    }

    def draw() -> None:
        screen = console()
        screen.print(attempts_table(rows))
        screen.print(f"report:    {report}", markup=False, soft_wrap=True)
        if recording is not None:
            screen.print(f"recording: {recording}  (open with: rerun FILE)", markup=False, soft_wrap=True)

    emit(document, draw)
