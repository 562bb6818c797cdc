"""Data as JSON has it."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from calibration.measurement import Estimate, Finding, Severity
from onboard.atomic_file import write_atomically
from onboard.json_file import as_json, write_json_atomically


@dataclass(frozen=True)
class Part:
    name: str
    folder: Path
    estimate: Estimate
    findings: tuple[Finding, ...]


def test_dataclasses_become_tables_and_what_says_it_itself_is_asked(tmp_path: Path) -> None:
    part = Part("x", Path("a/b"), Estimate(1.0, "m", 0.1, 0.0), (Finding("gap", Severity.NOTE, "a gap"),))
    expected: dict[str, Any] = {
        "name": "x",
        "folder": "a/b",
        "estimate": {"value": 1.0, "unit": "m", "u95": None},
        "findings": [{"code": "gap", "severity": "note", "text": "a gap"}],
    }
    assert as_json(part) == expected
    write_json_atomically(tmp_path / "part.json", {"parts": [part]})
    assert json.loads((tmp_path / "part.json").read_text()) == {"parts": [expected]}


def test_bytes_of_a_foreign_encoding_are_written_as_their_codes(tmp_path: Path) -> None:
    """As Python has them of a command line: ``--operator J\xfcrgen`` from a terminal in Latin-1."""
    operator = b"J\xfcrgen".decode("utf-8", "surrogateescape")
    write_atomically(tmp_path / "page.html", operator)
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == "J\\udcfcrgen"


def test_a_number_that_json_does_not_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json_atomically(tmp_path / "x.json", {"x": float("nan")})
    assert list(tmp_path.iterdir()) == []


def test_of_a_shape_of_its_own_every_part_is_encoded_too() -> None:
    part = Part("x", Path("a/b"), Estimate(1.0, "m", 0.1, 0.0), ())

    @dataclass(frozen=True)
    class Shaped:
        by_horizon: dict[float, Part]

        def json_shape(self) -> dict[str, Any]:
            return {"horizons": self.by_horizon, "severest": (Severity.NOTE, None)}

    document = as_json([Shaped({0.5: part})])
    assert document == [{"horizons": {"0.5": as_json(part)}, "severest": ["note", None]}]
    assert json.loads(json.dumps(document)) == document
