"""The report of a learning folder shows what the folder holds, and refuses folders that hold nothing."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from onboard.policy.files import find_policy, load_policy, shipped_policy_path
from onboard.policy.trigger import trigger_value
from perchhw.cli.learn_report import parse_condition, write_report
from perchhw.cli.main import run
from perchhw.learning.errors import LearningInputError
from perchhw.learning.examples import example_flight, example_trial, make_examples
from perchhw.learning.grid import Condition
from perchhw.learning.results import read_reference, read_results
from perchhw.learning.setup import recorded_setup
from tests.report.chromium import assert_they_fit
from tests.report.page import Page, assert_self_contained

PICTURES = {
    "landing_rates", "pairs", "trigger_region", "trigger_slices", "moment", "approach", "convergence",
}  # fmt: skip
POLICY_PICTURES = {"trigger_region", "trigger_slices", "approach"}


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def best_rates(path: Path) -> dict[tuple[float, float], float]:
    """Best landing rate at each condition, straight from the file."""
    best: dict[tuple[float, float], float] = {}
    for row in rows_of(path):
        key = float(row["speed_m_s"]), float(row["angle_deg"])
        best[key] = max(best.get(key, 0.0), float(row["landing_rate"]))
    return best


def test_learn_all_writes_a_report_with_every_picture(learned: Path) -> None:
    path = learned / "report.html"
    page = Page(path)
    assert_self_contained(page, learned)
    assert page.svgs == len(PICTURES)
    assert path.stat().st_size < 3e6
    assert "url(http" not in path.read_text(encoding="utf-8")
    assert "Read with care" not in page.text


@pytest.mark.further
def test_it_fits_a_phone_and_says_what_its_pictures_show(learned: Path, tmp_path: Path) -> None:
    page = learned / "report.html"
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg ") == text.count('<svg role="img" aria-label="')
    assert_they_fit([page], tmp_path)


def test_the_numbers_are_those_of_the_folder(learned: Path) -> None:
    page = Page(learned / "report.html")
    pairs, policy = best_rates(learned / "pairs.csv"), best_rates(learned / "validation.csv")
    measured = best_rates(learned / "validation_measured.csv")
    fast = [key for key in pairs if 45.0 <= key[1] < 60.0 and key[0] >= 2.5]
    for cells, keys in ((page.row("45-60 deg", ">= 2.5 m/s"), fast), (page.row("all", "all"), list(pairs))):
        assert cells[2] == str(len(keys))
        for place, rates in ((3, measured), (4, policy), (5, pairs)):
            assert cells[place] == f"{np.mean([rates[key] for key in keys]):.2f}"
    rows = rows_of(learned / "pairs.csv")
    good = sum(float(row["landing_rate"]) >= 0.8 for row in rows)
    assert page.row("trials")[1] == str(len(rows)) == "18"
    assert page.row("attempts")[1] == f"{sum(int(row['rollouts']) for row in rows):,}"
    assert page.row("pairs of 0.8 or more")[1].startswith(f"{good} ")
    assert page.row("pairs trained on")[1] == str(good)
    assert page.row("sensing")[1] == "realistic"
    speed = json.loads((learned / "sweep.json").read_text())["result"]["rollouts_per_second"]
    assert page.row("attempts a second")[1] == f"{speed:,.0f}"


def test_measured_dispersion_comes_first(learned: Path) -> None:
    """The rates that a lab should count on stand above any kinder ones."""
    page = Page(learned / "report.html")
    summary = json.loads((learned / "validation.json").read_text())
    heading = page.text.index("What to expect")
    assert heading < page.text.index("Landing rate over speed")
    cells = page.row("simulated, as real approaches scatter")
    assert cells[1] == f"{summary['measured']['four_leg_rate']:.2f}"
    assert page.row("simulated, realistic cues")[1] == f"{summary['four_leg_rate']:.2f}"
    assert "measured" in page.row("approach angle", "speed", "conditions")[3]
    assert summary["real_rate"] is None  # no real flights of a vehicle whose feet always hold
    assert "--landings" in page.text


def test_the_measured_world_stands_once(copy_of_learned: Path) -> None:
    """A validation that was asked for in it has one world, not the same one twice."""
    shutil.copy(copy_of_learned / "validation_measured.csv", copy_of_learned / "validation.csv")
    summary = copy_of_learned / "validation.json"
    document = json.loads(summary.read_text())
    document["settings"]["sensing"] = "measured"
    summary.write_text(json.dumps({**document, **document["measured"]}))
    page = Page(Path(write_report(copy_of_learned)["report"]))
    assert page.row("simulated, as real approaches scatter")
    assert "simulated, measured cues" not in page.text
    heading = page.row("approach angle", "speed", "conditions")
    assert [name for name in heading if name.startswith("policy,")] == ["policy, measured dispersion"]


@pytest.mark.further
def test_reference_condition_and_pictures(copy_of_learned: Path, tmp_path: Path) -> None:
    authors = tmp_path / "theirs.csv"
    authors.write_text(
        "Vel_d,Phi_d,Trial_num,LR_4Leg\n2.0,40,0,0.25\n2.0,40,1,0.75\n3.0,60,0,1.0\n3.0,0.24,0,1.0\n"
    )
    out = tmp_path / "pictures"
    arguments = [
        "--reference",
        str(authors),
        "--condition",
        "3.0,50",
        "--repeat",
        "1",
        "--pictures",
        str(out),
    ]
    assert run(["learn", "report", str(copy_of_learned), *arguments]) == 0
    assert {path.stem for path in out.glob("*.png")} == PICTURES
    page = Page(copy_of_learned / "report.html")
    assert page.row("approach angle", "speed", "conditions")[6] == "reference: theirs"
    assert (
        page.row("all", "all")[6] == "0.88"
    )  # the best of the first two and the third; the misprint is left out
    assert page.row("30-45 deg", "< 2.5 m/s")[6] == "0.75"
    assert "One learning trial: 3 m/s at 50 deg" in page.text
    assert "3 m/s at 50 deg, simulated" in page.text


@pytest.mark.further
def test_a_sweep_alone_and_a_flown_approach(copy_of_learned: Path, runs: Path) -> None:
    for name in (
        "policy.policy.json",
        "training.json",
        "validation.csv",
        "validation.json",
        "validation_measured.csv",
    ):
        (copy_of_learned / name).unlink()
    write_report(copy_of_learned)
    assert Page(copy_of_learned / "report.html").svgs == len(PICTURES - POLICY_PICTURES)
    write_report(copy_of_learned, run=runs / "run-0")
    page = Page(copy_of_learned / "report.html")
    assert "One approach: run-0" in page.text
    assert page.svgs == len(PICTURES - POLICY_PICTURES) + 1


def test_the_example_trial_is_the_one_of_the_sweep(learned: Path) -> None:
    results = read_results(learned)
    row = next(r for r in results.pairs if (r["speed_m_s"], r["angle_deg"], r["trial"]) == (2.5, 50.0, 1))
    trial = example_trial(recorded_setup(results.settings, "here"), Condition(2.5, 50.0), 1, row)
    assert trial.as_recorded
    assert trial.samples.shape == (row["episodes"], 6, 2)
    assert (trial.best.sum(axis=1) == 3).all()
    # EPHE's update (paper, section III.C) of the samples and rewards gives the next mean.
    for k in range(len(trial.rewards)):
        weights = np.where(trial.best[k], trial.rewards[k], 0.0)
        mean = weights @ trial.samples[k] / (weights.sum() + 1e-3)
        np.testing.assert_allclose(trial.mu[k + 1], mean, rtol=1e-12)
        assert trial.rewards[k][trial.best[k]].min() >= trial.rewards[k][~trial.best[k]].max()
    assert not example_trial(
        recorded_setup(results.settings, "here"), Condition(2.5, 50.0), 0, row
    ).as_recorded


def test_the_example_flight_is_one_attempt(learned: Path) -> None:
    results = read_results(learned)
    assert results.policy is not None
    condition = Condition(3.0, 50.0)
    flight = example_flight(results.policy, recorded_setup(results.settings, "here"), condition)
    t, path = flight.series("x", "z", "vx", "vz")
    assert flight.trigger is not None
    # Sampled attempts that end early are the same attempt: position and velocity belong together.
    before = t < flight.trigger.t
    np.testing.assert_allclose(np.gradient(path[before, 0], t[before]), path[before, 2], atol=0.03)
    np.testing.assert_allclose(np.gradient(path[before, 1], t[before]), path[before, 3], atol=0.03)
    seen = flight.trigger.snapshot
    assert trigger_value(results.policy.compiled(), seen["tau"], seen["theta_x"], seen["d_ceil"]) >= 0.0
    k = int(np.searchsorted(flight.t, flight.trigger.t))
    assert seen["tau"] == pytest.approx(flight.data["tau"][k], abs=0.025)  # old by up to 15 ms, and noisy
    assert path[-1, 1] == pytest.approx(2.1, abs=0.12)  # at the ceiling


def test_parts_that_do_not_belong_together_are_named(copy_of_learned: Path) -> None:
    shipped = shipped_policy_path()
    (copy_of_learned / "policy.policy.json").write_bytes(shipped.read_bytes())
    document = json.loads((copy_of_learned / "sweep.json").read_text())
    document["settings"]["vehicle_sha256"] = "0" * 64
    document["settings"]["repeats"] = 3
    (copy_of_learned / "sweep.json").write_text(json.dumps(document))
    written = write_report(copy_of_learned)
    for doubt in (
        "the sweep is not finished: 18 of 27 trials",
        "the policy was trained on another table",
        "the validation flew another policy",
        "has changed since the sweep",
    ):
        assert sum(doubt in said for said in written["doubts"]) == 1, doubt
        assert doubt in Page(copy_of_learned / "report.html").text
    assert load_policy(shipped).name
    assert make_examples(read_results(copy_of_learned), None, 0, None).trial is None


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("pairs.csv", None, "has no pairs.csv"),
        ("pairs.csv", "a,b\n1,2\n", "line 1: the columns"),
        ("sweep.json", "{}", "schema is missing"),
        ("training.json", "[", "is not JSON"),
        ("policy.policy.json", "{}", "schema"),
    ],
)
def test_folders_that_cannot_be_reported(
    copy_of_learned: Path, capsys: pytest.CaptureFixture[str], name: str, content: str | None, message: str
) -> None:
    (copy_of_learned / "report.html").unlink()
    if content is None:
        (copy_of_learned / name).unlink()
    else:
        (copy_of_learned / name).write_text(content)
    assert run(["learn", "report", str(copy_of_learned)]) == 2
    assert message in capsys.readouterr().err
    assert not (copy_of_learned / "report.html").exists()


def test_an_empty_sweep_is_refused(copy_of_learned: Path) -> None:
    pairs = copy_of_learned / "pairs.csv"
    pairs.write_text(pairs.read_text().splitlines(keepends=True)[0])
    with pytest.raises(LearningInputError, match="has no trial yet"):
        read_results(copy_of_learned)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a,b\n1,2\n", "columns"),
        ("speed_m_s,angle_deg,speed_m_s,landing_rate\n2,40,3,0.8\n", "given twice: speed_m_s"),
        ("speed_m_s,angle_deg,landing_rate\n2,40,80\n", "rate of 80"),
        ("speed_m_s,angle_deg,landing_rate\n2,40,\n", "no row with"),
    ],
)
def test_references_that_cannot_be_used(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "r.csv"
    path.write_text(content)
    with pytest.raises(LearningInputError, match=message):
        read_reference(path)


@pytest.mark.parametrize("text", ["2.5", "a,b", "2.5,45,1", "0,45", "2.5,99"])
def test_conditions_that_are_none(text: str) -> None:
    with pytest.raises(LearningInputError):
        parse_condition(text)


def test_the_authors_sweep_is_a_reference(shared_data: Path) -> None:
    rates = read_reference(shared_data / "habas2022" / "sweeps" / "NL_LR_Trials.csv").rates
    assert rates[Condition(1.5, 30.0)] < 0.5 < rates[Condition(3.0, 45.0)]
    assert all(angle >= 5.0 for _, angle in rates)


def test_a_policy_without_pairs_has_a_report_of_its_validation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The policy that ships was learned from attempts at random: what to expect of it stands first."""
    grid = ("--speeds", "2.5,3.25", "--angles", "40,60", "--domain", "none", "--rollouts", "4")
    assert run(["learn", "validate", "--policy", "measured", *grid, "--out", str(tmp_path)]) == 0
    (tmp_path / "policy.policy.json").write_bytes(find_policy("measured").read_bytes())
    assert run(["learn", "report", str(tmp_path)]) == 0
    assert "no pairs are here" in capsys.readouterr().out
    page = Page(tmp_path / "report.html")
    assert_self_contained(page, tmp_path)
    assert page.text.index("no pairs are here") < page.text.index("What to expect")
    summary = json.loads((tmp_path / "validation.json").read_text())
    expected = page.text.partition("to be expected in reality")[2].split()
    assert expected[0] == f"{summary['real_rate']['four_leg_rate']:.2f}"
    assert "25% of these conditions" in page.text  # 2.5 m/s at 40 deg alone is like the judged flights
    assert page.svgs == len({"landing_rates", "approach"})
    assert "Sensory-motor pairs" not in page.text


def test_parts_of_a_folder_without_pairs_are_held_together(tmp_path: Path) -> None:
    grid = ("--speeds", "3", "--angles", "45", "--domain", "none", "--rollouts", "1")
    assert run(["learn", "validate", "--policy", "measured", *grid, "--out", str(tmp_path)]) == 0
    (tmp_path / "policy.policy.json").write_bytes(find_policy("pads").read_bytes())
    assert any("flew another policy" in doubt for doubt in read_results(tmp_path).doubts)
    (tmp_path / "validation.csv").unlink()
    with pytest.raises(LearningInputError, match=r"has no pairs\.csv"):
        read_results(tmp_path)


@pytest.mark.further
def test_from_attempts_at_random_to_the_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What the command promises by its own surface is told as such, and its folder is nobody else's."""
    world = ("--sensing", "measured", "--speeds", "2.5,3.5", "--angles", "30,50", "--out", str(tmp_path))
    assert run(["learn", "surface", *world, "--attempts", "2200", "--json"]) == 0
    assert "clean_rate_by_own_surface" in json.loads(capsys.readouterr().out)
    assert run(["learn", "validate", *world, "--rollouts", "4"]) == 0
    assert run(["learn", "report", str(tmp_path)]) == 0
    page = Page(tmp_path / "report.html")
    assert page.row("attempts at random")[1] == "2,200"
    assert page.row("simulated, as real approaches scatter")
    assert run(["learn", "surface", *world]) == 2
    assert "already holds results" in capsys.readouterr().err
