"""``perchhw learn legs``: the leg designs against each other."""

from pathlib import Path
from typing import Annotated, Any

import typer

from perchhw.cli.learn_options import FlightOptions, GridOptions, OutOption, SweepOptions, progress_of
from perchhw.cli.learn_report import write_report
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.output import emit
from perchhw.consoles import console

_OUT = Path("runs/legs")


@with_option_groups
def legs(
    setup: FlightOptions,
    grid: GridOptions,
    learning: SweepOptions,
    designs: Annotated[str, typer.Option(help="Leg designs, A,B,C; all without it.")] = "",
    rollouts: Annotated[int, typer.Option(help="Fresh landings of each pair, for the factors.")] = 6,
    out: OutOption = _OUT,
) -> None:
    """Compare leg designs: landing rates, what decides the landings, the trends of the paper."""
    result = _study(setup, grid, learning, designs, rollouts, out)
    emit(result, lambda: _draw(result))


def _study(
    setup: FlightOptions, grid: GridOptions, learning: SweepOptions, designs: str, rollouts: int, out: Path
) -> dict[str, Any]:
    from onboard.vehicle import known_leg_designs
    from perchhw.learning.leg_results import LANDINGS_FILE, STUDY_FILE
    from perchhw.learning.leg_study import run_leg_study
    from perchhw.learning.sweep import SweepGrid

    chosen = tuple(designs.split(",")) if designs else known_leg_designs()
    trials = SweepGrid(*grid.ranges(), learning.repeats)
    with grid.executor() as executor:
        study = run_leg_study(
            setup.learning_setup(learning.reward),
            chosen,
            trials,
            out,
            rollouts=rollouts,
            executor=executor,
            resume=learning.resume,
            on_design=lambda design: progress_of(design, setup.seed),
        )
    written = {"study": str(out / STUDY_FILE), "landings": str(out / LANDINGS_FILE), **write_report(out)}
    return {**written, **study.document}


def _draw(result: dict[str, Any]) -> None:
    _draw_designs(result["designs"])
    _draw_trends(result["trends"])
    console().print(f"report {result['report']}", markup=False)


def _draw_designs(designs: dict[str, Any]) -> None:
    from rich.table import Table

    table = Table(title="landing rate: four legs, no contact", title_justify="left")
    for heading in ("approach angle", "speed", *designs):
        table.add_column(heading)
    columns = list(designs.values())
    for index, band in enumerate(columns[0]["bands"]):
        rates = [f"{design['bands'][index]['landing_rate']:.2f}" for design in columns]
        table.add_row(*_band_name(band), *rates)
    table.add_row("all", "all", *(f"{design['landing_rate']:.2f}" for design in columns), end_section=True)
    table.add_row(
        "impact window", "", *(f"from {design['impact_window_deg'][0]:.0f} deg" for design in columns)
    )
    console().print(table)


def _band_name(band: dict[str, Any]) -> tuple[str, str]:
    (low, high), (slowest, limit) = band["angles_deg"], band["speeds_m_s"]
    return f"{low:g}-{high:g} deg", f">= {slowest:g} m/s" if limit is None else f"< {limit:g} m/s"


def _draw_trends(trends: dict[str, Any]) -> None:
    from rich.table import Table

    table = Table(title="what the paper says", title_justify="left")
    for heading in ("trend", "holds", "numbers (positive: as the paper says)"):
        table.add_column(heading)
    for trend in trends.values():
        numbers = "\n".join(f"{value:+.2f}  {name}" for name, value in trend["numbers"].items())
        table.add_row(trend["says"], "yes" if trend["holds"] else "not all", numbers)
    console().print(table)
