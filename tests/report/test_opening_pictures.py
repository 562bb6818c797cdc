"""Pages of adaptive campaigns, of the gap finder and of the bench open with a picture that fits a phone."""

import re
from pathlib import Path

import numpy as np
import pytest

from calibration.bench.procedures.report import write_report as write_bench_report
from calibration.gap.report import write_report as write_gap_report
from calibration.report_style import new_figure
from perchhw.campaign import load_plan, run_campaign
from perchhw.campaign.adaptive import FlownMap
from perchhw.campaign.rate_map import ExpectedRates
from perchhw.cli.main import run
from perchhw.report.campaign_report import write_campaign_report
from perchhw.report.map_figure import map_figure
from tests.campaign.stand_in import fly
from tests.campaign.test_adaptive import FILE
from tests.gap import test_report as gap
from tests.report.chromium import assert_they_fit
from tests.report.page import Page, assert_self_contained
from tests.wizards.test_calibration import calibration
from tests.wizards.test_verify import discharge


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    file = folder / "adaptive.toml"
    file.write_text(FILE.replace("attempts = 12", "attempts = 2"))
    run_campaign(load_plan(file), folder / "campaign", fly)
    first = new_figure(5.2, 3.0)
    first.add_subplot().plot([0.0, 1.0], [0.0, 1.0])
    second = new_figure(5.2, 3.0)
    for name in ("bench", "discharge"):
        (folder / name).mkdir()
    report = folder / "discharge" / "report.html"
    assert run(["calibrate", "verify", str(discharge(report.parent, 0.01)), "--report", str(report)]) == 0
    figures = {"First swing": first, "Trials": second}
    return {
        "Landing rates": write_campaign_report(folder / "campaign"),
        "What the flights show of it": write_gap_report(gap.report(), folder / "gap", gap.figures()),
        "First swing": write_bench_report(folder / "bench", calibration(), figures, {}),
        "Thrust over the discharge": report,
    }


@pytest.mark.further
def test_the_picture_comes_before_every_table(pages: dict[str, Path]) -> None:
    for title, path in pages.items():
        text = path.read_text()
        assert_self_contained(Page(path), path.parent)
        places = [text.index(part) for part in (f"<h2>{title}</h2>", "<svg", "<table")]
        assert places == sorted(places), path
        opening = re.search(r"<svg[^>]*>", text)
        assert opening is not None
        assert "aria-label" in opening.group(), path


def test_an_adaptive_campaign_shows_its_map(pages: dict[str, Path]) -> None:
    text = pages["Landing rates"].read_text()
    assert "<h2>Map of the landing rate</h2>" in text
    assert "Map of the landing rate over 15 conditions: highest" in text


def test_a_map_names_its_best_and_its_least_certain_condition() -> None:
    known = ExpectedRates(rate=np.array([0.2, 0.9]), deviation=np.array([0.25, 0.1]), gain=np.zeros(2))
    drawn = map_figure(FlownMap(((2.0, 40.0), (2.5, 60.0)), (0, 4), (0, 4), known))
    assert "highest 2.5 m/s 60 deg (90%), least certain 2 m/s 40 deg (standard deviation 25%)" in drawn
    assert "<!-- 4 of 4 -->" in drawn
    assert "0 of 0" not in drawn


@pytest.mark.further
def test_in_the_browser_they_fit_a_phone(pages: dict[str, Path], tmp_path: Path) -> None:
    assert_they_fit(list(pages.values()), tmp_path)
