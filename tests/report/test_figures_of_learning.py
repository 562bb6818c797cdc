"""What the figures are made of: smoothing, the trigger surface, bands of a leg study."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest

from calibration.report_style import report_style
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.policy.trigger import trigger_values
from perchhw.cli.main import run
from perchhw.learning.errors import LearningInputError
from perchhw.learning.leg_results import read_leg_study
from perchhw.report.cue_space import trigger_surface
from perchhw.report.isosurface import zero_surface
from perchhw.report.leg_figures import factors_by_angle
from perchhw.report.rate_maps import smoothed
from tests.report.chromium import assert_they_fit
from tests.report.page import Page, assert_self_contained


def test_the_zero_surface_of_a_ball_is_its_sphere() -> None:
    axes = tuple(np.linspace(-1.2, 1.3, n) for n in (30, 33, 36))
    x, y, z = np.meshgrid(*axes, indexing="ij")
    corners = zero_surface(1.0 - x**2 - y**2 - z**2, (axes[0], axes[1], axes[2]))
    np.testing.assert_allclose(np.linalg.norm(corners, axis=-1), 1.0, atol=0.004)
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(sides, axis=1).sum() / 2 == pytest.approx(4 * np.pi, rel=0.005)


def test_the_trigger_surface_is_where_the_policy_begins_to_fire() -> None:
    policy = load_policy(shipped_policy_path())
    mean, std = np.asarray(policy.scaler_mean, float), np.asarray(policy.scaler_std, float)
    bounds = np.column_stack([np.maximum(mean - 3 * std, 1e-3), mean + 3 * std])
    corners = trigger_surface(policy, bounds, points=50).reshape(-1, 3)
    values = trigger_values(policy.compiled(), corners.astype(np.float32))
    assert len(corners) > 1000
    assert np.abs(values).max() < 0.1  # it reaches from below -1 to above 0.1
    assert np.abs(values).mean() < 0.01


def test_smoothing_keeps_to_what_was_measured() -> None:
    speeds, angles = np.array([1.5, 2.0, 2.5, 3.0]), np.array([30.0, 50.0, 70.0, 90.0])
    grid = np.array([(v, a) for v in speeds for a in angles])
    low_then_high = np.where(grid[:, 0] < 2.2, 0.2, 0.9)
    there = smoothed(grid, low_then_high, speeds, angles)
    assert there.shape == (4, 4)
    assert np.abs(there[0] - 0.2).max() < 0.05
    assert np.abs(there[3] - 0.9).max() < 0.05
    far = smoothed(grid, low_then_high, np.array([0.1, 9.0]), angles)
    assert far.min() >= 0.2
    assert far.max() <= 0.9


@pytest.mark.further
def test_a_leg_study_is_reported_with_its_numbers(leg_study: Path) -> None:
    page = Page(leg_study / "report.html")
    assert_self_contained(page, leg_study)
    assert page.svgs == 3
    results = read_leg_study(leg_study)
    designs = results.study["designs"]
    assert page.row("all", "all")[2:] == [f"{d['landing_rate']:.2f}" for d in designs.values()]
    assert page.row("approach angle", "speed")[2:] == ["narrow-short", "wide-long"]
    assert page.row("higher speed helps: from 2.5 m/s less below")[1] in ("yes", "not all")


@pytest.mark.further
def test_a_leg_study_fits_a_phone(leg_study: Path, tmp_path: Path) -> None:
    assert_they_fit([leg_study / "report.html"], tmp_path)


@pytest.mark.further
def test_the_factors_figure_has_the_medians_of_the_landings(leg_study: Path) -> None:
    with report_style():
        figure = factors_by_angle(read_leg_study(leg_study))
    with (leg_study / "landings.csv").open(newline="") as file:
        rows = [
            r for r in csv.DictReader(file) if r["design"] == "wide-long" and float(r["angle_deg"]) == 90.0
        ]
    success = np.mean([row["outcome"] == "four_leg" for row in rows])
    swings = [1e3 * float(row["swing_distance"]) for row in rows if row["swing_distance"]]
    rate_panel, swing_panel = figure.axes[:2]
    assert rate_panel.lines[1].get_label() == "wide-long"
    assert np.asarray(rate_panel.lines[1].get_ydata())[-1] == pytest.approx(success)
    assert np.asarray(swing_panel.lines[1].get_ydata())[-1] == pytest.approx(np.median(swings))


def test_a_broken_leg_study_is_refused(
    leg_study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = Path(shutil.copytree(leg_study, tmp_path / "legs"))
    text = (broken / "landings.csv").read_text()
    (broken / "landings.csv").write_text(text.replace("swing_distance", "swing", 1))
    with pytest.raises(LearningInputError, match="no column 'swing_distance'"):
        read_leg_study(broken)
    (broken / "study.json").write_text("{}")
    assert run(["learn", "report", str(broken)]) == 2
    assert "schema is missing" in capsys.readouterr().err
