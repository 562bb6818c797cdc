"""Options that the bench wizards share, and what they do with them."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from calibration.bench.instruments.schemes import MANUAL, SCALES, SUPPLIES, in_words
from onboard.errors import EndedByOperator
from perchhw.cli.output import emit
from perchhw.consoles import progress_console, say
from perchhw.operator_signals import ending_in_order

if TYPE_CHECKING:
    from calibration.bench.procedures.operator import Operator
    from calibration.bench.procedures.sessions import Concluded

Out = Annotated[Path | None, typer.Option(help="Folder of the run; a run that was paused goes on in it.")]
Drone = Annotated[str | None, typer.Option("--drone", help="URI of the drone: udp://HOST:PORT, radio://...")]
Supply = Annotated[
    str | None,
    typer.Option(
        "--supply",
        help=f"What feeds the drone: {in_words(SUPPLIES.values())}, or {MANUAL}:// for one that you set by "
        "hand.",
    ),
]
Scale = Annotated[
    str | None,
    typer.Option(
        "--scale",
        help=f"{in_words(SCALES.values())}, or {MANUAL}:// for one that you read and type.",
    ),
]
NoRemoteCut = Annotated[
    bool,
    typer.Option(
        "--no-remote-cut", help="On a battery, or a supply set by hand: nothing stops the motors if we die."
    ),
]
Person = Annotated[str, typer.Option("--operator", help="Who measures, for the report.")]


@dataclass(frozen=True)
class HelperOptions:
    """Who carries out a wizard."""

    hands: Annotated[
        str | None, typer.Option(help="tcp://HOST:PORT of an assistant that does what the wizard asks.")
    ] = None
    input: Annotated[
        Path | None, typer.Option(help='TOML file of answers: mass = "38.1 g", string_length = [...]')
    ] = None
    yes: Annotated[bool, typer.Option("--yes", help="Do not wait for a key after each task.")] = False


@dataclass(frozen=True)
class MotorHelperOptions(HelperOptions):
    """Who carries out a wizard in which motors turn."""

    confirm: Annotated[
        list[str] | None, typer.Option(help="Phrase of a safety question, confirmed in advance.")
    ] = None


@contextmanager
def operator_of(helper: HelperOptions) -> "Iterator[Operator]":
    """Whoever carries out the wizard: a person, or an assistant; with the answers given in advance before."""
    with ending_in_order():
        yield from _operator_of(helper)


def _operator_of(helper: HelperOptions) -> "Iterator[Operator]":
    from calibration.bench.procedures.assistant import Assistant
    from calibration.bench.procedures.prepared_answers import PreparedAnswers, read_answers
    from perchhw.cli.bench_operator import TerminalOperator

    answers = {} if helper.input is None else read_answers(helper.input)
    confirmed = tuple(helper.confirm or ()) if isinstance(helper, MotorHelperOptions) else ()
    if helper.hands is None:
        yield PreparedAnswers(answers, TerminalOperator(helper.yes, confirmed))
        return
    screen = progress_console()
    with Assistant(helper.hands, lambda text: screen.print(text, markup=False), confirmed) as assistant:
        yield PreparedAnswers(answers, assistant)


def tell(concluded: "Concluded", folder: Path, also: Mapping[str, str] | None = None) -> None:
    """Tell what came of a run; `also` has more words, by their key in the details."""
    calibration = concluded.calibration
    change = calibration.change
    document: dict[str, Any] = {
        "run": folder,
        "report": concluded.report,
        "id": calibration.id,
        "kind": calibration.kind,
        "vehicle": change,
        "findings": calibration.findings,
        "rejected": calibration.rejections,
        "compared": concluded.comparisons,
        **{key: calibration.details[key] for key in also or {}},
    }
    lines = [f"{key.removeprefix('effects.')}: {one}" for key, one in change.estimates.items()]
    if change.thrust_map is not None:
        lines.append(f"thrust map: {change.thrust_map[0]}")
    lines += [f"! {text}" for text in calibration.rejections]
    lines += [*(also or {}).values()]
    lines += [
        f"report: {concluded.report}",
        f"next: perchhw calibrate apply {folder} --vehicle FILE --out NEW.toml",
    ]
    emit(document, "\n".join(lines))


def needed(value: str | None, flag: str, what: str) -> str:
    """A flag that the wizard cannot do without.

    Raises:
        AnswerNotUsable: it was not given.
    """
    from calibration.bench.procedures.operator import AnswerNotUsable

    if value is None:
        raise AnswerNotUsable(f"{flag} is missing: {what} (in simulation `perchhw sim bench` prints it)")
    return value


@contextmanager
def run_folder(out: Path | None, kind: str) -> Iterator[Path]:
    """The folder of the run: as given, or a new one under ``runs``, which goes where nothing was kept."""
    from onboard.record.folder import discard_if_empty, make_folder, new_run_folder

    folder = new_run_folder(Path("runs"), f"calibrate-{kind}") if out is None else out
    make_folder(folder)
    try:
        with told_what_is_kept(folder):
            progress_console().print(
                f"run: {folder} (Ctrl-C pauses; --out {folder} goes on)", markup=False, soft_wrap=True
            )
            yield folder
    finally:
        if out is None:
            discard_if_empty(folder)


@contextmanager
def told_what_is_kept(folder: Path) -> Iterator[None]:
    """Who ends a run before its end is told what is kept in its folder, and how to go on."""
    try:
        yield
    except (EndedByOperator, KeyboardInterrupt):
        kept = folder.is_dir() and any(folder.iterdir())
        on = f"the steps that are done are kept: the same command with --out {folder} goes on"
        say(progress_console(), on if kept else "no step is done yet: the same command begins anew")
        raise
