"""Whatever stands in ``run.json``: views and exports are made, or end with an error of ours."""

import contextlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from onboard.errors import PerchhwError
from onboard.record.checksum import with_checksum
from perchhw.record.export import ExportFormat, export_run
from perchhw.record.run import read_run
from perchhw.view.show import write_rrd
from tests.view.flown import record

HUGE = 10**400
STRANGE: tuple[tuple[str, Any], ...] = (
    *(("clock_at_start", value) for value in ("x", HUGE)),
    *(("started_utc", value) for value in (5, "9999-12-31T23:59:59")),
    ("config.ceiling_z", HUGE),
    *(("config.room.ceiling_z", value) for value in (1e300, None)),
    *(("config.approach.t_x", value) for value in (1e300, HUGE)),
    ("config.approach", []),
    ("config.vehicle", "/"),
    ("config.policy", 3),
    ("config.mocap", "a/b?subject="),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("strange") / "run")


@pytest.mark.parametrize(("key", "value"), STRANGE, ids=lambda value: str(value)[:20])
def test_it_is_shown_or_refused(folder: Path, tmp_path: Path, key: str, value: Any) -> None:
    strange = tmp_path / "run"
    shutil.copytree(folder, strange)
    info = json.loads((folder / "run.json").read_text())
    *parents, last = key.split(".")
    target = info
    for parent in parents:
        target = target[parent]
    target[last] = value
    (strange / "run.json").write_text(json.dumps(with_checksum(info)))
    for format in (ExportFormat.FOXGLOVE, ExportFormat.ROS2):
        with contextlib.suppress(PerchhwError):
            export_run(read_run(strange), tmp_path / "out", format)
    with contextlib.suppress(PerchhwError):
        write_rrd(strange, tmp_path / "run.rrd")
