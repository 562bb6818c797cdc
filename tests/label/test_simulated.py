"""Labels of simulated landings, where the truth is known and independent of what the label looks at."""

import dataclasses
from collections import Counter

import numpy as np
import pytest

from calibration.flights import Flight, Trigger
from onboard.json_file import as_json
from onboard.vehicle import Vehicle, load_vehicle
from perchhw.attempt import Outcome
from perchhw.label import LabelError, label_flight, label_from_truth
from tests.label.simulated import Landing, land

pytestmark = pytest.mark.slow

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
HELD = {"four_leg": 4, "two_leg": 2, "failure": 0, "no_trigger": 0, "aborted": 0}


def hold(outcome: Outcome) -> int:
    return HELD[outcome.value.removesuffix("_body_contact")]


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load_vehicle("crazyflie21-upgraded")


@pytest.fixture(scope="module")
def landings(vehicle: Vehicle) -> list[Landing]:
    rng = np.random.default_rng(3)
    return [
        land(
            vehicle,
            speed=rng.uniform(1.5, 3.5),
            angle_deg=rng.uniform(30.0, 80.0),
            tau_critical=rng.uniform(0.16, 0.28),
            a_rot=-rng.uniform(4e-3, 9e-3),
            rng=rng,
        )
        for _ in range(60)
    ]


def without_pose_after_trigger(flight: Flight) -> Flight:
    assert flight.trigger is not None
    seen = flight.t <= flight.trigger.t + 0.05
    valid = {name: rows & seen if name in POSE else rows for name, rows in flight.valid.items()}
    return dataclasses.replace(flight, valid=valid)


@pytest.mark.slow
def test_the_resting_pose_tells_what_holds(landings: list[Landing], vehicle: Vehicle) -> None:
    truths = Counter(landing.truth for landing in landings)
    assert len(truths) >= 3  # the sample holds several outcomes
    exact = 0
    for landing in landings:
        label = label_flight(landing.flight, vehicle)
        assert label.method == "pose"
        assert hold(label.outcome) == hold(landing.truth), (landing.truth, label.evidence)
        exact += label.outcome is landing.truth
    assert exact / len(landings) >= 0.93  # body contact within the pose's accuracy may go either way


def test_the_gyro_alone_tells_what_holds(landings: list[Landing], vehicle: Vehicle) -> None:
    right = 0
    for landing in landings:
        label = label_flight(without_pose_after_trigger(landing.flight), vehicle)
        assert label.method == "gyro"
        right += hold(label.outcome) == hold(landing.truth)
    assert right / len(landings) >= 0.93


@pytest.fixture(scope="module")
def four_leg(landings: list[Landing]) -> Flight:
    return next(landing.flight for landing in landings if landing.truth is Outcome.FOUR_LEG)


def test_without_a_trigger(four_leg: Flight, vehicle: Vehicle) -> None:
    quiet = dataclasses.replace(four_leg, trigger=None)
    assert label_flight(quiet, vehicle).outcome is Outcome.NO_TRIGGER
    for aborted_by, outcome in (
        ("pose_stale", Outcome.ABORTED),
        ("missed_trigger", Outcome.NO_TRIGGER),
    ):
        flight = dataclasses.replace(quiet, aborted_by=aborted_by)
        assert label_flight(flight, vehicle).outcome is outcome
    assert label_flight(dataclasses.replace(quiet, finished=False), vehicle).outcome is Outcome.ABORTED


def cut_after_trigger(flight: Flight, seconds: float) -> Flight:
    assert flight.trigger is not None
    rows = flight.t <= flight.trigger.t + seconds
    return dataclasses.replace(
        flight,
        t=flight.t[rows],
        data={n: v[rows] for n, v in flight.data.items()},
        valid={n: v[rows] for n, v in flight.valid.items()},
    )


def test_a_record_that_ends_in_the_flip(four_leg: Flight, vehicle: Vehicle) -> None:
    cut = cut_after_trigger(four_leg, 0.3)
    killed = label_flight(dataclasses.replace(cut, finished=False), vehicle)
    assert killed.outcome is Outcome.ABORTED
    assert killed.evidence["seconds_after_trigger"] == pytest.approx(0.3, abs=0.011)
    with pytest.raises(LabelError, match=r"rates end 0\.\d+ s after the trigger"):
        label_flight(cut, vehicle)


def test_what_a_label_needs(four_leg: Flight, vehicle: Vehicle) -> None:
    with pytest.raises(LabelError, match="ceiling's height is unknown"):
        label_flight(dataclasses.replace(four_leg, ceiling_z=None), vehicle)
    with pytest.raises(LabelError, match="has no legs"):
        label_flight(four_leg, dataclasses.replace(vehicle, legs=None))
    rates = ("gx", "gy", "gz")
    blind = without_pose_after_trigger(four_leg)
    blind = dataclasses.replace(
        blind,
        data={n: v for n, v in blind.data.items() if n not in rates},
        valid={n: v for n, v in blind.valid.items() if n not in rates},
    )
    with pytest.raises(LabelError, match="neither a resting pose nor rates"):
        label_flight(blind, vehicle)


@pytest.mark.parametrize(
    ("feet", "contact", "outcome"),
    [
        (4, 0, Outcome.FOUR_LEG),
        (3, 1, Outcome.FOUR_LEG_BODY_CONTACT),
        (2, 0, Outcome.TWO_LEG),
        (1, 1, Outcome.TWO_LEG_BODY_CONTACT),
        (0, 1, Outcome.FAILURE),
    ],
)
def test_truth_columns_decide_directly(four_leg: Flight, feet: int, contact: int, outcome: Outcome) -> None:
    n = four_leg.t.size
    truth = {"legs_attached": np.full(n, float(feet)), "body_contact": np.full(n, float(contact))}
    data = {**four_leg.data, **truth}
    valid = {**four_leg.valid, **{name: np.ones(n, dtype=np.bool_) for name in truth}}
    flight = dataclasses.replace(four_leg, data=data, valid=valid, trigger=None)
    label = label_from_truth(flight)
    assert label.shows_body_contact
    assert (label.outcome, label.method) == (outcome, "truth")
    assert as_json(label)["evidence"]["n_feet"] == feet


def test_truth_without_a_flip_is_no_trigger(four_leg: Flight) -> None:
    level = {"qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0, "legs_attached": 0.0}
    data = {**four_leg.data, **{n: np.full(four_leg.t.size, v) for n, v in level.items()}}
    valid = {n: np.ones(four_leg.t.size, dtype=np.bool_) for n in data}
    flight = dataclasses.replace(four_leg, data=data, valid=valid, trigger=None)
    assert label_from_truth(flight).outcome is Outcome.NO_TRIGGER
    with pytest.raises(LabelError, match="no column legs_attached"):
        label_from_truth(dataclasses.replace(four_leg, trigger=Trigger(0.0)))
