"""``perchhw log`` and ``perchhw campaign`` from the command line: results, exit codes, one JSON document."""

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.record.checksum import with_checksum
from onboard.vehicle import load_vehicle
from perchhw.cli.main import run
from tests.campaign.stand_in import fly
from tests.label.simulated import land
from tests.report.recorded import record_landing

CAMPAIGN = """
schema = "perchhw.campaign/1"
drone = "udp://127.0.0.1:1"
mocap = "vicon://127.0.0.1?subject=c"
[grid]
speeds = [2.0]
angles_deg = [40, 50]
"""


@pytest.fixture(scope="module")
def landing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    vehicle = load_vehicle("crazyflie21-upgraded")
    rng = np.random.default_rng(4)
    attempts = (land(vehicle, 3.0, 70.0, tau, -7e-3, rng) for tau in (0.23, 0.24, 0.22, 0.25, 0.21, 0.26))
    attempt = next(a for a in attempts if a.truth.value == "four_leg")
    return record_landing(attempt, tmp_path_factory.mktemp("runs") / "landing", vehicle, 3.0, 70.0)


def call(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, dict[str, Any], str]:
    """Exit code, the JSON document on stdout (exactly one, or none), and stderr."""
    code = run([*(str(a) for a in arguments), "--json"])
    captured = capsys.readouterr()
    document = json.loads(captured.out) if captured.out else {}
    return code, document, captured.err


def test_label_gives_the_outcome(capsys: pytest.CaptureFixture[str], landing: Path) -> None:
    code, document, _ = call(capsys, "log", "label", landing)
    assert code == 0
    assert document["outcome"] == "four_leg"
    [flight] = document["flights"]
    assert flight["file"] == str(landing)
    assert flight["outcome"] == "four_leg"
    assert flight["evidence"]["pose"]["rest_distance_m"] == pytest.approx(0.079, abs=0.01)
    assert run(["log", "label", str(landing)]) == 0
    assert "mm below the ceiling" in " ".join(capsys.readouterr().out.split())


def test_label_of_several_goes_on_after_an_unusable_one(
    capsys: pytest.CaptureFixture[str], landing: Path, shared_data: Path
) -> None:
    folder = shared_data / "habas2022" / "flights"
    floor = folder / "SVL--NL_2.50_80.00_10-27_11-00.csv.gz"
    four = folder / "SVL--NL_2.50_40.00_10-26_16-34.csv.gz"
    code, document, errors = call(capsys, "log", "label", "--format", "habas", floor, four)
    assert code == 0
    assert [f["outcome"] for f in document["flights"]] == ["four_leg"]
    assert document["unusable"][0]["file"] == str(floor)
    assert "never leaves the floor" in document["unusable"][0]["reason"]
    assert "never leaves the floor" in " ".join(errors.split())
    assert "outcome" not in document
    assert call(capsys, "log", "label", floor)[0] == 2


def test_label_names_broken_files_and_goes_on(
    capsys: pytest.CaptureFixture[str], landing: Path, tmp_path: Path
) -> None:
    table, run_folder, list_folder = tmp_path / "b.csv", tmp_path / "damaged", tmp_path / "list"
    table.write_text("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,oops,0,0,0,0,1\n")
    for folder, text in (
        (run_folder, "{"),
        (list_folder, '{"schema": "perchhw.run/1", "config": [], "closed": true}'),
    ):
        folder.mkdir()
        (folder / "run.json").write_text(text)
        (folder / "series.mcap").write_bytes(b"")
    binary = tmp_path / "noise.csv"
    binary.write_bytes(bytes(range(256)))
    too_long = tmp_path / ("n" * 300)  # the system refuses to look at it, also for root
    bad = [table, run_folder, list_folder, binary, too_long, tmp_path / "missing"]
    code, document, errors = call(capsys, "log", "label", *bad[:3], landing, *bad[3:])
    assert code == 0
    assert [f["outcome"] for f in document["flights"]] == ["four_leg"]
    assert [u["file"] for u in document["unusable"]] == [str(b) for b in bad]
    reasons = [u["reason"] for u in document["unusable"]]
    words = (
        "row 3 column 'y'",
        "run.json is not JSON",
        "'config'",
        "no known flight format",
        "too long",
        "no such",
    )
    for word, reason in zip(words, reasons, strict=True):
        assert word in reason
        assert reason in errors
    code, document, _ = call(capsys, "log", "label", *bad)
    assert (code, document["flights"], len(document["unusable"])) == (2, [], len(bad))
    code, _, errors = call(capsys, "log", "label", landing, "--vehicle", "no-such")
    assert code == 2
    assert "no-such" in errors


def test_exit_code_2_for_what_cannot_be_used(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    broken = tmp_path / "b.csv"
    broken.write_text("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,oops,0,0,0,0,1\n")
    code, document, errors = call(capsys, "log", "label", broken)
    assert (code, document["flights"]) == (2, [])
    reason = f"{broken} row 3 column 'y': 'oops' is not a number"
    assert document["unusable"] == [{"file": str(broken), "reason": reason}]
    assert f"unusable: {reason}" in errors
    assert call(capsys, "log", "label", tmp_path / "missing")[0] == 2
    assert call(capsys, "log", "view", tmp_path)[0] == 2
    assert call(capsys, "log", "list", tmp_path / "missing")[0] == 2
    assert call(capsys, "campaign", "status", tmp_path)[0] == 2
    assert call(capsys, "campaign", "run", tmp_path / "missing.toml")[0] == 2


def test_list_names_runs_and_broken_ones(capsys: pytest.CaptureFixture[str], landing: Path) -> None:
    damaged = landing.parent / "damaged"
    damaged.mkdir(exist_ok=True)
    (damaged / "run.json").write_text("{")
    (damaged / "series.mcap").write_bytes(b"")
    code, document, errors = call(capsys, "log", "list", landing.parent)
    assert code == 0
    [entry] = document["runs"]
    assert (entry["speed"], entry["outcome"], entry["triggered"], entry["closed"]) == (
        3.0,
        "four_leg",
        True,
        True,
    )
    assert "run.json is not JSON" in " ".join(errors.split())
    shutil.rmtree(damaged)


def test_list_is_in_the_order_of_flying_and_says_in_which_folder(
    capsys: pytest.CaptureFixture[str], landing: Path, tmp_path: Path
) -> None:
    """Names of runs begin with what they are; only the record says when they were flown."""
    started = {"day/b": "2026-11-23T09:00:00+00:00", "day/a": "2026-11-23T10:00:00+00:00"}
    started |= {"hover/c": "2026-11-23T11:00:00+00:00"}
    for name, at in started.items():
        shutil.copytree(landing, tmp_path / name)
        info = tmp_path / name / "run.json"
        info.write_text(json.dumps(with_checksum(json.loads(info.read_text()) | {"started_utc": at})))
    _, document, _ = call(capsys, "log", "list", tmp_path)
    assert [entry["folder"] for entry in document["runs"]] == [str(tmp_path / name) for name in started]
    run(["log", "list", str(tmp_path)])
    shown = [line.split()[:2] for line in capsys.readouterr().out.splitlines()]
    assert shown == [["run", "m/s"], ["in", "day:"], ["b", "3"], ["a", "3"], ["in", "hover:"], ["c", "3"]]
    shutil.copytree(landing, tmp_path / "day" / "b" / "again")  # a run that others lie in
    assert run(["log", "list", str(tmp_path / "day" / "b")]) == 0
    assert "in ..:" in capsys.readouterr().out


def test_list_breaks_neither_names_nor_outcomes_in_80_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, landing: Path, tmp_path: Path
) -> None:
    """The name is what every other command takes; beside it the widest values of every other column."""
    name = "20261123T100746Z-000-try1-2.25ms-47.5deg"
    shutil.copytree(landing, tmp_path / name)
    info = tmp_path / name / "run.json"
    said = json.loads(info.read_text())
    said["config"] |= {"speed_m_s": 2.25, "angle_deg": 47.5}
    info.write_text(json.dumps(with_checksum(said | {"outcome": "dry_run_passed"})))
    series = tmp_path / name / "series.mcap"
    series.write_bytes(series.read_bytes()[:-100])
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["log", "list", str(tmp_path)]) == 0
    shown = capsys.readouterr().out.splitlines()
    (line,) = [line for line in shown if name in line]
    assert line.split() == [name, "2.25", "47.5", "dry_run_passed", "yes", "cut", "off"]
    assert max(map(len, shown)) <= 80


def test_labels_are_shown_with_whole_names_in_80_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, landing: Path, tmp_path: Path
) -> None:
    name = "20261123T100746Z-000-try1-2.25ms-47.5deg"
    shutil.copytree(landing, tmp_path / name)
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["log", "label", str(tmp_path / name)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in shown if name in line] == [[name, "four_leg"]]
    assert "…" not in "".join(shown)


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (("log", "export", "--to", "csv"), "pose.csv"),
        (("log", "export", "--to", "parquet"), "pose.parquet"),
        (("log", "export", "--to", "foxglove"), "foxglove.mcap"),
        (("log", "export", "--to", "ros2"), "ros2.mcap"),
        (("view", "--save"), "flight.rrd"),
    ],
)
def test_a_full_disk_is_told_in_a_line(
    capsys: pytest.CaptureFixture[str], landing: Path, tmp_path: Path, arguments: tuple[str, ...], file: str
) -> None:
    (tmp_path / file).symlink_to("/dev/full")
    where = [tmp_path / file] if "--save" in arguments else ["--out", tmp_path]
    code, _, errors = call(capsys, *arguments, *where, landing)
    assert code == 2
    assert "cannot be written" in errors
    assert "No space left on device" in errors
    assert "Traceback" not in errors


def test_export_is_complete_and_reads_back(
    capsys: pytest.CaptureFixture[str], landing: Path, tmp_path: Path
) -> None:
    code, document, _ = call(capsys, "log", "export", landing, "--out", tmp_path)
    assert code == 0
    files = {Path(f).name for f in document["files"]}
    topics = ("pose", "rates", "estimate", "cues", "power", "trigger")
    assert files == {f"{name}.csv" for name in (*topics, "flight", "resampled")}
    with (tmp_path / "rates.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["t", "gx", "gy", "gz"]
    code, labelled, _ = call(capsys, "log", "label", tmp_path / "flight.csv", "--ceiling-z", "2.1")
    assert (code, labelled["outcome"]) == (0, "four_leg")


def test_a_ceiling_that_cannot_be_is_no_fault_of_the_files(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code, _, errors = call(capsys, "log", "label", tmp_path / "none.csv", "--ceiling-z", "2100")
    assert code == 2
    assert "a ceiling at 2100 m cannot be" in errors
    assert "unusable" not in errors


def test_export_to_parquet(capsys: pytest.CaptureFixture[str], landing: Path, tmp_path: Path) -> None:
    from pyarrow import parquet

    assert call(capsys, "log", "export", landing, "--to", "parquet", "--out", tmp_path)[0] == 0
    table = parquet.read_table(tmp_path / "pose.parquet")
    assert table.column("verdict")[0].as_py() == "OK"
    assert table.num_rows == parquet.read_table(tmp_path / "rates.parquet").num_rows
    assert call(capsys, "log", "export", landing, "--to", "xls")[0] == 2


def test_replay_of_the_flown_policy_fires_where_the_drone_did(
    capsys: pytest.CaptureFixture[str], shared_data: Path, tmp_path: Path
) -> None:
    from onboard.policy.files import import_authors_policy, save_policy

    policy = tmp_path / "flown.policy.json"
    save_policy(import_authors_policy(shared_data / "habas2022" / "policy" / "flown_policy.json"), policy)
    flight = shared_data / "habas2022" / "flights" / "SVL--NL_2.50_40.00_10-26_16-34.csv.gz"
    code, document, _ = call(capsys, "log", "replay", flight, "--policy", policy)
    assert code == 0
    assert document["fires_at"] == pytest.approx(document["recorded_trigger"], abs=0.045)
    # the authors log the moment on the trigger as 2 a_rot; the replay gives a_rot itself
    assert -9.6e-3 < document["a_rot_at_firing"] < -4.5e-3


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("udp://127.0.0.1:1", "foo://127.0.0.1:1"),
        ("vicon://127.0.0.1", "vicom://127.0.0.1"),
        ("[grid]", 'policy = "no-such"\n[grid]'),
        ("[grid]", 'vehicle = "no-such"\n[grid]'),
    ],
)
def test_a_campaign_that_names_what_does_not_exist_begins_nothing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, old: str, new: str
) -> None:
    file = tmp_path / "c.toml"
    file.write_text(CAMPAIGN.replace(old, new, 1))
    code, _, errors = call(capsys, "campaign", "run", file, "--out", tmp_path / "c", "--yes")
    assert code == 2
    key = {"foo://127.0.0.1:1": "drone", "vicom://127.0.0.1": "mocap"}.get(new, new.split()[0])
    assert f"{file}: key {key}: " in errors
    assert not (tmp_path / "c").exists()


@pytest.mark.usefixtures("own_drone_files")
def test_a_folder_that_cannot_be_written_is_named(
    capsys: pytest.CaptureFixture[str], landing: Path, tmp_path: Path
) -> None:
    plan, out = tmp_path / "c.toml", tmp_path / "a-file" / "out"
    plan.write_text(CAMPAIGN)
    out.parent.write_text("")
    addresses = ("--drone", "udp://127.0.0.1:1", "--mocap", "vicon://127.0.0.1?subject=c")
    for command in (
        ("campaign", "run", plan, "--yes"),
        ("log", "export", landing),
        ("fly", *addresses, "--speed", "2.5", "--angle", "60"),
    ):
        code, _, errors = call(capsys, *command, "--out", out)
        assert code == 2, command
        assert f"{out}: cannot be written" in errors, command
    code, _, errors = call(capsys, "log", "view", landing, "--save", out / "x.rrd")
    assert code == 2
    assert f"{out}: cannot be written" in errors


@pytest.mark.further
def test_status_and_report_of_a_campaign(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    from perchhw.campaign import load_plan, run_campaign

    file = tmp_path / "c.toml"
    file.write_text(CAMPAIGN)
    run_campaign(load_plan(file), tmp_path / "c", fly)
    code, document, _ = call(capsys, "campaign", "status", tmp_path / "c")
    assert code == 0
    assert (document["planned"], document["done"]) == (2, 2)
    assert [a["state"] for a in document["attempts"]] == ["done", "done"]
    code, document, _ = call(capsys, "campaign", "report", tmp_path / "c")
    assert Path(document["report"]).is_file()
