"""Predicted outcomes of landings, and their scores."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.flights import flight_files, open_flights
from calibration.gap.landings.outcomes import (
    PreparedLandings,
    forecast,
    landing_report,
    prepare,
    read_labels,
)
from calibration.gap.landings.outcomes.held_out import held_out, left_one_out
from calibration.gap.landings.outcomes.labels import LabelsFileError, landing_class
from calibration.gap.landings.outcomes.pad_laws import LIMITS, mixture
from calibration.gap.landings.outcomes.prepare import roll_errors
from calibration.gap.landings.outcomes.roll import roll_evidence
from calibration.gap.landings.outcomes.scores import (
    REPLICATES,
    auc_of,
    brier,
    count_interval,
    reliability,
    score,
)
from calibration.gap.landings.outcomes.vehicles import (
    WITHOUT,
    bare_parameters,
    filed_point,
    grid,
    with_point,
)
from calibration.gap.report.landings_page import landings_page
from calibration.measurement import interval_of
from onboard.json_file import as_json
from onboard.outcome import Outcome
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters

STORED = "crazyflie21-upgraded-stored"
DRAWS = 60


@pytest.fixture(scope="module")
def labels(shared_data: Path) -> dict[Path, Outcome]:
    return read_labels(flight_files([shared_data / "habas2022" / "flights"]))


@pytest.fixture(scope="module")
def prepared(labels: dict[Path, Outcome]) -> PreparedLandings:
    flights, _ = open_flights(sorted(labels))
    return prepare(flights, load_vehicle(STORED), np.random.default_rng(0), DRAWS)


def real_of(prepared: PreparedLandings, labels: dict[Path, Outcome]) -> list[Outcome]:
    return [labels[start.flight.source] for start in prepared.starts]


def test_body_contact_is_scored_among_landings_that_held(
    prepared: PreparedLandings, labels: dict[Path, Outcome]
) -> None:
    """26 of the authors' flights held, 7 of them with contact; outcomes by gyro alone do not tell."""
    vehicle = load_vehicle(STORED)
    found = forecast(prepared, physics_parameters(vehicle, RoomGeometry()))
    for flight in found.flights:
        assert flight.held == round((1.0 - flight.probability[2]) * DRAWS)
        touched_and_held = flight.held * (flight.body_contact_held or 0.0)
        assert touched_and_held <= DRAWS * flight.body_contact + 1e-9
        assert DRAWS * flight.body_contact <= touched_and_held + (DRAWS - flight.held) + 1e-9
    real = real_of(prepared, labels)
    report = landing_report(prepared, found, real, [True] * len(real), vehicle, seed=0)
    contact = as_json(report)["body_contact_score"]
    assert (contact["flights"], contact["count"]["real"]) == (26, 7)
    by_gyro = landing_report(prepared, found, real, [False] * len(real), vehicle, seed=0)
    assert by_gyro.contact_score is None
    assert by_gyro.score == report.score


@pytest.mark.further
def test_the_filed_vehicle_scores_what_was_measured_outside(
    prepared: PreparedLandings, labels: dict[Path, Outcome]
) -> None:
    """Brier 1.08 on 28 flights where the base rate of all gives 0.55; two legs nearly never expected."""
    found = forecast(prepared, physics_parameters(load_vehicle(STORED), RoomGeometry()))
    real = real_of(prepared, labels)
    report = landing_report(prepared, found, real, [True] * len(real), load_vehicle(STORED), seed=0)
    assert report.score is not None
    assert report.score.flights == 28
    assert report.score.brier == pytest.approx(1.08, abs=0.06)
    assert report.score.brier_base_rate_in_sample == pytest.approx(0.554, abs=0.001)
    assert report.score.brier_base_rate == pytest.approx(0.595, abs=0.001)
    document = as_json(report)["score"]
    assert document["two_leg_share_real"] == pytest.approx(15 / 28)
    assert document["two_leg_share_model"] < 0.12
    assert not report.score.counts["two"].inside


def test_starts_are_where_the_flights_were(prepared: PreparedLandings) -> None:
    """The room differs by day, the log lags the trigger by less than two rows, and flips are followed."""
    by_day = {
        day: np.median(
            [c for s, c in zip(prepared.starts, prepared.ceilings, strict=True) if s.flight.session == day]
        )
        for day in ("10-26", "10-27")
    }
    assert 0.03 < by_day["10-26"] - by_day["10-27"] < 0.09
    assert abs(float(np.median([flip.clock for flip in prepared.flips]))) < 0.03
    assert float(np.sqrt(np.nanmean([flip.error**2 for flip in prepared.flips]))) < 2.2
    assert prepared.dispersion.height < 0.04
    assert max(prepared.dispersion.velocity) < 0.2
    assert np.nanmedian([flip.roll for flip in prepared.flips]) == pytest.approx(-0.15, abs=0.04)
    missed, left = np.sqrt(np.nanmean(roll_errors(prepared.flips) ** 2, axis=0))
    assert missed < 2.1  # of 2.6 rad/s where trim counts as thrust
    assert left < missed / 3.0  # one number, from the other flights


def test_the_seed_decides_and_flights_do_not_depend_on_each_other(labels: dict[Path, Outcome]) -> None:
    flights, _ = open_flights(sorted(labels)[:6])
    vehicle = load_vehicle(STORED)
    p = physics_parameters(vehicle, RoomGeometry())
    first = forecast(prepare(flights, vehicle, np.random.default_rng(3), 20), p)
    again = forecast(prepare(flights, vehicle, np.random.default_rng(3), 20), p)
    np.testing.assert_array_equal(first.probability, again.probability)
    np.testing.assert_allclose(first.probability.sum(axis=1), 1.0)


def test_the_page_opens_with_the_picture(labels: dict[Path, Outcome]) -> None:
    """Of a few flights, whose own pictures test_landing_pictures has."""
    vehicle = load_vehicle(STORED)
    flights, _ = open_flights(sorted(labels)[::4])
    few = prepare(flights, vehicle, np.random.default_rng(0), 20)
    p = physics_parameters(vehicle, RoomGeometry())
    real = real_of(few, labels)
    report = landing_report(few, forecast(few, p), real, [True] * len(real), vehicle, seed=0)
    assert report.prepared.roll is not None
    text = landings_page(report, [])
    assert "yaw rate gained in the flip, rad/s" in text
    assert not any(name in text for name in report.prepared.roll.measured)
    assert text.index("<svg") < text.index("<table")
    assert "src=" not in text
    assert "outside" in text
    assert report.contact_score is not None
    assert f"body contact, of {report.contact_score.flights} that held" in text


def test_labels_that_are_broken_name_the_place(tmp_path: Path) -> None:
    (tmp_path / "labels.csv").write_text("file,outcome\na.csv,landed\n")
    with pytest.raises(LabelsFileError, match=r"labels.csv row 2 column 'outcome': 'landed'"):
        read_labels([tmp_path / "a.csv"])
    (tmp_path / "labels.csv").write_text("name,outcome\n")
    with pytest.raises(LabelsFileError, match="no column 'file'"):
        read_labels([tmp_path / "a.csv"])


def test_attempts_that_never_flip_are_no_landing() -> None:
    assert landing_class(Outcome.NO_TRIGGER) is landing_class(Outcome.ABORTED) is None


@given(st.lists(st.integers(0, 2), min_size=4, max_size=40), st.integers(0, 10_000))
def test_certainty_about_the_truth_scores_nothing_and_the_base_rate_itself(
    real: list[int], seed: int
) -> None:
    classes = np.array(real)
    rng = np.random.default_rng(seed)
    perfect = score(np.eye(3)[classes], classes, 100, rng)
    assert perfect.brier == 0.0
    assert all(
        count.real == count.expected == count.interval80[0] == count.interval80[1]
        for count in perfect.counts.values()
    )
    frequencies = np.bincount(classes, minlength=3) / classes.size
    guess = score(np.tile(frequencies, (classes.size, 1)), classes, 100, rng)
    assert guess.brier == pytest.approx(guess.brier_base_rate_in_sample)
    assert guess.brier == pytest.approx(1.0 - np.sum(frequencies**2))
    if np.unique(classes).size == 1:
        assert guess.brier_gain is guess.brier_gain_ci95 is None
    else:
        assert guess.brier_gain is not None
        assert guess.brier_gain <= 1e-12  # the base rate of the others knows less


def test_brier_of_the_worst_is_two() -> None:
    assert brier(np.array([[0.0, 1.0, 0.0]]), np.array([0])) == pytest.approx(2.0)


def test_auc_orders_and_ties() -> None:
    value = np.array([0.1, 0.4, 0.4, 0.9])
    assert auc_of(value, np.array([False, False, True, True])) == pytest.approx(0.875)
    assert auc_of(value, np.array([True, True, True, True])) is None


def test_the_interval_of_an_auc_is_that_of_flights_drawn_again() -> None:
    rng = np.random.default_rng(2)
    shares, real = rng.integers(0, 6, 20) / 5.0, rng.integers(0, 3, 20)
    probability = np.column_stack([shares, 1.0 - shares, np.zeros(20)])
    drawn = np.random.default_rng(7).integers(0, 20, (REPLICATES, 20))
    found = [auc_of(shares[rows], real[rows] == 0) for rows in drawn]
    expected = interval_of(np.array([auc for auc in found if auc is not None]))
    scored = score(probability, real, 100, np.random.default_rng(7))
    assert scored.auc_four_ci95 == pytest.approx(expected)
    surprises = -np.log((100.0 * probability[np.arange(20), real] + 1.0) / 103.0)
    means = np.array([surprises[rows].mean() for rows in drawn])
    assert scored.log_score_ci95 == pytest.approx(interval_of(means))


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_the_count_interval_is_that_of_many_draws(p: list[float]) -> None:
    probability = np.array(p)
    low, high = count_interval(probability)
    drawn = (np.random.default_rng(0).random((4000, probability.size)) < probability).sum(axis=1)
    assert np.mean(drawn < low) < 0.1 + 0.02
    assert np.mean(drawn > high) < 0.1 + 0.02
    assert np.mean(drawn <= low) > 0.1 - 0.02
    assert np.mean(drawn >= high) > 0.1 - 0.02


def test_vehicles_that_differ_widen_the_interval_of_a_count() -> None:
    """Ten flights, half of the vehicles sure of all, half of none: any mean number is 5, and none is sure."""
    sure, half = np.repeat([[1.0], [0.0]], 10, axis=1), np.full(2, 0.5)
    assert count_interval(sure, share=half) == (0, 10)
    mixed = np.full(10, 0.5)
    assert count_interval(mixed) == count_interval(np.tile(mixed, (2, 1)), share=half) == (3, 7)


def test_halves_say_how_often_counts_are_inside() -> None:
    """Vehicles that are right of all flights hold every count; a vehicle that is wrong of all holds none."""
    real = np.array([0, 0, 1, 1, 2, 2])
    own = np.arange(6) % 2 == 0
    right = np.eye(3)[real][None]
    assert held_out(right, np.zeros((1, 6)), real, own)[1] == [True, True, True]
    wrong = np.tile([0.0, 0.0, 1.0], (1, 6, 1))
    assert held_out(wrong, np.zeros((1, 6)), real, own)[1] == [False, False, False]


def test_bins_hold_equal_counts_by_rising_probability() -> None:
    bins = reliability(np.linspace(0.0, 1.0, 12), np.arange(12) >= 6)
    assert sum(one.flights for one in bins) == 12
    assert [one.p_four for one in bins] == sorted(one.p_four for one in bins)


def test_what_could_roll_the_authors_flips(prepared: PreparedLandings) -> None:
    """Neither a product of inertia nor motors nor the centre of mass (docs/gap_landings_authors.md)."""
    found = prepared.roll
    assert found is not None
    assert "gyro turned against the propellers" in found.left
    refuted = {cause.name: cause.refuted_by for cause in found.causes}
    assert refuted["inertia_products"] == ("yaw_rad_s",)
    assert refuted["com_offset"] == ("hover_roll",)
    assert refuted["motor_imbalance"] == ("hover_twist",)
    gain, error = found.measured["approach_roll_per_pitch"]
    assert gain < -2.5 * error  # roll in approaches too: not the flip alone
    again = roll_evidence(prepared.starts, load_vehicle(STORED), np.random.default_rng(1))
    assert again is not None
    assert again.measured["approach_roll_per_pitch"][1] == pytest.approx(error, rel=0.04)  # by any seed


def test_five_flips_of_the_authors_do_not_refute_all(prepared: PreparedLandings) -> None:
    """The last five by name: at three standard errors every candidate would be refuted."""
    found = roll_evidence(prepared.starts[-5:], load_vehicle(STORED), np.random.default_rng(0))
    assert found is not None
    assert found.flips == 5
    assert "gyro turned against the propellers" in found.left
    gain, error = found.measured["approach_roll_per_pitch"]
    turned = found.causes[-1]
    assert abs(turned.predicted["approach_roll_per_pitch"] - gain) > 3.0 * error
    assert "inertia_products" not in found.left


def test_a_mixture_of_limits_is_their_normal_distribution() -> None:
    assert mixture(LIMITS, 0.6, 0.0) @ np.array(LIMITS) == pytest.approx(0.6)
    shares = mixture(LIMITS, 0.75, 0.3)
    assert shares.sum() == pytest.approx(1.0)
    assert shares @ np.array(LIMITS) == pytest.approx(0.75, abs=0.02)
    # Below nothing there is nothing: what a limit under zero would refuse sticks.
    assert mixture(LIMITS, 0.0, 1.0)[0] > 0.5


def test_every_flight_is_predicted_from_flights_that_are_not_it() -> None:
    """A vehicle that is certain of one flight alone must not help to predict that flight."""
    real = np.array([0, 1, 1, 1])
    uniform = np.full((4, 3), 1.0 / 3.0)
    knows = uniform.copy()
    knows[0] = [1.0, 0.0, 0.0]
    table = np.stack([uniform, knows])
    logs = np.log(np.maximum(table[:, np.arange(4), real], 1e-9))
    left = left_one_out(table, logs)
    assert left[0] == pytest.approx([2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0])  # both vehicles as likely as before


def test_a_vehicle_that_has_the_effects_is_judged_as_it_is() -> None:
    """What the file says is one vehicle of the grid, and that vehicle is the file's own."""
    vehicle = load_vehicle("crazyflie21-upgraded")
    filed = filed_point(vehicle)
    bare = bare_parameters(vehicle)
    assert filed == (1.6, 8.0, 0.6, 0.4, 0.64, *WITHOUT[5:])
    assert filed in grid(bare, filed)
    assert with_point(bare, filed) == physics_parameters(vehicle, RoomGeometry())
    odd = filed._replace(stiffness=1.3, speed=0.57, reach=0.5, impulse=0.004)
    assert odd in grid(bare, odd)
    assert filed_point(load_vehicle(STORED)) == WITHOUT
