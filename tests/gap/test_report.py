"""The gap finder's report: the document keeps the contract; the page shows all of it and loads nothing."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.errors import CalibrationError
from calibration.gap.data.found_effect import FoundEffect, FoundParameter, Verdict
from calibration.gap.data.record import NotUsed
from calibration.gap.landings import LandingFindings
from calibration.gap.landings.flip import FlipResidual
from calibration.gap.replay import evaluate, fly_again
from calibration.gap.report.document import (
    METRIC,
    AmbiguousSet,
    Gap,
    GapReport,
    Levels,
    Rejected,
    Unexplained,
    Where,
    leaves,
)
from calibration.gap.report.drawings import CURVES, quantile_bands
from calibration.gap.report.figures_data import AlongRegressor, ReportFigures
from calibration.gap.report.prediction_figures import prediction_gap, stage_gaps
from calibration.gap.report.words import number, unexplained_in_words
from calibration.gap.report.writing import ReportFolderError, write_report
from calibration.gap.unnamed.gap_map import GapMap
from onboard.json_file import as_json
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise
from tests.physics.effects.conftest import with_effects
from tests.report.page import Page, assert_self_contained

RNG = np.random.default_rng(11)


def report(**changes: Any) -> GapReport:
    """A report with everything in it; `changes` replace fields."""
    full = GapReport(
        verdict=Verdict.UNEXPLAINED_GAP,
        vehicle="crazyflie21-stock",
        effects=(
            FoundEffect(
                name="battery_sag",
                parameters={"resistance": FoundParameter(value=0.1012, unit="ohm", ci95=(0.0813, 0.1214))},
                error_before=1.013,
                error_after=0.6017,
                improvement_ci95=(0.3018, 0.5019),
                ambiguous_with=("thrust_scale",),
                separated_by="a long discharge at equal thrust",
                probability=0.954,
            ),
            FoundEffect(
                name="motor_saturation",
                parameters={
                    "thrust_limit": FoundParameter(value=0.1225, unit="N", ci95=(0.12, 0.1299), at_bound=True)
                },
                error_before=0.6017,
                error_after=0.4021,
                metric="force_z residual, m/s2",
                improvement_ci95=(0.1022, 0.2023),
            ),
        ),
        gap=Gap(
            metric="position error after 1 s, attitude given",
            overall=Levels(before=1.013, after=0.4021, noise_floor=0.3024, unit="m"),
            predictions={
                METRIC: {0.5: Levels(before=0.2531, after=0.1232, noise_floor=0.0833, unit="m")},
                "attitude, all predicted": {0.1: Levels(before=1.638, after=1.239, unit="deg")},
            },
            by_channel={"force_z": Levels(before=0.7134, after=0.2135, unit="m/s")},
            by_phase={"near_ceiling": Levels(before=1.536, after=0.5137, unit="m")},
        ),
        where=(Where(channel="force_z", condition="vbat < 3.4 V & fast", share=0.6241),),
        unexplained=Unexplained(
            share=0.0542, channels=("torque_y",), suspects=("line at 7.5 Hz",), formula="a sin(2 pi 7.5 t)"
        ),
        train=("laps-1", "laps-2"),
        held_out=("climb-1",),
        unusable=(NotUsed(name="dead.csv", reason="<never> flies"),),
        ambiguous=(AmbiguousSet(names=("drag", "tilt"), separated_by="laps in both directions"),),
        rejected=(Rejected(name="inertia_error", reason="drifts with excitation"),),
        limitations=("no flight near a ceiling: ceiling_effect cannot be judged",),
        landings=LandingFindings(
            verdict=Verdict.NO_GAP,
            findings=(),
            allowed={},
            usable=("landing-1", "landing-2"),
            unused=(NotUsed(name="landing-3", reason="the gyro <ends> with the contact"),),
            misfit=7.171,
            limitations=(),
            flip=FlipResidual(
                flights=("landing-1",),
                samples=57,
                mean={"as filed": 2.231, "no motor lag": -11.92},
                rms={"as filed": 2.732, "no motor lag": 13.34},
                judgement=("needs the motors' lag: without it 13.3 instead of 2.7 rad/s RMS",),
            ),
        ),
        seed=4711,
        settings={"draws": 443, "versions": {"numpy": "2.x"}},
        noise={"force_z": {"std": 0.2145, "lags": [0.9746, 0.5447]}},
    )
    return dataclasses.replace(full, **changes)


def gap_map(share: list[list[float]]) -> GapMap:
    """Two channels against three regressors."""
    chance = np.full((2, 3), 0.05)
    names = ("force_x", "force_z"), ("height", "voltage", "speed")
    return GapMap(*names, np.array(share), chance, np.ones((2, 3)), ())


def gap_of_stage(share: float) -> Gap:
    """Errors that are this share of those before, at two horizons."""
    curve = {t: Levels(before=t, after=share * t, noise_floor=0.2 * t, unit="m") for t in (0.1, 1.0)}
    return Gap(metric="error", overall=curve[1.0], predictions=dict.fromkeys(CURVES, curve))


def figures() -> ReportFigures:
    """One of each kind, with a name that must be escaped."""
    x, noise = RNG.uniform(3.0, 4.0, 300), RNG.normal(size=300)
    shares = {"before": 1.0, "+ drag & lag": 0.5, "after": 0.3}
    return ReportFigures(
        effects=(
            AlongRegressor(
                effect="battery_sag",
                channel="force_z",
                channel_unit="m/s2",
                regressor="voltage",
                regressor_unit="V",
                x=x,
                first=x + noise,
                second=x,
            ),
        ),
        stages={name: gap_of_stage(share) for name, share in shares.items()},
        heat_map=(
            gap_map([[0.1, 0.8, np.nan], [0.0, 0.2, 0.3]]),
            gap_map([[0.1, 0.02, np.nan], [0.0, 0.2, 0.1]]),
        ),
        clouds=(
            AlongRegressor(
                channel="force_z",
                channel_unit="m/s2",
                regressor="voltage",
                regressor_unit="V",
                x=x,
                first=x + noise,
                second=noise,
            ),
        ),
    )


def test_the_document_is_that_of_the_contract(tmp_path: Path) -> None:
    write_report(report(), tmp_path / "new" / "folder")
    document = json.loads((tmp_path / "new" / "folder" / "report.json").read_text())
    assert document["schema"] == "perchhw.gap/1"
    assert document["verdict"] == "unexplained_gap"
    assert document["effects"][0] == {
        "name": "battery_sag",
        "parameters": {"resistance": {"value": 0.1012, "unit": "ohm", "ci95": [0.0813, 0.1214]}},
        "error_before": 1.013,
        "error_after": 0.6017,
        "improvement_ci95": [0.3018, 0.5019],
        "ambiguous_with": ["thrust_scale"],
        "separated_by": "a long discharge at equal thrust",
        "metric": "",
        "probability": 0.954,
    }
    assert document["effects"][1]["probability"] is None
    gap = document["gap"]
    assert {key: gap[key] for key in ("metric", "unit", "before", "after", "noise_floor")} == {
        "metric": "position error after 1 s, attitude given",
        "unit": "m",
        "before": 1.013,
        "after": 0.4021,
        "noise_floor": 0.3024,
    }
    assert gap["closed_share"] == pytest.approx((1.013 - 0.4021) / (1.013 - 0.3024))
    assert {"by_horizon", "by_channel", "by_phase"} <= set(gap)
    assert gap["by_horizon"]["0.5"]["after"] == 0.1232
    assert gap["by_quantity"]["attitude after 0.1 s, all predicted"]["after"] == 1.239
    assert document["where"] == [{"channel": "force_z", "condition": "vbat < 3.4 V & fast", "share": 0.6241}]
    assert set(document["unexplained"]) == {"share", "channels", "suspects", "formula"}
    assert document["flights"] == {
        "train": ["laps-1", "laps-2"],
        "held_out": ["climb-1"],
        "unusable": [{"file": "dead.csv", "reason": "<never> flies"}],
    }


def test_every_number_and_word_of_the_document_stands_on_the_page(tmp_path: Path) -> None:
    page = Page(write_report(report(), tmp_path, figures()))
    for place, value in leaves(as_json(report())):
        if place in ("schema", "gap.closed_share") or value is None or isinstance(value, bool):
            continue
        shown = number(value) if isinstance(value, int | float) else value.replace("_", " ")
        assert shown.lower() in page.text.replace("_", " ").lower(), place
    assert "86 %" in page.text  # of the gap that could be closed
    assert "limit of what is physical" in page.text


def test_the_page_loads_nothing_and_draws_everything(tmp_path: Path) -> None:
    path = write_report(report(), tmp_path, figures())
    page = Page(path)
    assert_self_contained(page, tmp_path)
    assert page.svgs == 5  # horizons for two widths
    text = path.read_text()
    assert "url(http" not in text
    assert "<script" not in text
    assert "@import" not in text
    bare = Page(write_report(report(), tmp_path / "bare"))
    assert bare.svgs == 0


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"verdict": Verdict.NO_GAP, "effects": ()},
            "Nothing is missing that these flights show",
        ),
        (
            {
                "verdict": Verdict.NO_GAP,
                "effects": (),
                "rejected": (
                    Rejected(name="com_offset", reason="real, but too small for a name (x = 2e-4 m)"),
                ),
            },
            "Nothing is missing that matters; what is real and too small for a name is in the vehicle file",
        ),
        ({"verdict": Verdict.EFFECTS_FOUND}, "Found: battery sag and motor saturation were missing"),
        ({}, "Battery sag and motor saturation were missing, and something else"),
        ({"effects": (), "train": ("a", "b", "c")}, "Something is missing that no known effect explains"),
        ({"effects": ()}, "Something is missing, and fewer than 3 flights cannot name it: fly more"),
        ({"held_out": ()}, "on flights that were fitted, as none was kept back: "),
    ],
)
def test_the_verdict_in_words_comes_first(tmp_path: Path, changes: dict[str, Any], sentence: str) -> None:
    page = Page(write_report(report(**changes), tmp_path))
    head, _, _ = page.text.partition("Flights")
    assert sentence in head
    if changes.get("verdict") is Verdict.NO_GAP:
        assert "What was missing" not in page.text
    if "effects" not in changes:
        assert "battery sag cannot be told from thrust scale. To tell: a long discharge" in head


def test_reports_that_contradict_themselves_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="cannot have effects"):
        report(verdict=Verdict.NO_GAP)
    with pytest.raises(CalibrationError, match="needs an effect"):
        report(verdict=Verdict.EFFECTS_FOUND, effects=())
    with pytest.raises(CalibrationError, match=r"unexplained\.share is nan"):
        write_report(report(unexplained=Unexplained(share=float("nan"))), tmp_path)
    assert not (tmp_path / "report.json").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(ReportFolderError, match="cannot be written"):
        write_report(report(), tmp_path / "file" / "folder")


def test_bands_are_quantiles_of_equal_parts() -> None:
    x = np.linspace(0.0, 1.0, 2000)
    middle, low, median, high = quantile_bands(x, 2.0 * x + RNG.uniform(-0.3, 0.3, x.size))
    np.testing.assert_allclose(median, 2.0 * middle, atol=0.05)
    np.testing.assert_allclose(high - low, 0.4, atol=0.1)  # the middle two thirds of 0.6
    assert quantile_bands(x[:5], x[:5])[0].size == 0


@pytest.mark.further
def test_predictions_of_one_model_after_the_other_fill_the_report(tmp_path: Path) -> None:
    believed = load_vehicle("crazyflie21-upgraded-stored")
    scale, drag = {"thrust_scale": {"scale": 0.94}}, {"rotor_drag": {"coefficient": 4e-6}}
    truth = with_effects({**scale, **drag})
    flights = [
        with_noise(fly(truth, path, 8.0, believed=believed, name=name), 1.0, np.random.default_rng(3))
        for name, path in (("laps", circle()), ("climbs", up_and_down()))
    ]
    models = {"before": believed, "+ thrust scale": with_effects(scale), "+ rotor drag": truth}
    stages = {name: evaluate(flights, model) for name, model in models.items()}
    again = {name: flown for name, model in models.items() if (flown := fly_again(flights[0], model))}
    gap = prediction_gap(stages)
    share = gap.overall.closed_share
    assert share is not None
    assert share > 0.95
    assert gap.overall == gap.by_horizon[1.0]
    assert gap.by_channel["force_z"].after < 0.1 * gap.by_channel["force_z"].before
    assert gap.by_phase["vertical"].noise_floor is not None
    gaps = stage_gaps(stages)
    position = [one.by_horizon[1.0].after for one in gaps.values()]
    assert position == sorted(position, reverse=True)
    assert gaps["+ rotor drag"] == gap
    drawn = ReportFigures(stages=gaps, closed_loop=again)
    page = Page(write_report(report(gap=gap), tmp_path, drawn))
    assert page.svgs == 5  # horizons for two widths
    assert "laps" in page.text


def test_what_is_left_is_told_in_sentences_of_its_own() -> None:
    rest = Unexplained(
        share=0.5,
        channels=("world_force_y",),
        suspects=("x", "0.1 m < x < 0.5 m", "position error after 1 s: 0.1 m, where sensors leave 0.04"),
    )
    told = unexplained_in_words(report(unexplained=rest))
    assert "it goes with x and 0.1 m < x < 0.5 m. Position error after 1 s: 0.1 m" in told
