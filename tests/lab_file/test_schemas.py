"""Every file of ours carries a version; whatever reads it refuses another version by its name."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.bench.procedures.calibration import load_calibration
from calibration.bench.procedures.run_book import STATE_FILE, RunBook
from calibration.flights.run_folder import read_info
from calibration.gap.suggest.open_questions import read_questions
from onboard.errors import InputError
from onboard.lab_file import read_lab_file
from onboard.policy.files import load_policy
from onboard.schema import schema_problem
from onboard.vehicle import load_vehicle
from perchhw.campaign import load_plan
from perchhw.hover_check.history import History
from perchhw.learning.launch_file import read_landings
from perchhw.learning.leg_results import STUDY_FILE, read_leg_study
from perchhw.learning.sweep_folder import read_settings
from tests.wizards.quiet_operator import QuietOperator

READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "run": ("run.json", lambda path: read_info(path.parent)),
    "vehicle": ("a.toml", load_vehicle),
    "lab": ("lab.toml", lambda path: read_lab_file(path, {})),
    "campaign": ("c.toml", load_plan),
    "policy": ("a.policy.json", load_policy),
    "gap": ("report.json", read_questions),
    "sweep": ("sweep.json", read_settings),
    "calibration": ("result.json", load_calibration),
    "leg_study": (STUDY_FILE, lambda path: read_leg_study(path.parent)),
    "gap_landings": ("landings.json", read_landings),
    "hover_check": ("a.json", lambda path: History(path.parent, 0).before()),
    "calibration-run": (STATE_FILE, lambda path: RunBook(path.parent, "bifilar", {}, QuietOperator())),
}


@pytest.mark.parametrize(
    ("version", "why"),
    [("0", "older than what this perchhw reads"), ("2", "newer than this perchhw"), (None, "is missing")],
)
@pytest.mark.parametrize("kind", READERS)
def test_another_version_is_refused_by_name_with_the_file(
    kind: str, version: str | None, why: str, tmp_path: Path
) -> None:
    name, read = READERS[kind]
    path = tmp_path / name
    content = {} if version is None else {"schema": f"perchhw.{kind}/{version}"}
    if path.suffix == ".toml":
        path.write_text("".join(f'{key} = "{value}"\n' for key, value in content.items()))
    else:
        path.write_text(json.dumps({**content, "config": {}, "closed": True}))
    with pytest.raises(InputError, match=why) as refused:
        read(path)
    assert str(tmp_path) in str(refused.value)
    assert f"perchhw.{kind}/1" in str(refused.value)


@given(st.none() | st.integers() | st.text() | st.lists(st.text()))
def test_only_the_schema_itself_is_read(found: object) -> None:
    assert (schema_problem(found, "perchhw.lab/1") is None) == (found == "perchhw.lab/1")


def test_a_file_of_another_kind_is_called_that() -> None:
    assert "a file of another kind" in str(schema_problem("perchhw.run/1", "perchhw.lab/1"))
