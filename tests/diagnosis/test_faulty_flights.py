"""Faults of whole flights in the simulated lab are named; ``make soak`` flies 200 of them."""

from pathlib import Path

import numpy as np
import pytest

from tests.diagnosis.faulty_flights import faults, fly

pytestmark = pytest.mark.timeout(300)

SAMPLE = ("fires late",)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in SAMPLE else pytest.mark.soak)
        for name in sorted(faults(np.random.default_rng(0)))
    ],
)
def test_the_fault_is_named(name: str, tmp_path: Path) -> None:
    told = fly(tmp_path, 3, name)
    assert told.right, told
