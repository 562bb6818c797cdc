"""How often a right model of landings is called wrong, and one that is wrong about single flights is not."""

from collections.abc import Callable

import numpy as np
import pytest

from calibration.gap.data.found_effect import Verdict
from calibration.gap.landings.outcomes.labels import FOUR, NONE, TWO
from calibration.gap.landings.outcomes.scores import Score, brier, expected_brier, score, smoothed
from calibration.gap.landings.outcomes.verdict import ENOUGH, in_words, judge_outcomes
from calibration.gap.landings.outcomes.words import difference, percent
from calibration.measurement import wilson_interval
from onboard.arrays import FloatArray, IntArray

DRAWS = 200
FOURS = 0.01 * np.fromstring(
    "27 6 22 41 14 26 23 27 36 20 38 29 30 41 41 66 53 54 57 46 27 54 34 77 70 67 73 26",
    sep=" ",
)
NONES = 0.01 * np.fromstring("10 50 40 6 52 12 6 24 3 3 6 1 0 0 1 3 3 0 3 3 0 14 0 1 0 4 1 56", sep=" ")
TRUE = np.column_stack([FOURS, 1.0 - FOURS - NONES, NONES])
"""As the authors' 28 flights with `crazyflie21-upgraded` (0.01), which expects 11, 14 and 3."""

Says = Callable[[np.random.Generator], FloatArray]


def outcomes_of(probability: FloatArray, rng: np.random.Generator) -> IntArray:
    return np.array([rng.choice(3, p=shares) for shares in probability])


def simulated(probability: FloatArray, draws: int, rng: np.random.Generator) -> FloatArray:
    return np.array([rng.multinomial(draws, shares) / draws for shares in probability])


def called_wrong(says: Says, sets: int, draws: int = DRAWS, flights: int = len(TRUE)) -> int:
    """Sets, of outcomes drawn from TRUE, with which a model that says so of some flights is called wrong."""
    rng = np.random.default_rng(7)
    wrong = 0
    for _ in range(sets):
        flown = rng.permutation(len(TRUE))[:flights]
        said = simulated(says(rng)[flown], draws, rng)
        found = score(said, outcomes_of(TRUE[flown], rng), draws, rng)
        wrong += judge_outcomes(found, None) is Verdict.UNEXPLAINED_GAP
    return wrong


def sharpened(power: float) -> FloatArray:
    """Overconfident: the logarithms of the ratios of the classes, times this."""
    raised = (TRUE + 1e-3) ** power
    return np.asarray(raised / raised.sum(axis=1, keepdims=True))


@pytest.mark.parametrize("draws", [20, DRAWS])
def test_a_right_model_is_called_wrong_in_one_of_twenty_sets_at_most(draws: int) -> None:
    wrong = called_wrong(lambda _: TRUE, 60, draws)
    assert wilson_interval(wrong, 60)[0] < 0.05


@pytest.mark.further
@pytest.mark.parametrize("draws", [20, DRAWS])
def test_of_many_sets_no_more_than_one_in_twenty(draws: int) -> None:
    assert wilson_interval(called_wrong(lambda _: TRUE, 1500, draws), 1500)[1] < 0.06


def test_probabilities_of_other_flights_are_noticed_though_the_totals_are_right() -> None:
    """In three of four sets of 28 flights (docs/gap_landings_judged.md); by totals alone in 1 %."""
    assert called_wrong(lambda rng: TRUE[rng.permutation(len(TRUE))], 40) > 40 * 0.6


def test_overconfidence_is_noticed() -> None:
    """Logarithms of ratios three times too large: in five of six sets of 28 flights."""
    assert called_wrong(lambda _: sharpened(3.0), 40) > 40 * 0.7


def test_few_flights_show_gross_errors_only() -> None:
    """Below ENOUGH flights overconfidence is missed more often than not, and what a lab is told says so."""
    assert called_wrong(lambda _: sharpened(3.0), 60, flights=5) < 60 * 0.4
    assert called_wrong(lambda _: sharpened(3.0), 60, flights=ENOUGH) > 60 * 0.4
    real = np.array([TWO, TWO, FOUR, TWO, TWO])
    shares = np.array([0.35, 0.5, 0.3, 0.45, 0.4])
    few, (said,) = told(np.column_stack([shares, 0.9 - shares, np.full(5, 0.1)]), real)
    assert few.brier_gain_ci95 is not None
    assert few.brier > few.brier_base_rate
    assert few.brier_gain_ci95[0] < 0.0 < few.brier_gain_ci95[1]
    assert "fewer than 15 show gross errors only" in said
    assert "as often as chance allows" in said
    assert "are right do" not in said
    assert said.endswith("no better than always guessing the base rate is shown")
    many, (said,) = told(np.where(np.arange(3) == np.tile(real, 4)[:, None], 0.8, 0.1), np.tile(real, 4))
    assert many.brier_gain_ci95 is not None
    assert many.brier_gain_ci95[1] < 0.0
    assert said.endswith("as probabilities that are right do")


def test_flights_that_all_ended_alike_are_held_against_no_base_rate() -> None:
    """The others' frequencies are sure of it without knowing anything."""
    alike, (said,) = told(np.tile([0.7, 0.2, 0.1], (20, 1)), np.full(20, FOUR))
    assert alike.brier_base_rate == 0.0
    assert alike.brier_gain is alike.brier_gain_ci95 is alike.auc_four is None
    assert "wrong about these landings: four 20 (expected 14.0)" in said
    _, (said,) = told(np.tile([0.9, 0.05, 0.05], (20, 1)), np.full(20, FOUR))
    assert said.endswith("; all ended alike, which no base rate can be compared on")


@pytest.mark.parametrize(
    ("share", "said"),
    [(0.7991, "80 %"), (0.0252, "3 %"), (0.0096, "1 %"), (0.00022, "0.02 %"), (0.0, "0 %"), (1.0, "100 %")],
)
def test_a_share_is_told_as_exactly_as_it_is_known(share: float, said: str) -> None:
    assert percent(share) == said


def test_an_end_that_is_rounded_to_zero_shows_its_side() -> None:
    assert difference(-0.1, (-0.2, 0.002)) == "-0.10 (-0.20 to +0.00)"
    assert difference(-0.1, (-0.2, -0.002)) == "-0.10 (-0.20 to -0.00)"


def test_the_expected_score_is_that_of_the_mean_over_the_classes() -> None:
    """Against the exact mean and standard deviation of independent flights."""
    rng = np.random.default_rng(1)
    said = simulated(TRUE, DRAWS, rng)
    found = expected_brier(said, np.zeros(len(said), dtype=np.int64), DRAWS, rng)
    by_class = np.stack([brier(said, np.full(len(said), k)) for k in range(3)], axis=1)
    share = smoothed(said, DRAWS)
    mean = (share * by_class).sum(axis=1)
    sigma = np.sqrt(((share * by_class**2).sum(axis=1) - mean**2).sum()) / len(said)
    assert found.mean == pytest.approx(mean.mean(), abs=4.0 * sigma / np.sqrt(4000))
    assert found.ci95 == pytest.approx((mean.mean() - 1.96 * sigma, mean.mean() + 1.96 * sigma), abs=0.02)


def test_one_landing_that_was_never_drawn_is_no_proof() -> None:
    """Of 20 landings a flight all held; one of 28 flights fell, as one in twenty-three might each time."""
    sure = np.tile([1.0, 0.0, 0.0], (28, 1))
    real = np.where(np.arange(28) == 3, NONE, FOUR)
    assert expected_brier(sure, real, 20, np.random.default_rng(0)).p_value > 0.5
    assert expected_brier(sure, real, 20_000, np.random.default_rng(0)).p_value < 0.01


def told(probability: FloatArray, real: IntArray) -> tuple[Score, tuple[str, ...]]:
    scored = score(probability, real, DRAWS, np.random.default_rng(0))
    return scored, in_words(judge_outcomes(scored, None), scored, None)


def test_a_lab_is_told_whether_totals_or_single_flights_disagree() -> None:
    """Half of the flights hold on four and half on two, as said in all but one of the cases."""
    real = np.where(np.arange(20) % 2 == 0, FOUR, TWO)
    right = np.where(np.arange(3) == real[:, None], 0.8, 0.1)
    _, (said,) = told(right, real)
    assert said.startswith("no gap that 20 flights can show")
    exchanged, (said,) = told(right[::-1], real)
    assert "of other flights: Brier 1.46, where" in said
    assert said.endswith("look for what is missing with --search")
    assert all(count.inside for count in exchanged.counts.values())
    _, (said,) = told(np.tile([0.4, 0.3, 0.3], (20, 1)), np.where(np.arange(20) % 4 == 0, FOUR, TWO))
    assert said.startswith(
        "the simulation is wrong about these landings: four 5 (expected 8.0), two 15 (expected 6.0)"
    )
    _, (first, second) = told(np.tile([0.98, 0.01, 0.01], (20, 1)), real)
    assert "four 10 (expected 19.6)" in first
    assert second.startswith("the simulation is wrong about single flights, too")
