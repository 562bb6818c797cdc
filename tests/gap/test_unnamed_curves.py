"""What was found without a name, in the vehicle file: as large as the truth, or refused with its reason."""

import dataclasses
import json
import tomllib
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.gap.data.channels import BY_NAME, attitudes
from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, UnnamedTerm, refine, training_set
from calibration.gap.estimate.shared_nuisances import shared_nuisances
from calibration.gap.replay import evaluate
from calibration.gap.search.naming import Named
from calibration.gap.search.retest import FAILED
from calibration.gap.search.unnamed_curves import (
    NO_FLIGHT,
    NO_ROOM,
    UNCONFIRMED,
    UnnamedCurves,
    unnamed_curves,
)
from calibration.gap.unnamed.curves import OWN_PHASE
from calibration.gap.unnamed.regressors import Regressor, regressors
from calibration.gap.unnamed.terms import interval_term, line_term, polynomial_term
from onboard.vehicle import Vehicle, load_vehicle, vehicle_to_toml
from onboard.vehicle.file_format import parse_vehicle
from onboard.vehicle.unnamed import MOST_CURVES, REGRESSORS, UnnamedCurve
from perchhw.cli.main import run
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise
from tests.truth.hidden_effects.campaign import make_flights
from tests.truth.hidden_effects.cases import hide
from tests.truth.hidden_effects.flight import hidden_flight
from tests.truth.hidden_effects.layout import nominal
from tests.truth.hidden_effects.log_file import write_log
from tests.truth.hidden_effects.shapes import campaign

STOCK = load_vehicle("crazyflie21-stock")
MODEL = Model(STOCK)
MASS = STOCK.body.mass.value
PUSH, DRAG = 0.5, -0.3
"""m/s2 along world y in the slab; m/s2 per m/s of forward speed."""


def curve(channel: str, regressor: str, knots: tuple[float, ...], values: tuple[float, ...]) -> UnnamedCurve:
    return UnnamedCurve(
        channel=channel, regressor=regressor, knots=knots, values=values, sigma=0.0, source="hidden"
    )


SLAB = curve("world_force_y", "x", (0.1, 0.101, 0.3, 0.301), (0.0, PUSH * MASS, PUSH * MASS, 0.0))
SLOPE = curve("force_x", "velocity_x", (-3.0, 3.0), (-3.0 * DRAG * MASS, 3.0 * DRAG * MASS))


def flown(truth: Vehicle, first: int, count: int) -> list[FlightRecord]:
    """Flights of 12 s of a vehicle; circles that differ, each with noise of its own."""
    records = []
    for n in range(first, first + count):
        path = circle(radius=0.45 + 0.05 * (n % 4), period=3.0 + 0.5 * (n % 3))
        record = fly(truth, path, shape=f"shape {n}", name=f"flight {n}", believed=STOCK)
        records.append(with_noise(record, 0.5, np.random.default_rng(n)))
    return records


@cache
def fitted_to(*hidden: UnnamedCurve) -> list[FlightRecord]:
    return flown(STOCK.with_unnamed(hidden), 0, 4)


@cache
def kept_back(*hidden: UnnamedCurve) -> list[FlightRecord]:
    return flown(STOCK.with_unnamed(hidden), 4, 2)


def along(records: Sequence[FlightRecord], name: str) -> Regressor:
    return next(one for one in regressors(records) if one.name == name)


def slab(records: Sequence[FlightRecord]) -> UnnamedTerm:
    return interval_term(BY_NAME["world_force_y"], along(records, "x"), (0.1, 0.3), attitudes(records))


def power(records: Sequence[FlightRecord], channel: str, name: str, degree: int = 1) -> UnnamedTerm:
    return polynomial_term(BY_NAME[channel], along(records, name), 0.0, degree, attitudes(records))


def fit(records: Sequence[FlightRecord], *terms: UnnamedTerm) -> Fitted:
    return refine(MODEL, (), training_set(records, MODEL), unnamed=terms)


def named(model: Model = MODEL, **changes: Any) -> Named:
    nothing = Named(
        effects=(),
        minor=(),
        model=model,
        improved=model,
        errors={},
        ambiguous={},
        unconfirmed=(),
        rejected={},
    )
    return dataclasses.replace(nothing, **changes)


def written(fitted: Fitted, unseen: Sequence[FlightRecord], names: Named | None = None) -> UnnamedCurves:
    return unnamed_curves(names or named(fitted.model), fitted, unseen, "a test")


def position_error(records: Sequence[FlightRecord], vehicle: Vehicle) -> float:
    error = evaluate(records, vehicle).overall.given_attitude[1.0].position_m
    assert error is not None
    return error


def test_a_force_in_a_slab_is_written_and_shrinks_the_error_of_flights_that_no_fit_saw() -> None:
    records, unseen = fitted_to(SLAB), kept_back(SLAB)
    found = written(fit(records, slab(records)), unseen)
    (one,) = found.curves.values()
    assert found.refused == {}
    assert (one.channel, one.regressor) == ("world_force_y", "x")
    assert one.knots == pytest.approx(SLAB.knots, abs=0.02)
    assert one.values == pytest.approx(SLAB.values, abs=0.05 * PUSH * MASS)
    assert one.sigma < 0.1 * PUSH * MASS
    assert one.source.startswith("a test; without a name: ")
    improved = STOCK.with_unnamed([one])
    assert parse_vehicle(tomllib.loads(vehicle_to_toml(improved)), "copy") == improved
    assert position_error(unseen, improved) < 0.3 * position_error(unseen, STOCK)


@pytest.mark.parametrize("degree", [1, 3])
def test_a_curve_in_speed_is_written_over_the_range_that_was_flown(degree: int) -> None:
    records, unseen = fitted_to(SLOPE), kept_back(SLOPE)
    found = written(fit(records, power(records, "force_x", "velocity_x", degree)), unseen)
    (one,) = found.curves.values()
    flown_speeds = along(records, "velocity_x").values
    assert one.knots[0] > np.nanmin(flown_speeds)
    assert one.knots[-1] < np.nanmax(flown_speeds)
    assert one.values == pytest.approx([DRAG * MASS * knot for knot in one.knots], abs=0.1 * MASS)
    assert position_error(unseen, STOCK.with_unnamed([one])) < 0.5 * position_error(unseen, STOCK)


def test_the_curve_of_a_heavier_vehicle_is_the_force_that_moves_it_as_much() -> None:
    """The flights show accelerations: with a mass error in the same file the force is that much larger."""
    records, unseen = fitted_to(SLAB), kept_back(SLAB)
    plain = fit(records, slab(records))
    heavy = Model(STOCK, {Variable("mass_error", "relative"): 0.25})
    (one,) = unnamed_curves(named(heavy), plain, unseen, "a test").curves.values()
    (other,) = written(plain, unseen).curves.values()
    assert max(one.values) == pytest.approx(1.25 * max(other.values))


TRIM, LEAN = curve("torque_y", "z", (0.0, 1.0), (1.5e-4,) * 2), curve("force_x", "z", (0.0, 1.0), (0.02,) * 2)
"""N m and N in every flight, wherever it is."""


def test_a_trim_that_all_flights_share_is_written_and_turns_flights_that_no_fit_saw() -> None:
    records, unseen = fitted_to(TRIM), kept_back(TRIM)
    (one,) = written(fit(records), unseen).curves.values()
    assert one.channel == "torque_y"
    assert one.values == pytest.approx(TRIM.values, rel=0.1)
    told = [evaluate(unseen, vehicle).by_channel()[0.5] for vehicle in (STOCK, STOCK.with_unnamed([one]))]
    assert told[1]["rate_y_rad_s"] < 0.5 * told[0]["rate_y_rad_s"]
    improved = STOCK.with_unnamed([one])
    assert parse_vehicle(tomllib.loads(vehicle_to_toml(improved)), "copy") == improved


def test_a_force_in_all_flights_is_not_written_as_it_may_be_the_accelerometer_s() -> None:
    records, unseen = fitted_to(LEAN), kept_back(LEAN)
    fitted = fit(records)
    assert [one.name for one in shared_nuisances(fitted, STOCK)] == ["force_bias_x"]
    assert written(fitted, unseen) == UnnamedCurves({}, {})


def test_a_trim_that_flights_kept_back_do_not_have_is_refused() -> None:
    found = written(fit(fitted_to(TRIM)), kept_back())
    assert (found.curves, list(found.refused.values())) == ({}, [FAILED])


def test_what_flights_kept_back_do_not_bear_out_is_not_written() -> None:
    records = fitted_to(SLAB)
    found = written(fit(records, slab(records)), kept_back())
    assert found.curves == {}
    (reason,) = found.refused.values()
    assert reason == FAILED


def test_what_no_vehicle_file_can_say_is_refused_with_its_reason() -> None:
    records, unseen = fitted_to(SLAB), kept_back(SLAB)
    line = line_term(BY_NAME["torque_x"], 4.0, training_set(records, MODEL).regression.signals)
    duty = power(records, "force_z", "collective")
    found = written(fit(records, slab(records), line, duty), unseen)
    assert [one.channel for one in found.curves.values()] == ["world_force_y"]
    of_line, of_duty = found.refused.values()
    assert of_line == OWN_PHASE
    assert of_duty == "mean duty is no state of the simulated flight"


def test_without_flights_to_confirm_it_nothing_is_written() -> None:
    records, unseen = fitted_to(SLAB), kept_back(SLAB)
    fitted = fit(records, slab(records))
    full = STOCK.with_unnamed([dataclasses.replace(SLAB, values=(0.0,) * 4)] * MOST_CURVES)
    for names, flights, reason in (
        (named(), (), NO_FLIGHT),
        (named(unconfirmed=("wind",)), unseen, UNCONFIRMED),
        (named(Model(full)), unseen, NO_ROOM),
    ):
        found = unnamed_curves(names, fitted, flights, "a test")
        assert found.curves == {}
        assert list(found.refused.values()) == [reason]


def test_every_regressor_of_the_file_is_one_that_the_search_looks_along() -> None:
    record = dataclasses.replace(fly(STOCK, up_and_down(), 3.0), ceiling_z=2.0)
    known = {one.name: one.unit for one in regressors([record])}
    assert {name: known[name] for name in REGRESSORS} == REGRESSORS


Answer = dict[str, Any]


@pytest.fixture
def answer(capsys: pytest.CaptureFixture[str]) -> Callable[..., Answer]:
    """What a command of perchhw says to programs."""

    def of(*words: str) -> Answer:
        capsys.readouterr()
        assert run(["--json", *words]) == 0
        said: Answer = json.loads(capsys.readouterr().out)
        return said

    return of


@pytest.mark.soak
def test_a_slab_of_another_program_is_found_written_and_flown(
    tmp_path: Path, answer: Callable[..., Answer]
) -> None:
    """From flights of the truth program to a vehicle file that predicts its other flights."""
    case, size, seed = "unlisted_force_region", "medium", 200
    make_flights(case, size, seed, 12, out=tmp_path / "flights", answer=tmp_path / "answer.json")
    truth = hide(case, size, seed, nominal("crazyflie21-stock"))
    (tmp_path / "new").mkdir()
    for number, (name, shape) in enumerate(campaign(6)):
        flight = hidden_flight(truth.vehicle, name, shape, seed + 1000, number)
        write_log(tmp_path / "new" / f"{name}.csv", flight.log)
    data = ("--data", str(tmp_path / "flights"))
    report = answer("gap", "find", "--vehicle", "crazyflie21-stock", "--out", str(tmp_path / "out"), *data)
    assert report["verdict"] == "unexplained_gap"
    assert report["effects"] == []
    (formula,) = report["nameless"]["written"]
    assert "N along world y where" in formula
    closes = report["nameless"]["closes"]
    assert closes["after"] < closes["before"]
    file = str(tmp_path / "out" / "vehicle.toml")
    before, after = (
        answer("gap", "evaluate", "--vehicle", vehicle, "--data", str(tmp_path / "new"))
        for vehicle in ("crazyflie21-stock", file)
    )
    told = [one["given_attitude"]["1.0"]["position_m"] for one in (before, after)]
    assert told[1] < 0.85 * told[0]  # of 5 cm, chance alone makes 4 (docs/gap.md)
    rows = answer("vehicle", "diff", "crazyflie21-stock", file)["differences"]
    (inside, *_) = [row for row in rows if abs(row["second"]["value"]) > 0.0]
    assert inside["key"].startswith("unnamed[0]: world_force_y at x = ")
    low, high = truth.unlisted["range_m"]
    assert [row["first"] for row in rows] == [None] * 4
    newton = truth.unlisted["acceleration_m_s2"] * MASS
    assert inside["second"]["value"] == pytest.approx(newton, rel=0.15)
    assert low - 0.02 < float(inside["key"].split()[-2]) < high
