"""The score of a search over outcomes that chooses its model without the flights that are predicted."""

import numpy as np

from calibration.gap.landings.outcomes.nested import NestedScore, nested_score
from calibration.gap.landings.outcomes.search import OutcomeSearch, search_outcomes
from calibration.gap.landings.outcomes.vehicles import WITHOUT
from calibration.gap.report.landing_scores import search_table
from onboard.arrays import FloatArray, IntArray
from onboard.json_file import as_json

FLIGHTS, DRAWS = 12, 200
REAL = np.arange(FLIGHTS) % 2
POINTS = [
    WITHOUT,
    WITHOUT._replace(speed=0.6, spread=0.4),
    WITHOUT._replace(preload=2.0, preload_spread=0.5),
    WITHOUT._replace(damping=8.0),
    WITHOUT._replace(reach=0.3),
]


def scored(table: FloatArray, real: IntArray) -> tuple[OutcomeSearch, NestedScore]:
    found = search_outcomes(POINTS, table, real, DRAWS, np.random.default_rng(0))
    return found, nested_score(found, POINTS, table, real, DRAWS, np.random.default_rng(1))


def noise(seed: int) -> FloatArray:
    """Vehicles that know nothing: which one predicts these flights best is luck."""
    return np.random.default_rng(seed).dirichlet([2.0, 2.0, 0.3], (len(POINTS), FLIGHTS))


def test_what_is_said_of_a_flight_does_not_hang_on_how_it_ended() -> None:
    """Neither by the vehicles nor by the model; that of the best of all models does."""
    flight = 7
    other = REAL.copy()
    other[flight] = 1 - other[flight]
    (found, nested), (again, nested_again) = scored(noise(3), REAL), scored(noise(3), other)
    np.testing.assert_array_equal(nested.left_out[flight], nested_again.left_out[flight])
    assert found.best.groups != again.best.groups


def test_a_model_that_luck_chose_scores_worse_where_it_is_chosen_anew() -> None:
    kind, honest = np.mean(
        [
            (found.best.left_one_out.log_score, nested.left_one_out.log_score)
            for found, nested in (scored(noise(seed), REAL) for seed in range(6))
        ],
        axis=0,
    )
    assert honest > kind + 0.02


def test_a_model_that_knows_is_chosen_by_all_and_scores_the_same() -> None:
    knows = np.where(np.arange(3) == REAL[:, None], 0.9, 0.05)
    table = np.stack([np.tile([0.9, 0.05, 0.05], (FLIGHTS, 1))] * len(POINTS))
    table[1] = knows
    found, nested = scored(table, REAL)
    assert nested.chosen == {found.best.name: FLIGHTS}
    assert list(nested.chosen_by_halves.values()) == [40]
    np.testing.assert_allclose(nested.left_out, found.best.left_out)
    *_, row = search_table(found, nested).split("<tr>")
    assert f"{found.best.name} {FLIGHTS} times" in row  # the page names it, too
    assert nested.left_one_out.brier == found.best.left_one_out.brier
    assert nested.halves == nested.halves_of_best
    document = as_json(nested)
    assert document["chosen"] == {"pads": FLIGHTS}
    assert document["halves"]["brier"] < 0.1
    assert "left_out" not in document
