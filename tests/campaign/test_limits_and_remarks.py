"""Limits of aborted attempts by kind; operator and note stay with every record."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from onboard.link.errors import LinkTimeout
from perchhw.attempt import AttemptRequest, AttemptResult, Outcome
from perchhw.campaign import CampaignFileError, CampaignStopped, CampaignStore, load_plan, run_campaign
from perchhw.cli.main import run
from perchhw.record import RunRecorder
from tests.campaign.stand_in import fly


def test_a_kind_has_a_limit_of_its_own_though_attempts_between_succeed(
    campaign_file: Path, tmp_path: Path
) -> None:
    campaign_file.write_text(campaign_file.read_text() + "\n[stop]\naborts = { link = 2, mocap = 2 }\n")

    def aborts(request: AttemptRequest) -> AttemptResult:
        if request.index == 1:
            return AttemptResult(Outcome.ABORTED, False, None, "pose: LOST, need OK", request.folder)
        if request.index in (3, 5):
            raise LinkTimeout("udp://127.0.0.1:19850 does not answer")
        return fly(request)

    plan, folder = load_plan(campaign_file), tmp_path / "c"
    with pytest.raises(CampaignStopped, match=r"2 attempts were aborted by the link \(stop.aborts"):
        run_campaign(plan, folder, aborts)
    with closing(CampaignStore.open(folder)) as store:
        assert [row.state for row in store.rows()] == ["done"] * 6 + ["planned"] * 2
    looser = replace(plan, aborts={"link": 3})  # stop rules may change, and every run counts anew
    assert all(row.state == "done" for row in run_campaign(looser, folder, aborts, resume=True))


@pytest.mark.parametrize(("given", "key"), [("lnk = 2", "lnk: unknown"), ("link = -1", "link: -1 is less")])
def test_limits_that_are_none_are_refused(given: str, key: str, campaign_file: Path) -> None:
    campaign_file.write_text(campaign_file.read_text() + f"\n[stop]\naborts = {{ {given} }}\n")
    with pytest.raises(CampaignFileError, match=rf"key stop.aborts.{key}"):
        load_plan(campaign_file)


def test_operator_and_note_are_in_the_report(campaign_file: Path, tmp_path: Path) -> None:
    def remarks(request: AttemptRequest) -> AttemptResult:
        config = {"operator": request.operator, "note": request.note}
        with RunRecorder(request.folder, config, clock=lambda: 0.0) as recorder:
            recorder.close(outcome=Outcome.TWO_LEG, triggered=True, trigger=None)
        return AttemptResult(Outcome.TWO_LEG, True, None, None, request.folder)

    plan, folder = load_plan(campaign_file), tmp_path / "c"
    run_campaign(replace(plan, operator="Ada", note="new <pads>"), folder, remarks)
    assert run(["campaign", "report", str(folder)]) == 0
    page = (folder / "report.html").read_text()
    assert "Operators and notes" in page
    assert "<td>Ada</td><td>new &lt;pads&gt;</td><td>8</td>" in page
    assert run_campaign(plan, folder, remarks, resume=True)  # another operator goes on
