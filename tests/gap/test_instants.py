"""A string, or a ceiling of unknown height, is found from what it does at single instants."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import FORCE, stack_signals
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.search.candidates import candidates
from calibration.gap.search.instants import Instants
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down

STOCK = load_vehicle("crazyflie21-stock")


@cache
def records() -> list[FlightRecord]:
    return [fly(STOCK, circle(), 12.0), fly(STOCK, up_and_down(), 12.0)]


def instants_of(truth: Model, base: Model) -> Instants:
    """What `truth` adds to the forces on the flights, with noise, is the misfit of `base`."""
    signals = stack_signals(records())
    misfit = truth.predict(records()) - base.predict(records())
    misfit[:, FORCE] += np.random.default_rng(2).normal(0.0, 0.05, misfit[:, FORCE].shape)
    return Instants(base, records(), signals, np.where(signals.valid, misfit, 0.0))


def best(instants: Instants, base: Model, effect: str) -> Model:
    candidate = next(c for c in candidates(base, records()) if c.effect == effect)
    return min(
        (
            instants.settled(start, candidate.variables, effect == "ceiling_effect")
            for start in candidate.starts
        ),
        key=lambda f: f[0],
    )[1]


@pytest.mark.parametrize("anchor", [(-0.8, 0.9, 0.2), (0.1, 0.2, 2.6), (1.5, 0.0, 1.0)])
def test_a_string_is_found_wherever_it_is_tied(anchor: tuple[float, float, float]) -> None:
    base = Model(STOCK)
    tied = dict(zip(("x", "y", "z", "length", "stiffness"), (*anchor, 0.7, 0.08), strict=True))
    truth = base.with_values({Variable("tether", k): x for k, x in tied.items()})
    found = best(instants_of(truth, base), base, "tether").values
    for key, value in tied.items():
        assert found[Variable("tether", key)] == pytest.approx(
            value, abs=0.08 if key != "stiffness" else 0.006
        )


def test_a_ceiling_is_found_at_its_height_though_nobody_said_it() -> None:
    base = Model(STOCK)
    top = (
        max(float(record.position[:, 2].max()) for record in records()) + STOCK.body.propeller_height_z.value
    )
    values = {Variable("ceiling_effect", "inflow"): 1.0, Variable("ceiling_effect", "opening"): 0.3}
    truth = dataclasses.replace(base, values=values, ceiling_z=top + 0.04)
    found = best(instants_of(truth, base), base, "ceiling_effect")
    assert found.ceiling_z == pytest.approx(top + 0.04, abs=0.015)
    near = [m.predict(records())[:, FORCE] - base.predict(records())[:, FORCE] for m in (truth, found)]
    assert np.abs(near[1] - near[0]).max() < 0.1 * np.abs(near[0]).max()


def test_flights_without_forces_leave_every_start_as_it_is() -> None:
    base = Model(STOCK)
    blind = [
        dataclasses.replace(record, specific_force=None, pose_known=np.zeros(record.t.size, dtype=np.bool_))
        for record in records()
    ]
    signals = stack_signals(blind)
    instants = Instants(base, blind, signals, np.zeros(signals.measured.shape))
    candidate = next(c for c in candidates(base, blind) if c.effect == "ceiling_effect")
    for start in candidate.starts:
        assert instants.settled(start, candidate.variables) == (0.0, start)


def test_nothing_is_made_of_noise() -> None:
    base = Model(STOCK)
    found = best(instants_of(base, base), base, "tether")
    added = found.predict(records())[:, FORCE] - base.predict(records())[:, FORCE]
    assert np.sqrt(np.mean(added**2)) < 0.02
