"""The walk-through, step by step; a step that is done is not done again."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from onboard.json_file import write_json_atomically
from onboard.policy.files import find_policy, load_policy
from perchhw.attempt import DEFAULT_POLICY
from perchhw.walkthrough.flights import WalkthroughDrone, fly_landings, fly_tests
from perchhw.walkthrough.gap.finding import find_in_records
from perchhw.walkthrough.gap.story import (
    BELIEVED,
    HIDDEN,
    LANDING_ANGLES,
    LANDING_SPEEDS,
    TEST_FLIGHTS,
    write_hidden,
)
from perchhw.walkthrough.rates import landing_rates, learn_again
from perchhw.walkthrough.steps import step

SUMMARY_FILE = "walkthrough.json"


@dataclass(frozen=True)
class Walkthrough:
    """What came of it.

    Attributes:
        hidden: the truth: parameters by effect. found: what the gap finder named.
        landing_rates: by rollouts: the shipped policy on the ``believed`` and the ``hidden`` vehicle,
            the ``relearned`` one on the hidden vehicle.
        landings_in_the_lab: on the hidden vehicle, ``before`` and ``after`` learning anew.
        folder: of everything.
    """

    hidden: dict[str, dict[str, float]]
    found: dict[str, Any]
    landing_rates: dict[str, dict[str, dict[str, float]]]
    landings_in_the_lab: dict[str, dict[str, Any]]
    folder: Path


def run_walkthrough(out: Path, seed: int, say: Callable[[str], None] = lambda text: None) -> Walkthrough:
    """Hide a change, count landings, fly, find the change, learn anew, count again.

    Args:
        out: folder; what an earlier call finished is kept.
        seed: of the lab, the finder and the learning.
        say: told what begins.

    Raises:
        PerchhwError: a step could not be done; the message says which and why.
    """
    hidden = write_hidden(out / "0-hidden")
    drone = WalkthroughDrone(hidden, BELIEVED, seed)

    def landings_with(policy: str) -> Callable[[Path], dict[str, Any]]:
        return lambda folder: fly_landings(folder / "campaign", drone, policy, LANDING_SPEEDS, LANDING_ANGLES)

    shipped = load_policy(find_policy(DEFAULT_POLICY))

    say("1  the shipped policy, on the vehicle as filed and on the one that has changed")
    before = step(
        out / "1-before",
        lambda folder: {
            "believed": landing_rates(shipped, BELIEVED, seed),
            "hidden": landing_rates(shipped, str(hidden), seed),
        },
    )
    say("2  landings of the changed drone in the simulated lab")
    landings = step(out / "2-landings", landings_with(DEFAULT_POLICY))
    say("3  test flights in the simulated lab")
    flights = step(out / "3-flights", lambda folder: fly_tests(folder / "campaign", drone, TEST_FLIGHTS))
    say("4  what is missing in the vehicle file?")
    records = [Path(landings["records"]), Path(flights["records"])]
    found = step(out / "4-gap", lambda folder: find_in_records(folder, records, seed))
    say("5  learning the policy anew with the improved file")
    learned = step(out / "5-learn", lambda folder: learn_again(folder, found["vehicle"], seed))
    say("6  the new policy on the changed drone")
    relearned = load_policy(Path(learned["policy"]))
    after = step(out / "6-after", lambda folder: {"hidden": landing_rates(relearned, str(hidden), seed)})
    again = step(out / "7-landings", landings_with(learned["policy"]))
    result = Walkthrough(
        hidden={name: dict(values) for name, values in HIDDEN.items()},
        found=found,
        landing_rates={**before, "relearned": after["hidden"]},
        landings_in_the_lab={"before": landings, "after": again},
        folder=out,
    )
    write_json_atomically(out / SUMMARY_FILE, result)
    return result
