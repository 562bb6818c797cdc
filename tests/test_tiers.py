"""The tiers of the tests: what is drawn comes again with its seed, and nothing falls between two of them."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY
from tests.tiers import LONGEST, drawn, longest_first, some

CASES = list(range(40))


def test_a_seed_draws_the_same_and_another_one_others() -> None:
    first, others = drawn(CASES, 10, 1)
    assert first == sorted(first)
    assert sorted([*first, *others]) == CASES
    assert drawn(CASES, 10, 1) == (first, others)
    assert drawn(CASES, 10, 2)[0] != first
    assert drawn(CASES, 100, 1) == (CASES, [])


def test_every_case_is_drawn_by_some_seed() -> None:
    assert {case for seed in range(60) for case in drawn(CASES, 10, seed)[0]} == set(CASES)


def test_the_longest_files_are_there_and_come_first() -> None:
    here = Path(__file__).parent
    longest = [here / name for name in LONGEST]
    assert all(file.is_file() for file in longest)
    files = [here / "test_tiers.py", longest[1], longest[0], here / "test_likely.py"]
    assert longest_first(range(4), files) == [2, 1, 0, 3]


def test_cases_that_are_left_out_are_marked_and_none_is_lost() -> None:
    marked = some([(1, "a"), (2, "b"), (3, "c"), (4, "d")], 3)
    assert [marked[0], marked[3]] == [(1, "a"), (4, "d")]
    assert [(case.values, case.marks) for case in marked[1:3]] == [
        ((number, letter), (pytest.mark.further,)) for number, letter in ((2, "b"), (3, "c"))
    ]
    assert some("ab", 2)[1].values == ("b",)


def test_a_run_draws_its_sample_and_says_so() -> None:
    """Of the file with most further cases."""
    words = ("-m", "further", "--sample", "3", "--sample-seed", "5", "--collect-only", "-q")
    file = "tests/onboard/landing/test_brake.py"
    line = [sys.executable, "-m", "pytest", *words, "-p", "no:cacheprovider", file]
    said = subprocess.run(line, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stdout + said.stderr
    assert len([row for row in said.stdout.splitlines() if row.startswith(file)]) == 3
