"""Reports show what the record holds, and load nothing from elsewhere."""

import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from calibration.measurement import wilson_interval
from perchhw.attempt import AttemptRequest, AttemptResult, Outcome
from perchhw.campaign import CampaignError, load_plan, run_campaign
from perchhw.report.campaign_figures import ShownAttempt, batteries, landing_rates
from perchhw.report.campaign_report import PREDICTION_FILE, write_campaign_report
from perchhw.report.run_report import write_run_report
from tests.campaign.stand_in import fly
from tests.campaign.test_adaptive import FILE as ADAPTIVE
from tests.report.page import Page, assert_self_contained


def test_an_attempt_that_never_flew(runs: Path) -> None:
    page = Page(write_run_report(runs / "run-2"))
    assert page.svgs == 0
    assert "battery <3.2 V & falling" in page.text
    assert "holds no pose" in page.text


@pytest.mark.parametrize("flown", [1, 3])
def test_batteries_are_drawn_over_whole_attempts(flown: int) -> None:
    attempt = ShownAttempt(2.5, 50.0, Outcome.FAILURE, None, None, None, battery=(4.1, 3.2))
    drawn = batteries([attempt] * flown) or ""
    labels = re.findall(r"<!-- (.+?) -->", drawn.partition("<!-- attempt -->")[0])
    assert labels
    assert all(label.isdigit() for label in labels)


def test_a_torn_record_is_reported_as_torn(runs: Path, tmp_path: Path) -> None:
    torn = tmp_path / "torn"
    torn.mkdir()
    for name in ("run.json", "events.jsonl"):
        (torn / name).write_bytes((runs / "run-0" / name).read_bytes())
    data = (runs / "run-0" / "series.mcap").read_bytes()
    (torn / "series.mcap").write_bytes(data[: len(data) // 2])
    page = Page(write_run_report(torn))
    assert "after it was closed, a damaged copy" in page.text
    assert page.svgs >= 3


def test_a_damaged_record_is_named_and_the_others_are_shown(runs: Path, tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    shutil.copytree(runs, folder)
    for report in folder.rglob("*.html"):
        report.unlink()
    series = folder / "run-0" / "series.mcap"
    data = bytearray(series.read_bytes())
    data[len(data) // 2] ^= 0x01
    series.write_bytes(data)
    (folder / PREDICTION_FILE).write_text("speed_m_s,angle_deg,landing_rate\n3.0,70.0,high\n")
    page = Page(write_campaign_report(folder))
    assert_self_contained(page, folder)
    assert page.text.count("Cannot be read") == 2
    assert "prediction.csv row 2 column 'landing_rate'" in page.text
    assert "run-0/series.mcap byte" in page.text
    assert page.references.count("run-0/report.html") == 0
    assert page.references.count("run-1/report.html") == 1


@pytest.mark.further
def test_the_end_of_a_campaign_draws_only_the_pages_of_runs_that_have_changed(
    runs: Path, tmp_path: Path
) -> None:
    """Else each stop and resume of a long day would draw all of them again, seconds each."""
    folder = tmp_path / "runs"
    shutil.copytree(runs, folder)
    write_campaign_report(folder)
    (run, *_), names = sorted(folder.glob("run-*")), ("run.json", "events.jsonl", "series.mcap")
    page, text = run / "report.html", (run / "report.html").read_text()
    page.write_text("as it was")
    whole = Page(write_campaign_report(folder, draw_all=False))
    assert page.read_text() == "as it was"
    written = page.stat().st_mtime_ns
    for name in names:
        os.utime(page, ns=(written, written))
        os.utime(run / name, ns=(written + 1, written + 1))
        assert Page(write_campaign_report(folder, draw_all=False)).text == whole.text
        assert page.read_text() == text
        page.write_text("as it was")
        os.utime(run / name, ns=(written, written))
    write_campaign_report(folder)
    assert page.read_text() == text


def test_a_campaign(tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text(
        'schema = "perchhw.campaign/1"\ndrone = "udp://127.0.0.1:1"\nmocap = "vicon://127.0.0.1?subject=c"\n'
        "[grid]\nspeeds = [2.0, 3.0]\nangles_deg = [40, 50]\n"
    )
    flown = 0

    def three_only(request: AttemptRequest) -> AttemptResult:
        nonlocal flown
        flown += 1
        if flown > 3:
            raise KeyboardInterrupt
        if flown == 2:
            return AttemptResult(Outcome.ABORTED, False, None, "link_lost", request.folder)
        return fly(request)

    with pytest.raises(KeyboardInterrupt):
        run_campaign(load_plan(file), tmp_path / "c", three_only)
    page = Page(write_campaign_report(tmp_path / "c"))
    assert_self_contained(page, tmp_path / "c")
    assert "Campaign c" in page.text
    assert "3 of 4 attempts flown, 1 of them ended early; success (four legs, no body contact) 1 of 2" in (
        page.text
    )
    assert "link_lost" in page.text


def test_what_was_ended_early_says_nothing_of_the_rate(tmp_path: Path) -> None:
    attempt = ShownAttempt(2.5, 50.0, Outcome.FOUR_LEG, None, None, None)
    aborted = replace(attempt, outcome=Outcome.ABORTED, aborted_by="link_lost")
    assert "<!-- 1 of 1 -->" in landing_rates([attempt, aborted], {})
    assert "No attempt has come to its end yet" in landing_rates([aborted], {})


def test_an_adaptive_campaign_that_was_interrupted_knows_how_many_there_are(tmp_path: Path) -> None:
    def second_not(request: AttemptRequest) -> AttemptResult:
        if request.index > 0:
            raise KeyboardInterrupt
        return AttemptResult(Outcome.ABORTED, False, None, "link_lost", request.folder)

    file = tmp_path / "adaptive.toml"
    file.write_text(ADAPTIVE)
    with pytest.raises(KeyboardInterrupt):
        run_campaign(load_plan(file), tmp_path / "c", second_not)
    page = Page(write_campaign_report(tmp_path / "c"))
    assert "1 of 12 attempts flown, 1 of them ended early" in page.text


def test_nothing_to_report(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="neither a campaign nor a finished attempt"):
        write_campaign_report(tmp_path)


def test_the_interval_is_wilsons() -> None:
    assert wilson_interval(8, 10) == pytest.approx(
        (0.4902, 0.9433), abs=1e-4
    )  # Newcombe 1998's formula, n = 10
    low, high = wilson_interval(0, 5)
    assert low == 0.0
    assert high == pytest.approx(0.4345, abs=1e-4)
    assert wilson_interval(5, 5)[1] == 1.0
