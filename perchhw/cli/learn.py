"""``perchhw learn``: sweep, train, validate, or all three, and the leg study."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.cli.learn_agreement import agreement
from perchhw.cli.learn_hinge import hinge
from perchhw.cli.learn_legs import legs
from perchhw.cli.learn_options import (
    GridOptions,
    OutOption,
    SeedOption,
    SetupOptions,
    SweepOptions,
    progress_of,
)
from perchhw.cli.learn_report import report, write_report
from perchhw.cli.learn_surface import surface
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.output import emit
from perchhw.consoles import console, progress_console
from perchhw.learning.sweep_folder import (
    AS_FLOWN_FILE,
    MEASURED_FILE,
    POLICY_FILE,
    TRAINING_FILE,
    VALIDATION_FILE,
    VALIDATION_SUMMARY,
)
from perchhw.screen.long_work import share_done

if TYPE_CHECKING:
    from onboard.policy.files import Policy
    from perchhw.learning.grid import Condition
    from perchhw.learning.setup import LearningSetup
    from perchhw.learning.sweep_folder import Row

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Learn a landing policy in simulation.")
app.command()(report)
app.command()(legs)
app.command()(hinge)
app.command()(agreement)
app.command()(surface)

RefineOption = Annotated[
    bool,
    typer.Option(help="Train the action anew where the trigger fires (needs sweep.json beside the pairs)."),
]
RolloutsOption = Annotated[int, typer.Option(min=1, help="Attempts at each condition of the validation.")]

_OUT = Path("runs/learn")


@dataclass(frozen=True)
class _Chosen:
    """Which pairs train a policy: :func:`perchhw.learning.training_set.load_training_set`."""

    landing_rate_min: float = 0.8
    share_of_best: float = 0.0


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
    share_of_best: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="So are pairs below this share of the best at their condition."),
    ] = 0.0,
    name: Annotated[str, typer.Option(help="Name of the policy.")] = "trained",
    seed: SeedOption = 0,
    refine: RefineOption = False,
) -> None:
    """Train the trigger and the action policy on the pairs of a sweep."""
    chosen = _Chosen(landing_rate_min, share_of_best)
    result = _train(out, pairs, chosen, name, seed, GridOptions() if refine else None)
    emit(result, _training_text(result))


@app.command()
@with_option_groups
def validate(
    setup: SetupOptions,
    grid: GridOptions,
    policy: Annotated[str | None, typer.Option(help="Policy; default: the trained one in --out.")] = None,
    rollouts: RolloutsOption = 18,
    out: OutOption = _OUT,
    landings: Annotated[
        Path | None,
        typer.Option(
            help="landings.json of gap landings on your flights: how they scatter, how wrong the model is."
        ),
    ] = None,
    as_flown: Annotated[
        int,
        typer.Option(
            min=0,
            help="Also so many attempts at each condition with estimator, law, motors and battery in the "
            "loop, from the hover on, as in the simulated lab.",
        ),
    ] = 0,
) -> None:
    """Fly the two-stage policy at every condition of a grid, first as real approaches scatter."""
    result = _validate(setup, grid, policy, rollouts, out, landings, as_flown)
    emit(result, lambda: _draw_validation(result))


@app.command("all")
@with_option_groups
def everything(
    setup: SetupOptions,
    grid: GridOptions,
    learning: SweepOptions,
    rollouts: RolloutsOption = 18,
    out: OutOption = _OUT,
    refine: RefineOption = True,
) -> None:
    """Sweep, train, validate, and write the report."""
    swept = _sweep(setup, grid, learning, out)
    trained = _train(out, None, _Chosen(), "trained", setup.seed, grid if refine else None)
    validated = _validate(setup, grid, None, rollouts, out)
    reported = write_report(out)

    def draw() -> None:
        _draw_rates("best landing rate per condition", swept["bands"])
        console().print(_training_text(trained), markup=False)
        _draw_validation(validated)
        console().print(f"report {reported['report']}", markup=False)

    emit({"sweep": swept, "training": trained, "validation": validated, **reported}, draw)


def _sweep(setup: SetupOptions, grid: GridOptions, learning: SweepOptions, out: Path) -> dict[str, Any]:
    from perchhw.learning.bands import band_table, best_per_condition
    from perchhw.learning.sweep import SweepGrid, run_sweep
    from perchhw.learning.sweep_folder import SWEEP_FILE, read_settings

    trials = SweepGrid(*grid.ranges(), learning.repeats)
    try:
        with grid.executor() as executor, progress_of("learning trials", setup.seed) as show:
            summary = run_sweep(
                setup.learning_setup(learning.reward),
                trials,
                out,
                executor=executor,
                resume=learning.resume,
                on_trial=show,
            )
    except KeyboardInterrupt:
        progress_console().print(
            f"interrupted: {out} keeps what is learned; go on with --resume", markup=False
        )
        raise
    return {
        "folder": str(out),
        **read_settings(out / SWEEP_FILE)["result"],
        "new_trials": summary.new_trials,
        "bands": band_table(best_per_condition(summary.rows)),
    }


def _train(
    out: Path,
    pairs: Path | None,
    chosen: _Chosen,
    name: str,
    seed: int,
    refining: GridOptions | None,
) -> dict[str, Any]:
    from dataclasses import replace

    from onboard.policy.files import policy_crc32, save_policy
    from perchhw.learning.setup import trained_on
    from perchhw.learning.sweep_folder import (
        PAIRS_FILE,
        SWEEP_FILE,
        make_folder,
        read_settings,
        write_document,
    )
    from perchhw.learning.train import train_policy
    from perchhw.learning.training_set import load_training_set
    from perchhw.trained_for import TRAINED_FOR

    table = pairs or out / PAIRS_FILE
    training_set = load_training_set(
        table, landing_rate_min=chosen.landing_rate_min, share_of_best=chosen.share_of_best
    )
    swept = table.parent / SWEEP_FILE
    document = read_settings(swept) if swept.is_file() else None
    make_folder(out)
    policy = train_policy(training_set, name=name, seed=seed).policy
    if document is not None:
        kept = {key: document[key] for key in ("settings", "versions", "result") if key in document}
        policy = replace(policy, provenance={**policy.provenance, "sweep": kept})
        trained = trained_on(document["settings"])
        if trained is not None:
            policy = replace(policy, provenance={**policy.provenance, TRAINED_FOR: trained.document()})
    if refining is not None:
        policy = _refined(policy, table.parent, refining)
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
    write_document(out / TRAINING_FILE, result)
    return result


def _refined(policy: "Policy", swept: Path, refining: GridOptions) -> "Policy":
    """The policy with its action trained anew on the conditions of the sweep in that folder."""
    from perchhw.learning.grid import Condition
    from perchhw.learning.refine import refine_action
    from perchhw.learning.setup import recorded_setup
    from perchhw.learning.sweep_folder import PAIRS_FILE, SWEEP_FILE, read_pairs, read_settings

    settings = read_settings(swept / SWEEP_FILE)["settings"]
    grid = sorted({Condition(speed, angle) for speed, angle, _ in read_pairs(swept / PAIRS_FILE)})
    with refining.executor() as executor, share_done("refinement") as show:
        return refine_action(
            policy, recorded_setup(settings, str(swept)), grid, executor=executor, on_condition=show
        )


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
    setup: SetupOptions,
    grid: GridOptions,
    policy: str | None,
    rollouts: int,
    out: Path,
    landings: Path | None = None,
    flights: int = 0,
) -> dict[str, Any]:
    from dataclasses import replace

    from onboard.policy.files import policy_crc32
    from perchhw.learning.grid import conditions
    from perchhw.learning.judged_range import inside_judged_range
    from perchhw.learning.launch_file import launch_of
    from perchhw.learning.real_rate import AUTHORS_ERROR, known_error, real_rate
    from perchhw.learning.setup import MEASURED
    from perchhw.learning.sweep_folder import make_folder, not_finite_report, write_document
    from perchhw.learning.validate import validate_policy, write_validation

    loaded = _load_policy(policy, out)
    approaches = conditions(*grid.ranges())
    flown_by = setup.learning_setup()
    error = known_error(flown_by, landings)
    make_folder(out)

    def flown(world: "LearningSetup", what: str) -> "tuple[Row, ...]":
        with grid.executor() as executor, progress_of(what, setup.seed) as show:
            return validate_policy(
                loaded, world, approaches, rollouts=rollouts, executor=executor, on_condition=show
            )

    as_flown = replace(flown_by, sensing=MEASURED)
    if landings is not None:
        as_flown = replace(as_flown, launch=launch_of(landings))
    measured = flown(as_flown, "validation, measured")
    rows = measured if as_flown == flown_by else flown(flown_by, f"validation, {flown_by.sensing}")
    write_validation(measured, out / MEASURED_FILE)
    write_validation(rows, out / VALIDATION_FILE)
    expected = None if error is None else real_rate(measured, error, setup.seed)
    result = {
        "policy_crc32": policy_crc32(loaded),
        "settings": flown_by.describe(),
        "measured": {"table": str(out / MEASURED_FILE), **_summary(measured)},
        "real_rate": expected,
        "inside_judged_range": inside_judged_range(approaches) if error == AUTHORS_ERROR else None,
        "as_flown": _fly(loaded, flown_by, approaches, flights, out) if flights else None,
        "table": str(out / VALIDATION_FILE),
        "conditions": len(rows),
        "rollouts_per_condition": rollouts,
        "not_finite_rollouts": [
            not_finite_report(row, setup.seed) for row in rows if row["not_finite_rollouts"]
        ],
        **_summary(rows),
    }
    write_document(out / VALIDATION_SUMMARY, result)
    return result


def _fly(
    policy: "Policy", setup: "LearningSetup", approaches: "tuple[Condition, ...]", flights: int, out: Path
) -> dict[str, Any]:
    """The same policy with all that is on board in the loop, where an approach fits the room."""
    from perchhw.learning.as_flown import fly_policy, flyable
    from perchhw.learning.errors import LearningInputError
    from perchhw.learning.validate import write_validation
    from sim_backend.engine_name import usable_engine

    fit = flyable(approaches, setup.ceiling_z)
    if not fit:
        raise LearningInputError(
            f"--as-flown: no approach of this grid fits a room of {setup.ceiling_z:g} m; "
            "perchhw campaign plan says which would"
        )
    with progress_of("validation, as flown", setup.seed) as show:
        rows = fly_policy(policy, setup, fit, flights=flights, engine=usable_engine(None), on_condition=show)
    write_validation(rows, out / AS_FLOWN_FILE)
    return {
        "table": str(out / AS_FLOWN_FILE),
        "conditions": len(rows),
        "attempts_per_condition": flights,
        **_summary(rows),
    }


def _summary(rows: "tuple[Row, ...]") -> dict[str, Any]:
    """Means over the conditions, and the bands of clean landings."""
    from perchhw.learning.bands import band_table, best_per_condition

    means = {
        name: sum(float(row[name] or 0.0) for row in rows) / len(rows)
        for name in ("trigger_rate", "four_leg_rate", "two_leg_rate")
    }
    return {**means, "bands": band_table(best_per_condition(rows))}


def _draw_validation(result: dict[str, Any]) -> None:
    """The world as real flights show it first, then the one that was asked for."""
    from perchhw.learning.judged_range import judged_range_in_words
    from perchhw.learning.results import cues_in_words
    from perchhw.learning.setup import MEASURED

    settings = result["settings"]
    worlds = [
        ("as real approaches scatter", result["measured"]),
        (f"with {cues_in_words(settings)}", result),
    ]
    if settings["sensing"] == MEASURED:
        del worlds[1]
    if (whole := result["as_flown"]) is not None:
        fit = f"{whole['conditions']} of {result['conditions']} conditions fit the room"
        worlds.append((f"with all that is on board ({fit})", whole))
    for name, found in worlds:
        _draw_rates(f"landing rate of the two-stage policy, {name}", found["bands"])
        console().print(f"any four legs {found['four_leg_rate']:.2f}, two legs {found['two_leg_rate']:.2f}")
    expected = result["real_rate"]
    if expected is None:
        console().print(
            "no real flights tell what this vehicle does of that: perchhw gap landings, --landings"
        )
        return
    (low, high), (least, most) = expected.ci95, expected.four_leg_count80
    console().print(
        f"to be expected in reality, any four legs: {expected.four_leg_rate:.2f} "
        f"({low:.2f} to {high:.2f}); of {expected.next_flights} flights {least} to {most} (80 %)",
        soft_wrap=True,
    )
    if (inside := result["inside_judged_range"]) is not None:
        console().print(judged_range_in_words(inside), soft_wrap=True)


def _draw_rates(title: str, bands: list[dict[str, Any]]) -> None:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for heading in ("approach angle", "speed", "four legs, no contact", "conditions"):
        table.add_column(heading)
    for band in bands:
        table.add_row(band["angles"], band["speeds"], f"{band['rate']:.2f}", str(band["conditions"]))
    console().print(table)
