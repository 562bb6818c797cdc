"""Flights of two days may be called alike; each keeps its own estimates."""

from dataclasses import replace
from pathlib import Path

import pytest

from calibration.flights import Flight, open_flights
from calibration.gap.data import prepare_flights
from calibration.gap.data.names import distinctly_named
from tests.truth.hidden_effects.campaign import make_flights


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> list[Flight]:
    folder = tmp_path_factory.mktemp("flights")
    files = make_flights("none", "medium", 3, 3, out=folder / "flights", answer=folder / "answer.json")
    return open_flights(files)[0]


def called(flights: list[Flight], *files: str) -> list[Flight]:
    return [
        replace(flight, name=Path(file).stem, source=Path(file))
        for flight, file in zip(flights, files, strict=True)
    ]


@pytest.mark.parametrize(
    ("files", "names"),
    [
        (("a.csv", "b.csv", "c.csv"), ["a", "b", "c"]),
        (("/lab/day1/f0.csv", "/lab/day2/f0.csv", "/lab/day2/f1.csv"), ["day1/f0", "day2/f0", "f1"]),
        (("/1/x/f0.csv", "/2/x/f0.csv", "/2/y/f0.csv"), ["1/x/f0", "2/x/f0", "y/f0"]),
        (("/lab/f0.csv", "/lab/f0.csv", "/lab/f1.csv"), ["lab/f0", "lab/f0 (2)", "f1"]),
    ],
)
def test_each_flight_has_a_name_of_its_own(
    flights: list[Flight], files: tuple[str, ...], names: list[str]
) -> None:
    assert [flight.name for flight in distinctly_named(called(flights, *files))] == names


def test_records_keep_their_own_names(flights: list[Flight]) -> None:
    prepared = prepare_flights(called(flights, "/lab/day1/f0.csv", "/lab/day2/f0.csv", "/lab/day2/f1.csv"))
    assert [record.name for record in prepared.records] == ["day1/f0", "day2/f0", "f1"]
