"""Pages of flights and campaigns: pictures first, shapes and alternative texts, nothing beyond the edge."""

import re
import shutil
from pathlib import Path

import pytest

from perchhw.attempt import Outcome
from perchhw.cli.main import run
from perchhw.record import RunRecorder
from perchhw.record.event_words import command_words
from perchhw.report.campaign_report import PREDICTION_FILE, write_campaign_report
from perchhw.report.outcome_style import OUTCOME_COLOURS, OUTCOME_MARKERS
from perchhw.report.run_report import write_run_report
from tests.report.chromium import assert_they_fit
from tests.report.page import Page, assert_self_contained


@pytest.fixture(scope="module")
def shown(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of runs with a prediction and its page, moved after it was written."""
    folder = tmp_path_factory.mktemp("before") / "runs"
    shutil.copytree(runs, folder)
    rows = "speed_m_s,angle_deg,landing_rate\n3.0,70.0,0.625\n2.0,40.0,0.5\n9.0,9.0,0.1\n"
    (folder / PREDICTION_FILE).write_text(rows)
    write_campaign_report(folder)
    moved = tmp_path_factory.mktemp("after") / "elsewhere"
    return Path(shutil.move(folder, moved))


@pytest.mark.parametrize("name", ["report.html", "run-0/report.html", "run-2/report.html"])
def test_pages_are_for_everybody(shown: Path, name: str) -> None:
    path = shown / name
    text, page = path.read_text(encoding="utf-8"), Page(path)
    pictures = re.findall(r"<svg[^>]*>", text)
    assert all('role="img" aria-label="' in picture for picture in pictures)
    assert '<meta name="viewport"' in text
    assert "@media print" in text
    assert "<script" not in text
    assert "url(http" not in text
    assert_self_contained(page, path.parent)
    for programmers_words in ("CommandDone", "Order(", "GoTo(", "=None"):
        assert programmers_words not in page.text, programmers_words


def test_a_flight_opens_with_what_happened_and_its_picture(shown: Path) -> None:
    page = Page(shown / "run-0" / "report.html")
    headings = ["What happened", "The flight", "Cues against the trigger region", "Time line"]
    places = [page.text.index(heading) for heading in headings]
    assert places == sorted(places)
    assert page.svgs == 6  # the picture (for two widths), trigger region, cues, rates, battery
    assert "Landing attempt: 3 m/s at 70 deg" in page.text
    assert "phase: flipping" in page.text
    assert re.search(r"a_rot \(N mm\).*-6\.000", page.text, re.DOTALL)
    assert "Next: " in page.text
    assert re.search(r"touched first at \d+ deg", page.text)
    picture = next(
        line for line in (shown / "run-0" / "report.html").read_text().split("<svg") if "Side view" in line
    )
    assert "trigger" in picture[:400]
    assert "end of the record" in picture[:400]


def test_a_campaign_opens_with_rates_beside_their_prediction(shown: Path) -> None:
    page = Page(shown / "report.html")
    text = (shown / "report.html").read_text()
    assert page.svgs == 7  # rates (for two widths), triggers, batteries, paths, order (for two widths)
    assert "3 of 3 attempts flown" in page.text
    assert page.references.count("run-0/report.html") == 1
    assert page.text.index("Landing rates") < page.text.index("Outcomes")
    assert "predicted by the simulation" in text
    drawn = re.findall(r"<!-- (.*?) -->", text)
    landed = "● four_leg<" in text
    rate, interval = ("1 of 1", "21% to 100%") if landed else ("0 of 1", "0% to 79%")
    assert rate in drawn
    assert interval in drawn
    assert "62%" in drawn  # 0.625 of the prediction; the condition that nobody flew is left out
    assert "10%" not in drawn
    ended = next(row for row in page.rows if row[0] == "2")
    assert ended[2] == "ended: battery <3.2 V & falling"


def test_a_flight_that_was_no_landing_says_so(tmp_path: Path) -> None:
    with RunRecorder(
        tmp_path / "hover", {"flight": "attitude_doublets", "ceiling_z": 2.09966549251562}
    ) as to:
        for k in range(200):
            t = 0.01 * k
            pose = {"x": -2.5, "y": 0.0, "z": 0.1 + 0.5 * t, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}
            to.write("pose", t, {**pose, "frame": k, "verdict": "OK"})
            to.write("rates", t, {"gx": 0.0, "gy": 0.1, "gz": 0.0})
        to.close(outcome="flown")
    page = Page(write_run_report(tmp_path / "hover"))
    assert "Body rates" in page.text
    assert "flip" not in page.text
    assert "attitude_doublets flown to its end" in page.text
    assert "log report" not in page.text  # which is this page
    assert ["ceiling", "2.100 m"] in page.rows
    assert re.search(r"started \d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC", page.text)


def test_every_outcome_has_a_shape_of_its_own() -> None:
    assert len(set(OUTCOME_MARKERS.values())) == len(set(OUTCOME_COLOURS.values())) == len(Outcome)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (
            "GoTo(position=(-3.249128631103136, 0.0, 0.477), duration=2.0)",
            "go to x -3.25, y 0.00, z 0.48 m in 2.0 s",
        ),
        ("TakeOff(height=0.5, duration=2.0)", "take off to 0.50 m in 2.0 s"),
        ("ArmApproach()", "hand over the approach and arm it, then the policy"),
        ("SomethingNew()", "something new"),
    ],
)
def test_orders_in_words(command: str, words: str) -> None:
    assert command_words(command) == words


def test_log_report_writes_the_page_and_says_why(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(runs / "run-0", folder)
    (folder / "report.html").unlink(missing_ok=True)
    assert run(["log", "report", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "touched first at" in said
    assert "next: " in said
    assert (folder / "report.html").is_file()
    assert run(["log", "report", str(tmp_path)]) == 2


def test_in_the_browser_nothing_is_wider_than_the_page(shown: Path, tmp_path: Path) -> None:
    pages = [shown / "report.html", shown / "run-0" / "report.html", write_run_report(shown / "run-2")]
    seen = assert_they_fit(pages, tmp_path)
    assert seen[2].pictures >= 6
