"""The walk-through, step by step; a step that is done is not done again."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from onboard.json_file import write_json_atomically
from perchhw.attempt import DEFAULT_POLICY
from perchhw.walkthrough.bench.measure import against_truth, measure_on_bench
from perchhw.walkthrough.bench.story import (
    BELIEVED,
    LANDING_ANGLES,
    LANDING_SPEEDS,
    TEST_FLIGHTS,
    true_vehicle,
    write_true,
)
from perchhw.walkthrough.flights import WalkthroughDrone, fly_landings, fly_tests
from perchhw.walkthrough.rates import learn_again
from perchhw.walkthrough.steps import step
from perchhw.walkthrough.tracking import tracking_errors

SUMMARY_FILE = "walkthrough.json"


@dataclass(frozen=True)
class BenchWalkthrough:
    """What came of it.

    Attributes:
        measured: what the bench said beside the truth, a row a quantity.
        tracking_m: RMS distance (m) from the course by kind of flight, ``before`` and ``after``.
        landings_in_the_lab: campaigns ``before`` and ``after``.
        vehicle: the calibrated file.
        folder: of everything.
    """

    measured: list[dict[str, Any]]
    tracking_m: dict[str, dict[str, float]]
    landings_in_the_lab: dict[str, dict[str, Any]]
    vehicle: str
    folder: Path


def run_bench_walkthrough(
    out: Path, seed: int, say: Callable[[str], None] = lambda text: None
) -> BenchWalkthrough:
    """Fly a drone that is not as its file says, measure it, flash and learn with the new file, fly again.

    Args:
        out: folder; what an earlier call finished is kept.
        seed: of bench, lab and learning.
        say: told what begins.

    Raises:
        PerchhwError: a step could not be done; the message says which and why.
    """
    true = write_true(out / "0-true")
    say("1  flights with the file as it is")
    before = WalkthroughDrone(true, BELIEVED, seed, flashed=BELIEVED)
    flown = step(out / "1-before", lambda folder: _fly(folder, before, DEFAULT_POLICY))
    say("2  on the bench: inertia, motors, thrust")
    bench = step(out / "2-bench", lambda folder: measure_on_bench(folder, true, seed, say))
    say("3  learning the policy anew with the calibrated file")
    learned = step(out / "3-learn", lambda folder: learn_again(folder, bench["vehicle"], seed))
    say("4  flights with the calibrated file, on the drone and on the host")
    after = WalkthroughDrone(true, bench["vehicle"], seed, flashed=bench["vehicle"])
    again = step(out / "4-after", lambda folder: _fly(folder, after, learned["policy"]))
    result = BenchWalkthrough(
        measured=against_truth(true_vehicle(), bench["runs"]),
        tracking_m={"before": flown["tracking"], "after": again["tracking"]},
        landings_in_the_lab={"before": flown["landings"], "after": again["landings"]},
        vehicle=bench["vehicle"],
        folder=out,
    )
    write_json_atomically(out / SUMMARY_FILE, result)
    return result


def _fly(folder: Path, drone: WalkthroughDrone, policy: str) -> dict[str, Any]:
    """Test flights and landings of one drone with one file."""
    tests = fly_tests(folder / "tests", drone, TEST_FLIGHTS)
    landings = fly_landings(folder / "landings", drone, policy, LANDING_SPEEDS, LANDING_ANGLES)
    return {"tracking": tracking_errors(Path(tests["records"])), "landings": landings}
