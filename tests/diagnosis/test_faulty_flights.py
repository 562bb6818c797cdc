"""A fault of a whole flight in the simulated lab is named; ``make soak`` flies 200 of all kinds."""

from pathlib import Path

import numpy as np
import pytest

from perchhw.diagnosis import Cause
from tests.conftest import REPOSITORY
from tests.diagnosis.faulty_flights import Table, Told, faults, fly

SAMPLE = "fires late"


@pytest.mark.soak  # tests/flight/test_attempt.py names eight causes in flights that it flies anyway
def test_the_fault_is_named(tmp_path: Path) -> None:
    told = fly(tmp_path, 3, SAMPLE)
    assert told.right, told


def test_every_cause_is_documented_and_most_are_flown() -> None:
    page = (REPOSITORY / "docs" / "reports.md").read_text(encoding="utf-8")
    assert not [cause.value for cause in Cause if f"`{cause.value}`" not in page]
    kinds = faults(np.random.default_rng(0))
    assert f"one of {len(kinds)} known faults" in page
    assert len({cause for fault in kinds.values() for cause in fault.causes}) >= 18


def test_a_run_that_was_killed_while_it_wrote_goes_on_with_what_it_had(tmp_path: Path) -> None:
    file = tmp_path / "flights.jsonl"
    kept = Table(file).keep(Told("none", 17, Cause.FOUR_LEGS, (Cause.FOUR_LEGS,), "held"))
    with file.open("a") as lines:
        lines.write('{"fault": "froz')
    again = Table(file)
    assert again.of(17, "none") == {**kept, "expected": ["four_legs"]}
    assert again.of(17, "frozen") is None
    again.keep(Told("frozen", 18, Cause.TUMBLED, (Cause.MOCAP_FROZEN,), "tipped"))
    row = Table(file).of(18, "frozen")
    assert row is not None
    assert row["right"] is False
