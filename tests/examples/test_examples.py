"""Every example runs as a user runs it, with nothing attached, and prints what its page promises."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import perchhw
from tests.conftest import REPOSITORY

EXAMPLES = REPOSITORY / "examples"

SAID = {
    "hover_with_cflib.py": ((), r"hovers at 0\.(4[89]|5[0-2]) m\nlanded"),
    "one_landing.py": (("--out", "runs"), r"outcome: \w+_leg.*\nfired 0\.\d\d m below the ceiling"),
    "sweep_map.py": (("swept",), r"63 conditions, mean landing rate 0\.\d\d"),
    "own_leg_design.py": ((), r"own: mean landing rate [01]\.\d\d over 12 conditions"),
    "own_effect.py": ((), r"crazyflie21-upgraded: .* after \d+ ms\nguarded: .* after \d+ ms"),
    "own_mocap_source.py": ((), r"ok after 5\d poses"),
    "bench_from_logs.py": ((), r"inertia_zz \d+ \+- \d+ g mm2"),
    "gap_in_own_csv.py": ((), r"3 flights, 0 unusable: effects_found\nrotor_drag: coefficient"),
    "label_flights.py": ((), r"2\.5 m/s at 50 deg, simulated: \w+, by truth"),
    "campaign.py": (("flown", "--speeds", "2.5"), r"\w+: 1 of 1"),
}
"""By script: its arguments, and the essential lines that it prints."""


TWINS = ("campaign.py", "gap_in_own_csv.py", "one_landing.py")
"""What tests/campaign, tests/gap and tests/flight do in the same way: in the samples and the long proofs."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "script", [pytest.param(s, marks=pytest.mark.further) if s in TWINS else s for s in SAID]
)
def test_an_example_prints_what_it_promises(script: str, tmp_path: Path) -> None:
    arguments, said = SAID[script]
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / script), *arguments],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert re.search(said, done.stdout), done.stdout
    if script == "one_landing.py":
        assert_a_flight_of_a_notebook_is_that_of_the_command(tmp_path, done.stdout)


def assert_a_flight_of_a_notebook_is_that_of_the_command(folder: Path, said: str) -> None:
    """``perchhw.fly``, as the example calls it, leaves a record whose label is the outcome that it told."""
    flights, unusable = perchhw.open_flights(folder / "runs")
    assert not unusable
    [flight] = flights
    assert flight.trigger is not None
    label = perchhw.label_flight(flight, perchhw.load_vehicle("crazyflie21-upgraded"))
    assert f"outcome: {label.outcome}\n" in said


def test_every_example_is_tested_and_listed() -> None:
    scripts = {path.name for path in EXAMPLES.glob("*.py")}
    listed = set(re.findall(r"\]\((\w+\.py)\)", (EXAMPLES / "README.md").read_text(encoding="utf-8")))
    assert scripts == set(SAID) == listed


@pytest.mark.parametrize("script", SAID)
def test_an_example_says_how_it_is_run(script: str) -> None:
    text = (EXAMPLES / script).read_text(encoding="utf-8")
    assert f"    python examples/{script}" in text.split('"""')[1]
