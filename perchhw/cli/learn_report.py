"""``perchhw learn report``: the figures of a learning folder as one HTML page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.cli.output import emit

if TYPE_CHECKING:
    from perchhw.learning.grid import Condition


def report(
    folder: Annotated[Path, typer.Argument(help="Folder of perchhw learn, or of its leg study.")],
    reference: Annotated[
        Path | None,
        typer.Option(help="Table of landing rates to compare with: ours, or an authors' sweep."),
    ] = None,
    condition: Annotated[
        str | None, typer.Option(metavar="M/S,DEG", help="Approach of the examples, as 2.5,45.")
    ] = None,
    repeat: Annotated[int, typer.Option(min=0, help="Which trial of that condition to show.")] = 0,
    run: Annotated[
        Path | None, typer.Option(help="Run folder of a flown approach to show in place of a simulated one.")
    ] = None,
    pictures: Annotated[Path | None, typer.Option(help="Folder for the figures as PNG files, too.")] = None,
) -> None:
    """Draw what was learned into report.html of its folder: rates, trigger region, moments, convergence."""
    result = write_report(folder, reference, condition, repeat, run, pictures)
    emit(result, "\n".join([f"report {result['report']}", *(f"note: {doubt}" for doubt in result["doubts"])]))


def write_report(
    folder: Path,
    reference: Path | None = None,
    condition: str | None = None,
    repeat: int = 0,
    run: Path | None = None,
    pictures: Path | None = None,
) -> dict[str, Any]:
    """Write the report of a folder; what was written.

    Raises:
        LearningInputError: folder, reference or condition cannot be used.
        RunFolderError, UnusableFlightError: nor can the run.
    """
    from perchhw.learning.examples import make_examples
    from perchhw.learning.leg_results import is_leg_study, read_leg_study
    from perchhw.learning.results import read_reference, read_results
    from perchhw.report.learning_report import write_learning_report
    from perchhw.report.leg_report import write_leg_report

    if is_leg_study(folder):
        return {"report": str(write_leg_report(read_leg_study(folder), pictures)), "doubts": []}
    results = read_results(folder)
    wanted = None if condition is None else parse_condition(condition)
    compared = None if reference is None else read_reference(reference)
    examples = make_examples(results, wanted, repeat, run)
    path = write_learning_report(results, compared, examples, pictures)
    return {"report": str(path), "doubts": [*results.doubts, *examples.doubts]}


def parse_condition(text: str) -> "Condition":
    """Speed (m/s) and angle (deg) from ``2.5,45``.

    Raises:
        LearningInputError: the text is none, or no approach.
    """
    from perchhw.learning.errors import LearningInputError
    from perchhw.learning.grid import conditions

    try:
        speed, angle = (float(part) for part in text.split(","))
    except ValueError as error:
        raise LearningInputError(f"--condition {text!r}: give speed and angle, as 2.5,45") from error
    return conditions([speed], [angle])[0]
