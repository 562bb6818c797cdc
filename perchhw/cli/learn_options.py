"""Options and progress that the verbs of ``perchhw learn`` share."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from perchhw.attempt import AUTHORS_VEHICLE, DEFAULT_VEHICLE
from perchhw.consoles import progress_console
from perchhw.screen.long_work import share_done

if TYPE_CHECKING:
    from perchhw.learning.executor import Executor
    from perchhw.learning.setup import LearningSetup
    from perchhw.learning.sweep_folder import Row

OutOption = Annotated[Path, typer.Option(help="Folder for the results.")]
SeedOption = Annotated[int, typer.Option(min=0, help="Of everything random.")]


@dataclass(frozen=True)
class FlightOptions:
    """What flies in the simulation, whatever its legs."""

    vehicle: Annotated[str, typer.Option(help="Vehicle: a known name or a vehicle file.")] = DEFAULT_VEHICLE
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
        str,
        typer.Option(
            help="Errors of cues and approach: perfect (the paper), realistic, late, measured (in real "
            "flights), or gazebo, gazebo-later, gazebo-launch, gazebo-launch-later (the authors')."
        ),
    ] = "realistic"
    gains: Annotated[
        str, typer.Option(help="Of the controller: default, authors, or gazebo (that of their sweep).")
    ] = "default"
    seed: SeedOption = 0
    launch: Annotated[
        Path | None,
        typer.Option(help="landings.json of gap landings: approaches and flips scatter as on these flights."),
    ] = None

    def learning_setup(self, reward: str = "paper") -> "LearningSetup":
        """The setup of the rollouts; a validation has no use for the reward."""
        from perchhw.learning.launch_file import launch_of
        from perchhw.learning.setup import LearningSetup

        launch = () if self.launch is None else launch_of(self.launch)
        read = {"randomise": tuple(self.randomise or ()), "launch": launch}
        return LearningSetup(**{**asdict(self), **read}, reward=reward)


@dataclass(frozen=True)
class SetupOptions(FlightOptions):
    """What flies in the simulation."""

    legs: Annotated[str | None, typer.Option(help="Leg design; the vehicle's own without it.")] = None
    leg_angle_deg: Annotated[float | None, typer.Option(help="Another leg angle from -b_z, deg.")] = None
    leg_length_m: Annotated[float | None, typer.Option(help="Another leg length, m.")] = None


@dataclass(frozen=True)
class AuthorsOptions(SetupOptions):
    """What the authors' simulation did, unless it is told otherwise."""

    vehicle: Annotated[str, typer.Option(help="Vehicle: a known name or a vehicle file.")] = AUTHORS_VEHICLE
    sensing: Annotated[
        str,
        typer.Option(
            help="Errors of the cues: gazebo, gazebo-later, perfect, realistic or late; with their launch: "
            "gazebo-launch, gazebo-launch-later."
        ),
    ] = "gazebo"
    gains: Annotated[str, typer.Option(help="Of the controller: gazebo, authors, or default.")] = "gazebo"


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
    reward: Annotated[
        str, typer.Option(help="paper, flown (made the data of the flown policy), or later (NS, WS).")
    ] = "paper"
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the sweep in the folder.")] = False


@contextmanager
def progress_of(what: str, seed: int) -> "Iterator[Callable[[Row, int, int], None]]":
    """Shows how many rows there are, and a line for every row with rollouts that were not finite."""
    from perchhw.learning.sweep_folder import not_finite_report

    screen = progress_console()
    with share_done(what, screen) as tell:

        def show(row: "Row", done: int, total: int) -> None:
            tell(done, total)
            report = not_finite_report(row, seed)
            if report["rollouts"]:
                screen.print(f"not finite, counted as failures: {report}", markup=False)

        yield show
