"""What no name fits gets no name, and yet a place in the model; two names that are one cause become one."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from calibration.gap.data.channels import BY_NAME, attitudes
from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.conclusion import concluded
from calibration.gap.search.forward import Search, search_on
from calibration.gap.search.naming import contains_nothing
from calibration.gap.search.selection import SearchContext
from calibration.gap.unnamed.curves import worded_terms
from calibration.gap.unnamed.regressors import regressors
from calibration.gap.unnamed.terms import polynomial_term
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle, load_vehicle
from onboard.vehicle.unnamed import UnnamedCurve
from sim_backend.physics.parameters import physics_parameters
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
PARAMETERS = physics_parameters(STOCK, RoomGeometry(ceiling_z=1e3))
MASS = STOCK.body.mass.value
DRAG = (Variable("linear_drag", "x"), Variable("linear_drag", "y"), Variable("linear_drag", "z"))
MOMENT = (Variable("velocity_moment", "roll"), Variable("velocity_moment", "pitch"))
ROTORS = Variable("rotor_drag", "coefficient")


def flown(truth: Vehicle, first: int = 0, count: int = 6) -> list[FlightRecord]:
    """Flights of 12 s, circles and climbs that differ, each with noise of its own."""
    paths = [circle(radius=0.45 + 0.06 * n, period=3.0 + 0.3 * n) for n in range(4)]
    paths += [up_and_down(), up_and_down(period=2.0)]
    records = []
    for n in range(first, first + count):
        record = fly(truth, paths[n % 6], shape=f"shape {n % 6}", name=f"flight {n}", believed=STOCK)
        records.append(with_noise(record, 0.5, np.random.default_rng(n)))
    return records


def bump() -> UnnamedCurve:
    """0.8 m/s2 along world x where y is about 0.3 m, as from a fan beside the room."""
    knots = np.linspace(-0.6, 0.8, 12)
    values = 0.8 * MASS * np.exp(-(((knots - 0.3) / 0.2) ** 2))
    return UnnamedCurve(
        channel="world_force_x", regressor="y", knots=tuple(knots.tolist()), values=tuple(values.tolist()),
        sigma=0.0, source="hidden",
    )  # fmt: skip


@cache
def disturbed() -> tuple[Training, list[FlightRecord]]:
    truth = STOCK.with_unnamed([bump()])
    return training_set(flown(truth), Model(STOCK)), flown(truth, 6, 4)


@cache
def slowed() -> Training:
    return training_set(flown(Model(STOCK, dict.fromkeys(DRAG, 0.02)).vehicle()), Model(STOCK))


def largest_error(fitted: Fitted, truth: UnnamedCurve) -> float:
    """Of what a fit has without a name, summed, against the force that was flown: N."""
    y, told = np.linspace(-0.4, 0.55, 50), np.zeros(50)
    for term in worded_terms(fitted, PARAMETERS, "a test"):
        assert term.curve is not None
        if term.curve.channel not in ("force_x", "world_force_x"):  # nobody turned
            assert np.ptp(term.curve.values) < 0.05 * MASS  # of no consequence
            continue
        assert term.curve.regressor == "y"
        told += np.interp(y, term.curve.knots, term.curve.values)
    return float(np.abs(told - np.interp(y, truth.knots, truth.values)).max())


@pytest.mark.soak  # the curve alone: tests/gap/test_unnamed.py
def test_a_force_that_comes_and_goes_softly_is_measured() -> None:
    training, unseen = disturbed()
    found, names = concluded(Model(STOCK), training, unseen, np.random.default_rng(1))
    assert names.effects == ()
    assert largest_error(found.final, bump()) < 0.15 * 0.8 * MASS


def test_a_torque_that_grows_with_a_place_is_written_with_what_it_is_there() -> None:
    """A term tells how it changes, and each flight's trim takes the rest: the vehicle file needs both."""
    knots, slope = (-1.0, 1.0), 0.02 * STOCK.body.arm_y.value * MASS * 9.81
    hidden = UnnamedCurve(
        channel="torque_x", regressor="y", knots=knots, values=tuple(slope * (y + 2.0) for y in knots),
        sigma=0.0, source="hidden",
    )  # fmt: skip
    records = flown(STOCK.with_unnamed([hidden]))
    training = training_set(records, Model(STOCK))
    place = next(one for one in regressors(records) if one.name == "y")
    term = polynomial_term(BY_NAME["torque_x"], place, 0.0, 1, attitudes(records))
    fitted = refine(Model(STOCK), [Variable("motor_lag", "scale")], training, unnamed=[term])
    (written,) = worded_terms(fitted, PARAMETERS, "a test")
    assert written.curve is not None
    assert "everywhere" in written.formula
    assert written.curve.values == pytest.approx([slope * (y + 2.0) for y in written.curve.knots], rel=0.03)


def search_without(training: Training, *barred: str) -> Search:
    """What a search that may not take these comes to, from nothing."""
    rng, nothing = np.random.default_rng(1), refine(Model(STOCK), (), training)
    start = Search(nothing, (), nothing, {}, {}, (), ())
    context = SearchContext(training, rng, barred=dict.fromkeys(barred, "given up"))
    return search_on(start, nothing, context)


@pytest.mark.further
def test_what_was_given_up_leaves_no_room_for_the_nearest_name() -> None:
    on = search_without(slowed(), "linear_drag", "rotor_drag")
    assert on.final.model.effects == ()  # no wind, no battery, no drag of the body
    assert on.refused["linear_drag"] == "given up"


@pytest.mark.soak
def test_what_was_given_up_leaves_room_for_what_has_no_name() -> None:
    training, _ = disturbed()
    on = search_without(training, "wind", "tether", "body_drag")
    assert not {"wind", "tether", "body_drag"} & set(on.final.model.effects)
    assert largest_error(on.final, bump()) < 0.15 * 0.8 * MASS


@pytest.mark.soak
def test_two_names_that_undo_part_of_each_other_are_one_cause() -> None:
    """Drag at the centre of mass is drag at the rotors with a moment, and a plain drag alone."""
    names = concluded(Model(STOCK), slowed(), [], np.random.default_rng(1))[1]
    assert names.effects == ("linear_drag",)


@pytest.mark.parametrize(
    ("variables", "sigmas", "nothing"),
    [
        (DRAG, 2.2, True),  # one of three is that far off by chance once in eleven times
        (DRAG, 2.6, False),
        (DRAG[:1], 2.2, False),
    ],
)
def test_of_several_numbers_one_is_off_by_chance_more_often(
    variables: Sequence[Variable], sigmas: float, nothing: bool
) -> None:
    fitted = refine(Model(STOCK), variables, slowed())
    errors = {v: abs(fitted.model.change(v)) / sigmas for v in variables}
    assert contains_nothing(variables, fitted, errors) is nothing


@pytest.mark.parametrize(("sigmas", "nothing"), [(1.2, True), (4.0, False)])
def test_a_string_whose_stiffness_may_be_nothing_has_no_name(sigmas: float, nothing: bool) -> None:
    string = {Variable("tether", name): 1.0 for name in ("x", "y", "z", "length", "stiffness")}
    fitted = refine(Model(STOCK, string), (), slowed())
    errors = {v: abs(x) / (sigmas if v.parameter == "stiffness" else 50.0) for v, x in string.items()}
    assert contains_nothing(list(string), fitted, errors) is nothing
