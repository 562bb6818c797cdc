"""``perchhw demo``: from policy to labelled landings in a simulated lab, over the real protocols."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE, Outcome
from perchhw.cli import exit_codes
from perchhw.cli.engine_option import Engine
from perchhw.cli.output import emit
from perchhw.consoles import console, progress_console, say
from sim_backend.engine_name import EngineName, usable_engine

if TYPE_CHECKING:
    from perchhw.campaign import AttemptRow, CampaignPlan

app = typer.Typer(add_completion=False)

SPEEDS = (3.23, 3.25, 3.27)
ANGLES_DEG = (46.0, 46.5, 47.0)
"""Conditions of the demo: where the shipped policy is predicted to land best (:func:`predicted_rates`)."""

FOUR_LEGS = (Outcome.FOUR_LEG, Outcome.FOUR_LEG_BODY_CONTACT)

PREDICTIONS = 40
"""Simulated attempts behind a predicted rate: known to 0.06, in 2 s."""


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

    Beside each outcome stands how likely four legs were: a landing that fails is then one that the model said
    may fail. Exit codes say whether the attempts were flown, not how they ended: 0 every one was, 3 some were
    aborted by a safety rule.
    """
    from onboard.record.folder import require_writable
    from perchhw.cli.displayed_campaign import run_displayed
    from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
    from perchhw.record import new_run_folder
    from perchhw.report.campaign_report import PREDICTION_FILE, write_campaign_report
    from perchhw.screen.flight_display import flight_display

    require_writable(out)
    screen = progress_console()
    flown_by = usable_engine(engine)
    arguments = [*FREE_PORTS, *LOCKSTEP, "--seed", str(seed), "--engine", flown_by]
    screen.print("Starting the simulated lab (the first start compiles it, up to half a minute) ...")
    with SimulatedLab("lab", arguments) as lab:
        folder = new_run_folder(out, "demo")
        plan = demo_plan(lab.drones[0], lab.mocap[0], attempts, seed)
        with _told_what_is_kept(folder), flight_display("demo", plan.drone) as display:
            rows = run_displayed(plan, folder, display, yes=True)
    with _told_what_is_kept(folder):
        flown = {(row.speed, row.angle_deg) for row in rows}
        rates = predicted_rates(flown, seed, flown_by, folder / PREDICTION_FILE)
        report = write_campaign_report(folder)
    recording = _recording(rows)
    _emit(DemoResult(folder, plan, rows, rates, report, recording, flown_by))
    return exit_code(rows)


@contextmanager
def _told_what_is_kept(folder: Path) -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        say(progress_console(), f"what was flown is kept: perchhw campaign report {folder}")
        raise


def exit_code(rows: "Iterable[AttemptRow]") -> int:
    """Whether every attempt was flown: a landing that fails is none that was not."""
    return exit_codes.SAFETY if any(row.outcome is Outcome.ABORTED for row in rows) else exit_codes.DONE


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


def predicted_rates(
    conditions: Iterable[tuple[float, float]], seed: int, engine: EngineName, keep: Path | None = None
) -> dict[tuple[float, float], float]:
    """Probability of three or four legs of the shipped policy, by speed (m/s) and angle (deg).

    Of the lab's vehicle, with all that is on board in the loop; the body may touch or not. `keep` is the file
    in which the report looks for them.
    """
    from onboard.csv_file import write_csv
    from onboard.policy.files import load_policy, shipped_policy_path
    from perchhw.cli.learn_options import progress_of
    from perchhw.learning.as_flown import fly_policy
    from perchhw.learning.grid import Condition
    from perchhw.learning.setup import LearningSetup

    policy = load_policy(shipped_policy_path(DEFAULT_POLICY))
    grid = [Condition(speed, angle) for speed, angle in sorted(conditions)]
    setup = LearningSetup(vehicle=DEFAULT_VEHICLE, domain="none", seed=seed)
    with progress_of("what was to be expected", seed) as show:
        rows = fly_policy(policy, setup, grid, flights=PREDICTIONS, engine=engine, on_condition=show)
    if keep is not None:
        header = ("speed_m_s", "angle_deg", "landing_rate", "four_leg_rate")
        write_csv(keep, header, [[str(row[name]) for name in header] for row in rows])
    return {
        (condition.speed, condition.angle_deg): float(row["four_leg_rate"] or 0.0)
        for condition, row in zip(grid, rows, strict=True)
    }


def _recording(rows: "list[AttemptRow]") -> Path | None:
    """The last landing as a Rerun recording beside its record, when rerun-sdk is installed."""
    from importlib.util import find_spec

    from perchhw.view.show import write_rrd

    landed = [row.record for row in rows if row.record is not None and row.triggered]
    if not landed or find_spec("rerun") is None:
        return None
    return write_rrd(landed[-1], landed[-1] / "flight.rrd")


@dataclass(frozen=True)
class DemoResult:
    """What the demo has to tell.

    Attributes:
        folder: of the run. plan, rows: as flown. rates: predicted, by speed and angle.
        report: the page. recording: of the last landing, None without rerun-sdk.
        engine: which code the drone ran.
    """

    folder: Path
    plan: "CampaignPlan"
    rows: "list[AttemptRow]"
    rates: dict[tuple[float, float], float]
    report: Path
    recording: Path | None
    engine: EngineName

    def json_shape(self) -> dict[str, Any]:
        """The demo's document."""
        from onboard.policy.files import load_policy, policy_crc32, shipped_policy_path

        return {
            "attempts": [
                {
                    "speed": row.speed,
                    "angle_deg": row.angle_deg,
                    "triggered": bool(row.triggered),
                    "outcome": row.outcome,
                    "p_four": self.rates[row.speed, row.angle_deg],
                }
                for row in self.rows
            ],
            "policy_crc32": policy_crc32(load_policy(shipped_policy_path(self.plan.policy))),
            "engine": self.engine,
            "run": self.folder,
            "report": self.report,
            "recording": self.recording,
        }


def _emit(flown: DemoResult) -> None:
    from rich.table import Table

    from perchhw.campaign.table import progress

    def draw() -> None:
        screen, slots = console(), len({row.slot for row in flown.rows})
        table = Table("m/s", "deg", "outcome", "four legs expected", title=progress(flown.rows, slots))
        for row in flown.rows:
            outcome = row.state if row.outcome is None else row.outcome.value
            rate = flown.rates[row.speed, row.angle_deg]
            table.add_row(f"{row.speed:g}", f"{row.angle_deg:g}", outcome, f"{rate:.0%}")
        screen.print(table)
        expected = sum(flown.rates[row.speed, row.angle_deg] for row in flown.rows)
        landed = sum(row.outcome in FOUR_LEGS for row in flown.rows)
        screen.print(f"four legs: {landed}, expected {expected:.1f} of {len(flown.rows)}")
        screen.print(f"report:    {flown.report}", markup=False, soft_wrap=True)
        if flown.recording is not None:
            screen.print(
                f"recording: {flown.recording}  (open with: rerun FILE)", markup=False, soft_wrap=True
            )

    emit(flown, draw)
