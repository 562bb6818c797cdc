"""``perchhw learn``: sweep, train, validate, or all three."""

import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.cli.learn_report import report, write_report
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.output import console, emit, progress_console
from perchhw.learning.sweep_folder import POLICY_FILE, TRAINING_FILE, VALIDATION_FILE, VALIDATION_SUMMARY

if TYPE_CHECKING:
    from rich.progress import Progress

    from onboard.policy.files import Policy
    from perchhw.learning.executor import Executor
    from perchhw.learning.setup import LearningSetup
    from perchhw.learning.sweep_folder import Row

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Learn a landing policy in simulation.")
app.command()(report)

OutOption = Annotated[Path, typer.Option(help="Folder for the results.")]
SeedOption = Annotated[int, typer.Option(min=0, help="Of everything random.")]
RolloutsOption = Annotated[int, typer.Option(min=1, help="Attempts at each condition of the validation.")]

_OUT = Path("runs/learn")


@dataclass(frozen=True)
class SetupOptions:
    """What flies in the simulation."""

    vehicle: Annotated[str, typer.Option(help="Vehicle: a known name or a vehicle file.")] = DEFAULT_VEHICLE
    legs: Annotated[str | None, typer.Option(help="Leg design; the vehicle's own without it.")] = None
    leg_angle_deg: Annotated[float | None, typer.Option(help="Another leg angle from -b_z, deg.")] = None
    leg_length_m: Annotated[float | None, typer.Option(help="Another leg length, m.")] = None
    domain: Annotated[
        str, typer.Option(help="Domain randomisation: paper, none, or vehicle (all of its sigmas).")
    ] = "paper"
    randomise: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=SIGMA]",
            help="Draw this quantity of the vehicle file too, as legs.stiffness; repeat for more.",
        ),
    ] = None
    sensing: Annotated[
        str, typer.Option(help="Errors of the cues: perfect (the paper), realistic or late.")
    ] = "perfect"
    seed: SeedOption = 0

    def learning_setup(self, reward: str = "paper") -> "LearningSetup":
        """The setup of the rollouts; a validation has no use for the reward."""
        from perchhw.learning.setup import LearningSetup

        return LearningSetup(**{**asdict(self), "randomise": tuple(self.randomise or ())}, reward=reward)


@dataclass(frozen=True)
class GridOptions:
    """Which approaches are flown, and by whom; the paper's grid (section III.C) without a choice."""

    speeds: Annotated[str, typer.Option(help="m/s, FIRST:LAST:STEP or A,B,C.")] = "1.5:3.5:0.1"
    angles: Annotated[str, typer.Option(help="deg above the horizon, FIRST:LAST:STEP or A,B,C.")] = (
        "30:90:3.75"
    )
    workers: Annotated[int, typer.Option(min=0, help="Threads, 0: one a core; the result is the same.")] = 0
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="Work on this Dask cluster instead; same result."),
    ] = None

    def ranges(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Speeds (m/s) and angles (deg).

        Raises:
            LearningInputError: an option is not a range.
        """
        from perchhw.learning.grid import parse_range

        return parse_range(self.speeds, "--speeds"), parse_range(self.angles, "--angles")

    def executor(self) -> "AbstractContextManager[Executor]":
        """Who flies them."""
        from perchhw.learning.executor import open_executor

        return open_executor(self.workers, self.scheduler)


@dataclass(frozen=True)
class SweepOptions:
    """How a sweep learns."""

    repeats: Annotated[int, typer.Option(help="Learning trials at each condition.")] = 3
    reward: Annotated[str, typer.Option(help="paper, or flown (made the data of the flown policy).")] = (
        "paper"
    )
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the sweep in the folder.")] = False


@app.command()
@with_option_groups
def sweep(setup: SetupOptions, grid: GridOptions, learning: SweepOptions, out: OutOption = _OUT) -> None:
    """Learn a sensory-motor pair for every approach condition."""
    result = _sweep(setup, grid, learning, out)
    emit(result, lambda: _draw_rates("best landing rate per condition", result["bands"]))


@app.command()
def train(
    out: OutOption = _OUT,
    pairs: Annotated[Path | None, typer.Option(help="Table of pairs; default: pairs.csv in --out.")] = None,
    landing_rate_min: Annotated[float, typer.Option(help="Pairs below are left out.")] = 0.8,
    name: Annotated[str, typer.Option(help="Name of the policy.")] = "trained",
    seed: SeedOption = 0,
) -> None:
    """Train the trigger and the action policy on the pairs of a sweep."""
    result = _train(out, pairs, landing_rate_min, name, seed)
    emit(result, _training_text(result))


@app.command()
@with_option_groups
def validate(
    setup: SetupOptions,
    grid: GridOptions,
    policy: Annotated[str | None, typer.Option(help="Policy; default: the trained one in --out.")] = None,
    rollouts: RolloutsOption = 18,
    out: OutOption = _OUT,
) -> None:
    """Fly the two-stage policy at every condition of a grid."""
    result = _validate(setup, grid, policy, rollouts, out)
    emit(result, lambda: _draw_rates("landing rate of the two-stage policy", result["bands"]))


@app.command("all")
@with_option_groups
def everything(
    setup: SetupOptions,
    grid: GridOptions,
    learning: SweepOptions,
    rollouts: RolloutsOption = 18,
    out: OutOption = _OUT,
) -> None:
    """Sweep, train, validate, and write the report."""
    swept = _sweep(setup, grid, learning, out)
    trained = _train(out, None, 0.8, "trained", setup.seed)
    validated = _validate(setup, grid, None, rollouts, out)
    reported = write_report(out)

    def draw() -> None:
        _draw_rates("best landing rate per condition", swept["bands"])
        console().print(_training_text(trained), markup=False)
        _draw_rates("landing rate of the two-stage policy", validated["bands"])
        console().print(f"report {reported['report']}", markup=False)

    emit({"sweep": swept, "training": trained, "validation": validated, **reported}, draw)


def _progress() -> "Progress":
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=progress_console(),
    )


@contextmanager
def _shown(what: str, seed: int) -> "Iterator[Callable[[Row, int, int], None]]":
    """Shows rows as they come: a bar, and a line for every row with rollouts that were not finite."""
    from perchhw.learning.sweep_folder import not_finite_report

    with _progress() as progress:
        task = progress.add_task(what, total=None)

        def show(row: "Row", done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)
            report = not_finite_report(row, seed)
            if report["rollouts"]:
                progress.console.print(f"not finite, counted as failures: {report}", markup=False)

        yield show


def _sweep(setup: SetupOptions, grid: GridOptions, learning: SweepOptions, out: Path) -> dict[str, Any]:
    from perchhw.learning.bands import band_table, best_per_condition
    from perchhw.learning.sweep import SweepGrid, run_sweep
    from perchhw.learning.sweep_folder import SWEEP_FILE, read_settings

    trials = SweepGrid(*grid.ranges(), learning.repeats)
    with grid.executor() as executor, _shown("learning trials", setup.seed) as show:
        summary = run_sweep(
            setup.learning_setup(learning.reward),
            trials,
            out,
            executor=executor,
            resume=learning.resume,
            on_trial=show,
        )
    return {
        "folder": str(out),
        **read_settings(out / SWEEP_FILE)["result"],
        "new_trials": summary.new_trials,
        "bands": band_table(best_per_condition(summary.rows)),
    }


def _train(out: Path, pairs: Path | None, landing_rate_min: float, name: str, seed: int) -> dict[str, Any]:
    from dataclasses import replace

    from onboard.policy.files import policy_crc32, save_policy
    from perchhw.learning.sweep_folder import (
        PAIRS_FILE,
        SWEEP_FILE,
        make_folder,
        read_settings,
        write_file,
    )
    from perchhw.learning.train import train_policy
    from perchhw.learning.training_set import load_training_set

    table = pairs or out / PAIRS_FILE
    training_set = load_training_set(table, landing_rate_min=landing_rate_min)
    make_folder(out)
    policy = train_policy(training_set, name=name, seed=seed).policy
    swept = table.parent / SWEEP_FILE
    if swept.is_file():
        document = read_settings(swept)
        kept = {key: document[key] for key in ("settings", "versions", "result") if key in document}
        policy = replace(policy, provenance={**policy.provenance, "sweep": kept})
    save_policy(policy, out / POLICY_FILE)
    result = {
        "policy": str(out / POLICY_FILE),
        "crc32": policy_crc32(policy),
        "pairs": len(training_set.a_rot),
        "support_vectors": len(policy.dual_coefficients),
        "inside_share": policy.provenance["inside_share"],
        "action_rms_nm": policy.provenance["train_rms_nm"],
        "action_held_out_rms_nm": policy.provenance["held_out_rms_nm"],
    }
    write_file(out / TRAINING_FILE, json.dumps(result, indent=1) + "\n")
    return result


def _training_text(result: dict[str, Any]) -> str:
    return (
        f"{result['pairs']} pairs, {result['support_vectors']} support vectors, "
        f"{100 * result['inside_share']:.0f} % of the pairs inside the trigger region; "
        f"moment within {1e3 * result['action_rms_nm']:.2f} N mm RMS "
        f"({1e3 * result['action_held_out_rms_nm']:.2f} on pairs held out)\n"
        f"policy {result['policy']}, crc32 0x{result['crc32']:08x}"
    )


def _load_policy(name_or_path: str | None, out: Path) -> "Policy":
    from onboard.policy.files import find_policy, load_policy

    return load_policy(find_policy(name_or_path if name_or_path is not None else str(out / POLICY_FILE)))


def _validate(
    setup: SetupOptions, grid: GridOptions, policy: str | None, rollouts: int, out: Path
) -> dict[str, Any]:
    from onboard.policy.files import policy_crc32
    from perchhw.learning.bands import band_table, best_per_condition
    from perchhw.learning.grid import conditions
    from perchhw.learning.sweep_folder import make_folder, not_finite_report, write_file
    from perchhw.learning.validate import validate_policy, write_validation

    loaded = _load_policy(policy, out)
    approaches = conditions(*grid.ranges())
    flown_by = setup.learning_setup()
    make_folder(out)
    with grid.executor() as executor, _shown("validation", setup.seed) as show:
        rows = validate_policy(
            loaded, flown_by, approaches, rollouts=rollouts, executor=executor, on_condition=show
        )
    write_validation(rows, out / VALIDATION_FILE)
    result = {
        "policy_crc32": policy_crc32(loaded),
        "settings": flown_by.describe(),
        "table": str(out / VALIDATION_FILE),
        "conditions": len(rows),
        "rollouts_per_condition": rollouts,
        "trigger_rate": sum(float(row["trigger_rate"] or 0) for row in rows) / len(rows),
        "not_finite_rollouts": [
            not_finite_report(row, setup.seed) for row in rows if row["not_finite_rollouts"]
        ],
        "bands": band_table(best_per_condition(rows)),
    }
    write_file(out / VALIDATION_SUMMARY, json.dumps(result, indent=1) + "\n")
    return result


def _draw_rates(title: str, bands: list[dict[str, Any]]) -> None:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for heading in ("approach angle", "speed", "four legs, no contact", "conditions"):
        table.add_column(heading)
    for band in bands:
        table.add_row(band["angles"], band["speeds"], f"{band['rate']:.2f}", str(band["conditions"]))
    console().print(table)
