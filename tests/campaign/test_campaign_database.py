"""The database of a campaign: what is damaged in it is named, and what it must not hold it refuses."""

import json
import os
import sqlite3
import subprocess
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from onboard.record.folder import OutputFolderError
from perchhw.campaign import CampaignError, load_plan, run_campaign
from perchhw.cli.main import run
from tests.campaign.stand_in import fly


@pytest.mark.parametrize(
    ("cell", "named"),
    [
        ("UPDATE facts SET value = '{' WHERE key = 'plan'", "fact plan"),
        ("UPDATE facts SET value = '[1,' WHERE key = 'conditions'", "fact conditions"),
        ("UPDATE attempts SET trigger = '{\"tau\": x}' WHERE slot = 3", "trigger of attempt 4"),
    ],
)
@pytest.mark.usefixtures("own_drone_files")
def test_damaged_json_in_the_database_is_an_error_of_the_campaign(
    cell: str, named: str, campaign_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "campaign"
    run_campaign(load_plan(campaign_file), folder, fly)
    with closing(sqlite3.connect(folder / "campaign.db")) as connection, connection:
        connection.execute(cell)
    verb = ["run", str(campaign_file), "--resume", "--yes", "--out"] if named == "fact plan" else ["report"]
    assert run(["campaign", *verb, str(folder)]) == 2
    assert f"{folder / 'campaign.db'}: is damaged ({named} is not JSON: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("cell", "named"),
    [
        ("UPDATE attempts SET outcome = 'hanged' WHERE slot = 3", "outcome of attempt 4 cannot be 'hanged'"),
        ("UPDATE attempts SET trigger = '[0.25]' WHERE slot = 3", "trigger of attempt 4 cannot be [0.25]"),
        (
            'UPDATE attempts SET trigger = \'{"tau": "soon"}\' WHERE slot = 3',
            "trigger of attempt 4 cannot be",
        ),
        ("UPDATE attempts SET speed_m_s = 'fast' WHERE slot = 3", "speed_m_s of attempt 4 cannot be 'fast'"),
        ("UPDATE facts SET value = '[2.5]' WHERE key = 'conditions'", "fact conditions cannot be [2.5]"),
        ("UPDATE facts SET value = '[{}]' WHERE key = 'skipped'", "fact skipped cannot be [{}]"),
        ("UPDATE facts SET value = '{}' WHERE key = 'planned'", "fact planned cannot be {}"),
        ("UPDATE facts SET value = '3' WHERE key = 'plan'", "fact plan cannot be 3"),
    ],
)
@pytest.mark.usefixtures("own_drone_files")
def test_what_no_version_wrote_into_the_database_is_an_error_of_the_campaign(
    cell: str, named: str, campaign_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "campaign"
    run_campaign(load_plan(campaign_file), folder, fly)
    with closing(sqlite3.connect(folder / "campaign.db")) as connection, connection:
        assert connection.execute(cell).rowcount == 1
    verb = ["run", str(campaign_file), "--resume", "--yes", "--out"] if "fact plan " in named else ["status"]
    assert run(["campaign", *verb, str(folder)]) == 2
    assert f"{folder / 'campaign.db'}: is damaged ({named}" in capsys.readouterr().err


@pytest.mark.parametrize(
    "damage", [lambda whole: b"no database" * 900, lambda whole: whole[: len(whole) // 2]]
)
def test_a_damaged_database_is_named(
    damage: Callable[[bytes], bytes], campaign_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "campaign"
    run_campaign(load_plan(campaign_file), folder, fly)
    database = folder / "campaign.db"
    database.write_bytes(damage(database.read_bytes()))
    for word in ("status", "report"):
        assert run(["campaign", word, str(folder)]) == 2
        assert f"{database}: is damaged" in capsys.readouterr().err.replace("\n", "")
    with pytest.raises(CampaignError, match="is damaged"):
        run_campaign(load_plan(campaign_file), folder, fly, resume=True)


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """Nobody may write into `folder`; root may write everywhere but where the file system forbids it."""
    if os.geteuid() != 0:
        folder.chmod(0o500)
        yield
        folder.chmod(0o700)
        return
    steps = (["--bind", folder, folder], ["-o", "remount,bind,ro", folder])
    if any(subprocess.run(["mount", *step], capture_output=True, check=False).returncode for step in steps):
        pytest.skip("only who may mount a file system can have one that root cannot write")
    try:
        yield
    finally:
        subprocess.run(["umount", folder], check=True)


def test_a_campaign_on_a_disk_that_only_reads_is_told_of(
    campaign_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "campaign"
    run_campaign(load_plan(campaign_file), folder, fly)
    assert run(["--json", "campaign", "status", str(folder)]) == 0
    before = json.loads(capsys.readouterr().out)
    with read_only(folder):
        assert run(["--json", "campaign", "status", str(folder)]) == 0
        assert json.loads(capsys.readouterr().out) == before
        assert run(["campaign", "report", str(folder)]) == 2
        assert "cannot be written" in capsys.readouterr().err
        with pytest.raises(OutputFolderError, match="cannot be written"):
            run_campaign(load_plan(campaign_file), folder, fly, resume=True)


def test_the_database_itself_refuses_a_second_done_row(campaign_file: Path, tmp_path: Path) -> None:
    run_campaign(load_plan(campaign_file), tmp_path / "c", fly)
    with closing(sqlite3.connect(tmp_path / "c" / "campaign.db")) as connection:
        mode = connection.execute("PRAGMA journal_mode").fetchone()[0]
        assert mode == "wal"
        with pytest.raises(sqlite3.IntegrityError):
            connection.execute(
                "INSERT INTO attempts (slot, speed_m_s, angle_deg, repeat, try, state) "
                "VALUES (0, 2, 40, 1, 9, 'done')"
            )
