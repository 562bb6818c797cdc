"""``campaign plan``: every misfit at once, the ceiling that would do, time and packs; connects to nothing."""

import json
import re
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from onboard.trajectory import fit_approach
from perchhw.campaign import (
    CampaignError,
    CampaignFileError,
    CampaignStore,
    check_approaches,
    fit_grid,
    flyable_part,
    load_plan,
    run_campaign,
)
from perchhw.campaign.forecast import forecast
from perchhw.campaign.packs import PackModel
from perchhw.cli.main import run
from tests.campaign.stand_in import fly
from tests.conftest import REPOSITORY

PAPER = """schema = "perchhw.campaign/1"
name = "paper"
drone = "udp://127.0.0.1:19850"
mocap = "vicon://127.0.0.1:18801?subject=cf1"

[grid]
speeds = [2.0, 2.25, 2.5, 2.75, 3.0]
angles_deg = "30:65:5"
repeats = 3
"""
MISFITS = [(3.0, 60.0), (3.0, 65.0)]


@pytest.fixture
def paper(tmp_path: Path) -> Path:
    file = tmp_path / "paper.toml"
    file.write_text(PAPER)
    return file


def test_every_misfit_with_the_lowest_ceiling_that_would_do(paper: Path) -> None:
    plan = load_plan(paper)
    fit = fit_grid(plan)
    assert [misfit.condition for misfit in fit.misfits] == MISFITS
    assert len(fit.approaches) == 38
    for misfit in fit.misfits:
        assert misfit.ceiling is not None
        fit_approach(*misfit.condition, replace(plan.room, ceiling_z=misfit.ceiling))
        lower = replace(plan, room=replace(plan.room, ceiling_z=misfit.ceiling - 0.01))
        assert misfit.condition in [still.condition for still in fit_grid(lower).misfits]


def test_a_room_that_is_too_short_is_not_for_want_of_height(paper: Path) -> None:
    paper.write_text(PAPER + "\n[room]\nx_min = -1.0\n")
    (misfit, *_) = fit_grid(load_plan(paper)).misfits
    assert misfit.ceiling is None
    assert "x is less than" in misfit.remedy


def test_a_campaign_is_refused_with_all_its_misfits_file_keys_and_rows(paper: Path) -> None:
    with pytest.raises(CampaignFileError) as refused:
        check_approaches(load_plan(paper))
    told = str(refused.value)
    assert f"{paper}: 2 of 40 conditions of key grid.speeds (row 7) and grid.angles_deg (row 8)" in told
    assert "3 m/s at 60 deg: needs a ceiling of 2.15 m" in told
    assert "3 m/s at 65 deg: needs a ceiling of 2.28 m" in told
    paper.write_text(PAPER + "\n[room]\nceiling_z = 0.9\n")
    with pytest.raises(CampaignFileError, match="room: ceiling"):
        check_approaches(load_plan(paper))


def test_where_nothing_fits_nothing_is_offered(paper: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paper.write_text(PAPER + "\n[room]\nx_min = -1.0\n")
    assert run(["campaign", "plan", str(paper)]) == 1
    assert "40 of 40 conditions do not fit" in (said := capsys.readouterr().out)
    assert "--skip-unflyable" not in said
    assert "battery pack" not in said
    with pytest.raises(CampaignFileError, match=r"take them out of the grid$"):
        check_approaches(load_plan(paper))


def test_the_plan_says_what_run_would_refuse(paper: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The evening before, not in the morning."""
    paper.write_text(PAPER.replace("[grid]", 'legs = "wide-long"\n\n[grid]').replace(", 3.0]", "]"))
    assert run(["campaign", "plan", str(paper)]) == 1
    assert "--accept-mismatch" in capsys.readouterr().out
    assert run(["campaign", "plan", str(paper), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["misfits"] == []
    assert "wide-long" in told["mismatch"]


def test_half_a_shape_of_approach_is_refused(paper: Path) -> None:
    paper.write_text(PAPER + "\n[approach]\ntau0 = 0.4\n")
    with pytest.raises(CampaignFileError, match=r"key approach.ax: missing; give all of ax, az, tau0"):
        load_plan(paper)


def test_packs_follow_the_voltage_model(paper: Path) -> None:
    plan = load_plan(paper)
    plan = replace(plan, skipped=fit_grid(plan).misfits)
    fit = fit_grid(plan)
    cost = forecast(plan, fit.approaches)
    assert cost.attempts == 38 * 3
    model = PackModel.for_plan(plan)
    first, each = cost.new_pack_before[0], cost.air_time / cost.attempts
    assert (
        model.after(model.full, each * (first - 2))
        > model.least
        > model.after(model.full, each * (first + 1))
    )
    assert cost.packs == 1 + len(cost.new_pack_before)
    slow = forecast(replace(plan, day=replace(plan.day, turnaround_s=120.0)), fit.approaches)
    assert slow.duration - cost.duration == pytest.approx(60.0 * 113)
    warm = forecast(replace(plan, day=replace(plan.day, warm_up_s=300.0)), fit.approaches)
    assert warm.air_time - cost.air_time > 300.0
    assert warm.new_pack_before[0] < first


def test_the_part_that_fits_is_flown_and_what_was_left_out_is_kept(paper: Path, tmp_path: Path) -> None:
    paper.write_text(PAPER.replace("repeats = 3", "").replace("2.0, 2.25, 2.5, 2.75, ", ""))
    plan, folder = flyable_part(load_plan(paper)), tmp_path / "c"
    rows = run_campaign(plan, folder, fly)
    assert {row.angle_deg for row in rows} == {30.0, 35.0, 40.0, 45.0, 50.0, 55.0}
    with closing(CampaignStore.open(folder)) as store:
        assert [misfit.condition for misfit in store.skipped] == MISFITS
        assert "z is less than 0.40 m" in store.skipped[0].reason
    assert run_campaign(plan, folder, fly, resume=True) == rows
    with pytest.raises(CampaignError, match="changed since the start in skipped"):
        run_campaign(load_plan(paper), folder, fly, resume=True)
    assert run(["campaign", "report", str(folder)]) == 0
    assert "needs a ceiling of 2.28 m" in (folder / "report.html").read_text()

    paper.write_text(PAPER.replace("2.0, 2.25, 2.5, 2.75, 3.0", "3.5").replace("30:65:5", "60:65:5"))
    with pytest.raises(CampaignFileError, match="2 of 2 conditions"):
        flyable_part(load_plan(paper))


def planned(file: Path, *options: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    code = run(["campaign", "plan", str(file), *options])
    return code, capsys.readouterr().out


def test_the_verb_draws_the_grid_and_writes_the_page(
    paper: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, text = planned(paper, "--out", str(tmp_path / "plan.html"), capsys=capsys)
    assert code == 1
    assert "    65 |     o     o     o     o     x" in text
    assert "3 m/s needs a ceiling of: 60 deg 2.15 m, 65 deg 2.28 m" in text
    page = (tmp_path / "plan.html").read_text()
    assert "<svg" in page
    assert "needs a ceiling of 2.28 m" in page
    assert max(len(line) for line in text.splitlines() if str(tmp_path) not in line) <= 80

    paper.write_text(PAPER.replace("[2.0, 2.25, 2.5, 2.75, 3.0]", '"1.5:3.5:0.1"'))
    _, text = planned(paper, capsys=capsys)
    assert max(len(line) for line in text.splitlines() if "|" in line or "+" in line) <= 80

    paper.write_text(PAPER.replace(", 3.0]", "]"))
    code, text = planned(paper, "--json", capsys=capsys)
    document: dict[str, Any] = json.loads(text)
    assert (code, document["misfits"], document["attempts"]) == (0, [], 96)
    assert all(condition["fits"] for condition in document["conditions"])


def test_one_condition_is_one(paper: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = PAPER.replace("[2.0, 2.25, 2.5, 2.75, 3.0]", "[2.5]").replace('"30:65:5"', "[50]")
    paper.write_text(one)
    code, text = planned(paper, capsys=capsys)
    assert (code, text.splitlines()[0]) == (0, "paper: 1 condition, 3 times each, shuffled")


def test_test_flights_are_planned_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "courses.toml"
    flights = '[[flight]]\nkind = "circles"\ntimes = 2\n\n[[flight]]\nkind = "long_discharge"\n'
    file.write_text(PAPER[: PAPER.index("[grid]")] + flights)
    code, text = planned(file, "--json", capsys=capsys)
    document = json.loads(text)
    assert (code, document["attempts"], document["misfits"]) == (0, 3, [])
    assert 150.0 < document["air_time_s"] < document["duration_s"]
    assert "  circles, 2 times\n" in planned(file, capsys=capsys)[1]


def blocks(kind: str) -> list[str]:
    page = (REPOSITORY / "docs" / "campaigns.md").read_text(encoding="utf-8")
    return re.findall(rf"```{kind}\n(.*?)```", page, re.DOTALL)


def test_the_files_and_the_plan_of_the_page_are_real(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    every_key, paper, drones = blocks("toml")
    Path("every_key.toml").write_text(every_key)
    plan = load_plan(Path("every_key.toml"))
    assert (plan.order, plan.map_error, plan.aborts, plan.day.warm_up_s) == (
        "adaptive",
        0.1,
        {"link": 2, "battery": 1},
        20.0,
    )
    alone = "\n".join(line for line in paper.splitlines() if not line.startswith(("drone", "mocap")))
    Path("turns.toml").write_text(f"{alone}\n{drones}")
    assert len(load_plan(Path("turns.toml")).drones) == 2
    Path("paper.toml").write_text(paper)
    _, text = planned(Path("paper.toml"), capsys=capsys)
    assert text == blocks("text")[0]
