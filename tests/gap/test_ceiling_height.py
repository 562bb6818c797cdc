"""A ceiling whose height somebody said, or a search found, is over the flights that are predicted, too."""

import dataclasses
import functools

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.under_ceiling import under_ceiling
from calibration.gap.estimate.acceptance import Judgement
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import refine, training_set
from calibration.gap.report.proof import proof
from calibration.gap.search.forward import Search
from calibration.gap.search.naming import Named
from calibration.gap.search.selection import SelectionStep
from onboard.room import CeilingError
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
CEILING = 1.3
UNDER_IT = Model(
    STOCK,
    {Variable("ceiling_effect", "inflow"): 1.0, Variable("ceiling_effect", "opening"): 0.2},
    CEILING,
)


@functools.cache
def climb() -> FlightRecord:
    """Towards a ceiling of which the record says nothing."""
    flown = fly(UNDER_IT.vehicle(), up_and_down(amplitude=0.15), 4.0, ceiling_z=CEILING, believed=STOCK)
    return with_noise(dataclasses.replace(flown, ceiling_z=None), 0.05, np.random.default_rng(1))


def test_a_name_is_proved_below_the_ceiling_that_it_is_of() -> None:
    training = training_set([climb()] * 3, UNDER_IT)
    final = refine(UNDER_IT, (), training, iterations=1)
    step = SelectionStep("ceiling_effect", Judgement(100.0, True, True, (), {}), final)
    found = Search(final, (step,), final, {}, {}, (), ())
    names = Named(("ceiling_effect",), (), UNDER_IT, UNDER_IT, {}, {}, (), {})
    proved = proof(found, names, training, [climb()], "a test", np.random.default_rng(1))
    levels = proved.by_names.overall
    assert levels.before > 0.02
    assert levels.after < 0.1 * levels.before


@pytest.mark.parametrize("told", [None, 2.0])
def test_whoever_says_how_high_the_ceiling_is_knows_better_than_the_record(told: float | None) -> None:
    known = dataclasses.replace(climb(), ceiling_z=CEILING)
    assert known.under(told).ceiling_z == (told or CEILING)


def test_a_ceiling_that_a_flight_goes_above_is_refused_with_both_heights() -> None:
    with pytest.raises(CeilingError, match=rf"{climb().name} flies at 1\.1\d m, above the ceiling at 1 m"):
        under_ceiling([climb()], 1.0)


@pytest.mark.parametrize(("jump_s", "refused"), [(0.05, False), (0.5, True)])
def test_a_pose_that_jumps_above_the_ceiling_is_no_flight_above_it(jump_s: float, refused: bool) -> None:
    position = climb().position.copy()
    position[100 : 100 + round(jump_s / climb().dt), 2] += 3.0
    jumped = dataclasses.replace(climb(), position=position)
    if refused:
        with pytest.raises(CeilingError):
            under_ceiling([jumped], CEILING)
    else:
        assert [record.ceiling_z for record in under_ceiling([jumped], CEILING)] == [CEILING]


def test_a_ceiling_a_little_below_the_flights_is_one_that_was_measured_otherwise() -> None:
    top = float(climb().position[:, 2].max())
    assert under_ceiling([climb()], top - 0.03)
