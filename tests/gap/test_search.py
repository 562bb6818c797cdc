"""Hidden effects are named from the flights of a program that shares no equation with the finder.

Each case here is one seed of the matrix in ``benchmarks/gap.py``, with eight flights instead of twenty.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import open_flights
from calibration.gap.model import Model
from calibration.gap.naming import Named, name_effects
from calibration.gap.prepare import prepare_flights
from calibration.gap.refine import training_set
from calibration.gap.search import search
from onboard.vehicle import load_vehicle
from tests.gap.truth.campaign import make_flights

FLIGHTS = 8


def find(case: str, size: str, seed: int, folder: Path) -> tuple[Named, dict[str, dict[str, float]]]:
    answer = folder / "answer.json"
    files = make_flights(case, size, seed, FLIGHTS, out=folder / "flights", answer=answer)
    records = prepare_flights(open_flights(files)[0]).records
    model, rng = Model(load_vehicle("crazyflie21-stock")), np.random.default_rng(seed)
    training = training_set(records, model)
    names = name_effects(search(model, training, rng), training, rng)
    sealed = json.loads(answer.read_text())
    return names, {effect["name"]: effect["parameters"] for effect in sealed["effects"]}


@pytest.mark.parametrize("case", ["rotor_drag", "motor_lag"])
def test_a_hidden_effect_is_named_first_and_measured(case: str, tmp_path: Path) -> None:
    names, truth = find(case, "strong", 7, tmp_path)
    assert names.effects[0] == case
    for variable, value in names.model.values.items():
        if variable.effect == case and abs(truth[case][variable.parameter]) > variable.practical_minimum:
            assert value == pytest.approx(truth[case][variable.parameter], rel=0.06)


def test_nothing_is_named_where_nothing_is_hidden(tmp_path: Path) -> None:
    names, truth = find("none", "medium", 8, tmp_path)
    assert truth == {}
    assert names.effects == ()
