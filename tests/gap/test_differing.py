"""A wind that blew on some of the flights is said flight by flight; one that always blew is not; and what
belongs to the vehicle has no name where it seems to come and go."""

import numpy as np
import pytest

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.acceptance import clustered_errors
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, refine, training_set
from calibration.gap.search.always import LOG_TIMING
from calibration.gap.search.credible import what_speaks_against
from calibration.gap.search.differing import another_in_each, differing, in_words
from calibration.gap.search.forward import search
from calibration.gap.search.selection import SearchContext
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
DRAG, WIND = Variable("rotor_drag", "coefficient"), (Variable("wind", "x"), Variable("wind", "y"))


def fitted(winds: list[float]) -> Fitted:
    """Flights of a vehicle with a known drag in these winds (m/s, along x), and one wind for all of them."""
    rng = np.random.default_rng(5)
    paths = (circle(), up_and_down(), circle(period=3.0), up_and_down(period=2.0))
    records = []
    for n, wind in enumerate(winds):
        truth = Model(STOCK, {DRAG: 2e-6, WIND[0]: wind}).vehicle()
        record = fly(truth, paths[n], 12.0, shape=f"shape {n}", name=f"flight {n}", believed=STOCK)
        records.append(with_noise(record, 0.5, rng))
    known = Model(Model(STOCK, {DRAG: 2e-6}).vehicle())
    return refine(known, WIND, training_set(records, known))


def test_a_wind_that_blew_on_two_flights_of_four_differs() -> None:
    winds = [0.0, 2.0, 0.0, 2.0]
    (one,) = differing(fitted(winds), ["wind"])
    assert one.variable == WIND[0]
    assert one.values == pytest.approx(np.array(winds), abs=0.3)
    assert one.scatter == pytest.approx(1.0, rel=0.3)
    sentence = in_words(one, "m/s", [f"flight {n}" for n in range(4)])
    assert "wind differs between flights" in sentence
    assert "flight 1 2" in sentence or "flight 1 1.9" in sentence


def test_one_wind_for_all_does_not() -> None:
    assert differing(fitted([2.0, 2.0, 2.0, 2.0]), ["wind"]) == ()


@pytest.mark.further
def test_a_drag_cannot_come_and_go_as_a_wind_can() -> None:
    """Of four laps, slower and slower, the first and the last are with the drag of the rotors."""
    rng = np.random.default_rng(6)
    records = []
    for n in range(4):
        truth = Model(STOCK, {DRAG: 2e-6 if n in (0, 3) else 0.0}).vehicle()
        record = fly(truth, circle(period=2.5 + 0.2 * n), 12.0, name=f"flight {n}", believed=STOCK)
        records.append(with_noise(record, 0.5, rng))
    training = training_set(records, Model(STOCK))
    fit = refine(Model(STOCK), (DRAG,), training)
    errors = clustered_errors(fit, training)
    assert another_in_each([DRAG], fit, errors) == (DRAG,)
    assert "another in each flight" in (what_speaks_against([DRAG], fit, errors) or "")
    found = search(Model(STOCK), SearchContext(training, np.random.default_rng(1)))
    assert found.final.model.effects == (LOG_TIMING.effect,)
    assert any("another in each flight" in reason for reason in found.refused.values())

    blown = fitted([0.0, 2.0, 0.0, 2.0])
    assert differing(blown, ["wind"])
    assert another_in_each(blown.variables, blown, dict.fromkeys(blown.variables, 0.1)) == ()


def test_a_flight_that_hardly_tells_says_nothing_of_the_others() -> None:
    """Where nothing is commanded a law looks weaker than it is: not as if the vehicle had another."""
    blown = fitted([2.0, 2.0, 0.0, 0.0])
    assert differing(blown, ["wind"])
    fit = blown.estimate.fit
    for array in (fit.score, fit.information):
        array[2 * PARTS :] *= 1e-3  # what excitation_weights leaves of quiet flights, and they turn less
    assert differing(blown, ["wind"]) == ()


def test_a_small_axis_that_scatters_leaves_the_name_to_the_others() -> None:
    """A moment by forward speed that is there in every second flight, beside one by sideways speed in all."""
    rng = np.random.default_rng(7)
    roll, pitch = axes = Variable("velocity_moment", "roll"), Variable("velocity_moment", "pitch")
    records = []
    for n in range(4):
        truth = Model(STOCK, {roll: 3e-4, pitch: 6e-5 * (n % 2)}).vehicle()
        record = fly(truth, circle(period=2.5 + 0.1 * n), 12.0, name=f"flight {n}", believed=STOCK)
        records.append(with_noise(record, 0.5, rng))
    training = training_set(records, Model(STOCK))
    fit = refine(Model(STOCK), axes, training)
    (one,) = differing(fit, ["velocity_moment"])
    assert one.variable == pitch
    # As where one flight of shakes tells more than the others together: its scatter makes it no better known.
    assert another_in_each(axes, fit, {roll: 3e-5, pitch: 6e-6}) == ()
    assert another_in_each(axes, fit, {roll: 3e-4, pitch: 6e-6}) == (pitch,)


def test_only_what_has_a_name_is_told() -> None:
    assert differing(fitted([0.0, 2.0, 0.0, 2.0]), ["rotor_drag"]) == ()
