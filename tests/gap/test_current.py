"""A battery's resistance is known no better than the current through it."""

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import judge
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import refine, training_set
from calibration.gap.search.forward import Search
from calibration.gap.search.naming import Named, name_effects
from calibration.gap.search.selection import SelectionStep
from tests.gap.mujoco_flights import flights, frame
from tests.truth.airframe import nominal
from tests.truth.mujoco_room import Hidden

SCALE, RESISTANCE = Variable("thrust_scale", "scale"), Variable("battery_sag", "resistance")


def named(hidden: Hidden) -> Named:
    """What of a scale and a resistance that a search took in gets a name."""
    model, rng = Model(nominal(frame(), "current")), np.random.default_rng(1)
    training = training_set(flights(hidden), model)
    first, scaled = refine(model, (), training), refine(model, (SCALE,), training)
    both = refine(scaled.model, (SCALE, RESISTANCE), training, start=scaled)
    steps = (
        SelectionStep(SCALE.effect, judge(first, scaled, [SCALE], training, rng), scaled),
        SelectionStep(RESISTANCE.effect, judge(scaled, both, [RESISTANCE], training, rng), both),
    )
    assert steps[1].judgement.significant  # the voltage, beyond doubt, is not that of the model
    return name_effects(Search(first, steps, both, {}, {}, (), ()), training)


@pytest.mark.further
def test_what_weak_motors_draw_is_no_resistance() -> None:
    names = named(Hidden(thrust_scale=0.9))  # these motors draw the current of their commands
    assert names.effects == ("thrust_scale",)
    assert names.minor == ()


@pytest.mark.further
def test_a_resistance_beyond_that_is_named_and_its_interval_holds() -> None:
    resistance = 0.8 * frame().resistance
    names = named(Hidden(thrust_scale=0.9, resistance=resistance))
    assert names.effects == ("thrust_scale", "battery_sag")
    found = names.model.values[RESISTANCE]
    assert abs(found - resistance) < 1.96 * names.errors[RESISTANCE]
    assert found == pytest.approx(resistance, rel=0.3)
