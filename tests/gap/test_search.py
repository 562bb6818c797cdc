"""Hidden effects are named from the flights of a program that shares no equation with the finder.

Each case here is one seed of the matrix in ``benchmarks/gap.py``, with eight flights instead of twenty.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.flights import open_flights
from calibration.gap.data import prepare_flights
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import training_set
from calibration.gap.search.forward import Search, search
from calibration.gap.search.naming import Named, name_effects
from calibration.gap.search.selection import SearchContext
from onboard.vehicle import load_vehicle
from tests.truth.hidden_effects.campaign import make_flights

FLIGHTS = 8


def searched(case: str, size: str, seed: int, folder: Path) -> tuple[Search, Named, dict[str, Any]]:
    """What the search finds, what of it has a name, and the sealed answer."""
    answer = folder / "answer.json"
    files = make_flights(case, size, seed, FLIGHTS, out=folder / "flights", answer=answer)
    records = prepare_flights(open_flights(files)[0]).records
    model, rng = Model(load_vehicle("crazyflie21-stock")), np.random.default_rng(seed)
    training = training_set(records, model)
    found = search(model, SearchContext(training, rng))
    return found, name_effects(found, training), json.loads(answer.read_text())


def find(case: str, size: str, seed: int, folder: Path) -> tuple[Named, dict[str, dict[str, float]]]:
    _, names, sealed = searched(case, size, seed, folder)
    return names, {effect["name"]: effect["parameters"] for effect in sealed["effects"]}


@pytest.mark.soak  # test_find.py has the same of the command
def test_a_hidden_effect_is_named_first_and_measured(tmp_path: Path) -> None:
    case = "rotor_drag"
    names, truth = find(case, "strong", 7, tmp_path)
    assert names.effects[0] == case
    for variable, value in names.model.values.items():
        if (
            variable.effect == case
            and abs(truth[case][variable.parameter]) > names.model.rule(variable).practical_minimum
        ):
            assert value == pytest.approx(truth[case][variable.parameter], rel=0.06)


@pytest.mark.soak
def test_thrust_that_falls_as_motors_warm_is_named_alone_and_measured(tmp_path: Path) -> None:
    names, truth = find("motor_warming", "medium", 52, tmp_path)
    assert names.effects == ("motor_warming",)
    loss = Variable("motor_warming", "loss")
    assert names.model.values[loss] == pytest.approx(truth[loss.effect][loss.parameter], rel=0.25)


@pytest.mark.soak
def test_nothing_is_named_where_nothing_is_hidden(tmp_path: Path) -> None:
    names, truth = find("none", "medium", 8, tmp_path)
    assert truth == {}
    assert names.effects == ()


@pytest.mark.soak
def test_a_line_has_a_phase_of_its_own_on_each_flight_and_is_found(tmp_path: Path) -> None:
    found, names, sealed = searched("unlisted_torque_line", "strong", 7, tmp_path)
    line = found.unnamed[0].structure.line
    assert line is not None
    assert line.channel.name == sealed["unlisted"]["channel"]
    assert line.frequency == pytest.approx(sealed["unlisted"]["frequency_hz"], abs=0.02)
    assert names.effects == ()
