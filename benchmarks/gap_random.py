"""Judge the gap finder by sets of flights drawn at random from several programs that share nothing with it.

    python benchmarks/gap_random.py --runs 10 --table FILE [--first N] [--truths house mujoco]
        [--crazyflow PYTHON]

Drawn are the laboratory (integrator, pilot, rates, noise, what the log lacks), the vehicle, how much is
flown, and what is hidden: nothing, one effect, two, or something without a name, weak to strong. Seeds
follow from the commit of the finder. Runs are appended to the table, one JSON document a line, and those that
it holds are not repeated; the summary of all goes to stdout. The third program, crazyflow, is a simulator
that others published: it flies in PYTHON, an interpreter that has it (docs/physics.md), and only where one is
given.
"""

import argparse
import itertools
import json
import math
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from drawn_sets import runs_of, seed_of_commit, share
from gap_judgement import closed_share, judge

from onboard.json_file import as_json

sys.path.insert(0, str(Path(__file__).parents[1]))

TRUTHS = ("house", "mujoco", "crazyflow")
Draw = Callable[[int, Path], tuple[list[Path], Any, dict[str, Any], float | None]]
"""From a seed and a folder to the logs of a set, vehicle, answer and height of its ceiling (m)."""

JUDGED = (
    "named",
    "ambiguous",
    "verdict",
    "expected_verdict",
    "first_right",
    "all_found",
    "false_names",
    "values",
)


def draw_house(seed: int, folder: Path) -> tuple[list[Path], Any, dict[str, Any], float | None]:
    """A case of `tests/truth/hidden_effects`: a Crazyflie at 100 Hz, 6 to 20 flights of 35 s."""
    from onboard.vehicle import load_vehicle
    from tests.truth.hidden_effects.campaign import VEHICLE, make_flights
    from tests.truth.hidden_effects.cases import SINGLE

    rng = np.random.default_rng([seed, 31])
    kind = rng.random()
    case = (
        "none" if kind < 0.2
        else str(rng.choice(SINGLE)) if kind < 0.65
        else "two" if kind < 0.85
        else str(rng.choice(("unlisted_force_region", "unlisted_torque_line")))
    )  # fmt: skip
    size = str(rng.choice(("weak", "medium", "strong")))
    answer = folder / "answer.json"
    files = make_flights(
        case, size, seed, int(rng.choice((6, 8, 12, 20))), out=folder / "flights", answer=answer
    )
    sealed = json.loads(answer.read_text())
    return files, load_vehicle(VEHICLE), {**sealed, "flights": len(files)}, 2.1


def draw_mujoco(seed: int, folder: Path) -> tuple[list[Path], Any, dict[str, Any], float | None]:
    """A set of `tests/truth/drawn.py`."""
    from tests.truth.drawn import draw_set

    drawn = draw_set(seed, folder)
    return drawn.files, drawn.vehicle, drawn.answer, None


def draw_crazyflow(
    room: Any, seed: int, folder: Path
) -> tuple[list[Path], Any, dict[str, Any], float | None]:
    """A set of `tests/truth/published.py`."""
    from tests.truth.published import draw_published_set

    drawn = draw_published_set(seed, folder, room)
    return drawn.files, drawn.vehicle, drawn.answer, None


def run(draws: dict[str, Draw], key: tuple[str, int]) -> dict[str, Any]:
    """One set: fly, find, compare."""
    from calibration.flights import open_flights
    from calibration.gap.data import prepare_flights
    from calibration.gap.find import GapQuestion, NothingToFindError, find_gap
    from calibration.gap.report.confidence import clearness
    from tests.truth.lost import VehicleLost

    truth, seed = key
    with tempfile.TemporaryDirectory() as folder:
        try:
            files, vehicle, answer, ceiling = draws[truth](seed, Path(folder))
        except VehicleLost as error:
            return {"program": truth, "seed": seed, "hidden": {}, "crash": None, "refused": str(error)}
        facts = {
            name: answer[name]
            for name in ("size", "flights", "hertz", "kilograms", "accelerometer", "voltage", "state_hz")
            if name in answer
        }
        row = {"program": truth, "seed": seed, **facts}
        started = time.process_time()
        read = open_flights(files)[0]
        try:
            found = find_gap(read, GapQuestion(vehicle=vehicle, seed=seed))
        except NothingToFindError as error:  # a hidden fault that keeps the vehicle on the floor
            return {**row, "hidden": _hidden(answer), "crash": None, "refused": str(error)}
        except Exception:  # noqa: BLE001 -- whatever it is: a crash is what this table counts
            return {**row, "hidden": _hidden(answer), "crash": traceback.format_exc()}
        report = as_json(found.report)
        clear = {one.name: round(clearness(one, vehicle), 1) for one in found.report.effects}
        judged = judge(report, answer)
        closed = closed_share(
            prepare_flights(read).records, report["flights"]["held_out"], found, vehicle, answer, ceiling
        )
    gap = report["gap"]
    return {
        **row,
        "cpu_s": round(time.process_time() - started, 1),
        "hidden": _hidden(answer),
        **{key: judged[key] for key in JUDGED},
        "cannot_be_judged": _beyond_the_flights(report["limitations"], judged["truth"]),
        "clearness": clear,
        "probability": {one.name: one.probability for one in found.report.effects},
        "closed": None if closed is None else round(closed, 3),
        "before_m": round(gap["before"], 4),
        "after_m": round(gap["after"], 4),
        "crash": None,
    }


def _beyond_the_flights(limitations: list[str], hidden: list[str]) -> list[str]:
    """Hidden effects of which the report says that these flights do not show them, and what to fly."""
    return [
        name for name in hidden if any(told.startswith(f"{name} cannot be judged") for told in limitations)
    ]


def _hidden(answer: dict[str, Any]) -> dict[str, Any]:
    """By name, with its parameters."""
    hidden = {effect["name"]: effect["parameters"] for effect in answer["effects"]}
    return hidden or ({"unlisted": answer["unlisted"]} if answer["unlisted"] else {})


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures that a sceptic asks for, with Wilson's intervals of 95 %, of each program and of all."""
    return {
        "all": _figures(runs),
        **{
            truth: _figures([one for one in runs if one["program"] == truth])
            for truth in TRUTHS
            if any(one["program"] == truth for one in runs)
        },
        "names_right_by_clearness": _by_clearness(runs),
    }


def _by_clearness(runs: list[dict[str, Any]]) -> dict[str, str]:
    """How many names of each clearness were right, as `calibration/gap/report/confidence.py` has counted."""
    from calibration.gap.report.confidence import COUNTED

    names = [
        (clear, name not in one["false_names"])
        for one in _ended(runs)
        for name, clear in one["clearness"].items()
    ]
    ends = [*(counted.least for counted in COUNTED), math.inf]
    return {
        f"{low} to {high} standard errors": share([right for clear, right in names if low <= clear < high])
        for low, high in itertools.pairwise(ends)
    }


def _ended(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those with a report."""
    return [one for one in runs if not one["crash"] and "refused" not in one]


def _figures(runs: list[dict[str, Any]]) -> dict[str, Any]:
    ended = _ended(runs)
    listed = [one for one in ended if one["hidden"] and "unlisted" not in one["hidden"]]
    clear = [one for one in listed if one["size"] != "weak"]
    none = [one for one in ended if not one["hidden"]]
    values = [pair["covered"] for one in listed for pair in one["values"] if pair["covered"] is not None]
    return {
        "sets": len(runs),
        "crashes": sum(bool(one["crash"]) for one in runs),
        "without_a_usable_flight": sum("refused" in one for one in runs),
        "first_name_right_medium_and_strong": share([one["first_right"] for one in clear]),
        "of_the_others_said_that_no_flight_shows_it": share(
            [bool(one.get("cannot_be_judged")) for one in clear if not one["first_right"]]
        ),
        "all_found_medium_and_strong": share([one["all_found"] for one in clear]),
        "first_name_right_weak": share([one["first_right"] for one in listed if one["size"] == "weak"]),
        "false_name_with_something_hidden": share([bool(one["false_names"]) for one in listed]),
        "nothing_hidden_nothing_claimed": share([one["verdict"] == "no_gap" for one in none]),
        "nothing_hidden_and_named": share([bool(one["named"]) for one in none]),
        "intervals_hold": share(values),
        "closed_90_percent": share([one["closed"] >= 0.9 for one in clear if one["closed"] is not None]),
        "unlisted_flagged": share(
            [one["verdict"] == "unexplained_gap" for one in ended if "unlisted" in one["hidden"]]
        ),
        "worse_than_before": share([one["after_m"] > one["before_m"] for one in ended]),
    }


def main() -> None:
    """Parse, run what the table lacks, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=10, help="of each program")
    parser.add_argument("--first", type=int, help="first seed; default: from the commit")
    parser.add_argument("--truths", nargs="+", choices=TRUTHS, help="default: all that can fly here")
    parser.add_argument("--crazyflow", metavar="PYTHON", help="interpreter that has crazyflow")
    parser.add_argument("--table", type=Path, required=True)
    asked = parser.parse_args()
    first = seed_of_commit() if asked.first is None else asked.first
    truths = asked.truths or [truth for truth in TRUTHS if asked.crazyflow or truth != "crazyflow"]
    if "crazyflow" in truths and asked.crazyflow is None:
        parser.error("crazyflow flies in an interpreter that has it: give --crazyflow PYTHON")
    keys = [(truth, seed) for seed in range(first, first + asked.runs) for truth in truths]
    draws: dict[str, Draw] = {"house": draw_house, "mujoco": draw_mujoco}
    with ExitStack() as rooms:
        if "crazyflow" in truths:
            from tests.truth.published import PublishedRoom

            draws["crazyflow"] = partial(draw_crazyflow, rooms.enter_context(PublishedRoom(asked.crazyflow)))
        runs = runs_of(asked.table, keys, lambda one: (one["program"], one["seed"]), partial(run, draws))
    print(json.dumps(summary(runs), indent=1))


if __name__ == "__main__":
    main()
