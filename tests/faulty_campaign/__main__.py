"""A campaign on days when everything goes wrong: nothing is lost, nothing counted twice, all is told truly.

    python -m tests.faulty_campaign [--attempts 200] [--seed S] [--folder DIR]

Flies campaigns of 25 attempts in simulated labs in lock step, by ``perchhw campaign run --resume`` and in as
many shifts as it takes. In each, what is drawn goes wrong: faults of link, motion capture, battery, gyro,
motors; the flight program killed, interrupted or suspended, the drone stopped by others, the lab or its room
killed, a disk without room for more. Each flight is then held against the world's own record. The same
command goes on where it was stopped; where nothing was wrong its folder is removed. One JSON document at the
end; exit code 1 when something was wrong, but for labels: when so few would be right once in a hundred times
if 95 % were.
"""

import argparse
import json
import shutil
import sys
from collections import Counter
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from scipy.stats import binom

from onboard.json_file import write_json_atomically
from perchhw.campaign import CampaignStore
from perchhw.campaign.store import AttemptRow
from perchhw.consoles import progress_console
from tests.faulty_campaign.fly import fly_shift
from tests.faulty_campaign.judge import LABEL, Wrong, counted, judge
from tests.faulty_campaign.shift import draw_shift

TARGET, CHANCE = 0.95, 0.01
A_DAY = 25
"""Attempts of one campaign: each shift of it writes a report on all of them."""
JUDGED = "judged.json"
_MOST_SHIFTS = 5
"""An attempt, on average, before something is taken not to go on."""


def rows_of(day: Path) -> list[AttemptRow]:
    """What the campaign of `day` has flown."""
    if not CampaignStore.exists(day / "campaign"):
        return []
    with closing(CampaignStore.open(day / "campaign")) as store:
        return store.rows()


def shifts_of(day: Path) -> list[Path]:
    """The folders of its shifts."""
    return sorted((day / "shifts").iterdir()) if (day / "shifts").is_dir() else []


def judge_settled(day: Path, last_too: bool) -> None:
    """Judge the shifts whose last try the next run has settled."""
    shifts, rows = shifts_of(day), rows_of(day)
    for shift in shifts if last_too else shifts[:-1]:
        if not (shift / JUDGED).exists():
            judged = judge(shift, day / "campaign", rows)
            write_json_atomically(shift / JUDGED, asdict(judged))
            if not judged.wrong:
                (shift / "truth.csv").unlink()


def said_of(day: Path) -> list[dict[str, Any]]:
    """What was said of the shifts that are judged."""
    return [json.loads(file.read_text()) for s in shifts_of(day) if (file := s / JUDGED).exists()]


def days_of(folder: Path, attempts: int) -> list[tuple[Path, int]]:
    """The folder of each day, and how many attempts are flown in it."""
    starts = range(0, attempts, A_DAY)
    return [(folder / f"{start // A_DAY:02d}", min(A_DAY, attempts - start)) for start in starts]


def done_of(days: list[tuple[Path, int]]) -> int:
    """Attempts that are done."""
    return sum(row.state == "done" for day, _ in days for row in rows_of(day))


def fly(days: list[tuple[Path, int]], seed: int) -> None:
    """Fly what is left, with a bar."""
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=progress_console(),
    ) as bar:
        task = bar.add_task("attempts", total=sum(attempts for _, attempts in days), completed=done_of(days))
        for number, (day, attempts) in enumerate(days):
            while done_of([(day, attempts)]) < attempts and len(shifts_of(day)) < _MOST_SHIFTS * attempts:
                fly_shift(day, draw_shift((seed, number), len(shifts_of(day)), attempts), seed, attempts)
                judge_settled(day, last_too=False)
                wrong = sum(len(each["wrong"]) for one, _ in days for each in said_of(one))
                words = f"attempts, {wrong} wrong" if wrong else "attempts"
                bar.update(task, completed=done_of(days), description=words)
            judge_settled(day, last_too=True)


def document(days: list[tuple[Path, int]], seed: int) -> dict[str, Any]:
    """What came of it."""
    judged, rows = [], []
    wrong, told = [], []
    for day, attempts in days:
        judged += said_of(day)
        rows += rows_of(day)
        told += [json.loads((shift / "shift.json").read_text()) for shift in shifts_of(day)]
        wrong += counted(rows_of(day), day / "campaign", attempts)
    wrong += [Wrong(**one) for each in judged for one in each["wrong"]]
    labels = sum(each["labels"] for each in judged)
    return {
        "attempts": done_of(days),
        "tries": len(rows),
        "seed": seed,
        "shifts": len(told),
        "struck": Counter(blow["blow"] for each in told for blow in each["struck"]),
        "full_disks": sum(each["file_limit"] is not None for each in told),
        "outcomes": Counter(row.outcome or row.state for row in rows),
        "flights_the_world_saw": sum(each["flights"] for each in judged),
        "flights_in_a_late_lab": sum(each.get("late", 0) for each in judged),
        "reasons_judged": sum(each["reasons"] for each in judged),
        "aborts_whose_motors_were_watched": sum(each["aborts"] for each in judged),
        "labels_judged": labels,
        "labels_right": labels - sum(one.what == LABEL for one in wrong),
        "wrong": Counter(one.what for one in wrong),
        "wrongs": [asdict(one) for one in wrong],
    }


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="python -m tests.faulty_campaign", description=__doc__)
    parser.add_argument("--attempts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, help="default: runs/faulty-campaign-ATTEMPTS-SEED")
    asked = parser.parse_args()
    folder = asked.folder or Path("runs") / f"faulty-campaign-{asked.attempts}-{asked.seed}"
    days = days_of(folder, asked.attempts)
    fly(days, asked.seed)
    came = document(days, asked.seed)
    json.dump(came, sys.stdout, indent=1)
    sys.stdout.write("\n")
    if not came["wrongs"]:
        shutil.rmtree(folder)
    labels_do = binom.cdf(came["labels_right"], came["labels_judged"], TARGET) > CHANCE
    return 0 if labels_do and set(came["wrong"]) <= {LABEL} else 1


if __name__ == "__main__":
    sys.exit(main())
