"""Legs and feet, judged from landings that a program of its own has flown (tests/truth/landings)."""

import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.flights import Flight, open_flight, open_flights
from calibration.gap.data.found_effect import Verdict
from calibration.gap.landings import LandingFindings, judge_landings
from calibration.gap.landings.choose import at_bound
from calibration.gap.landings.flip import flip_residual
from calibration.gap.landings.judge import improvement
from calibration.gap.landings.kernels import COLUMNS, POSITION, fly
from calibration.gap.landings.problem import Solver, pose_problems
from calibration.gap.landings.search import HIGHEST, NOMINAL, Theta, apply
from calibration.gap.landings.segments import LandingSegment, landing_of
from onboard.json_file import as_json
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle, load_vehicle
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.state import new_states
from sim_backend.physics.step import step_thrust
from tests.truth.landings.campaign import CASES, write_campaign
from tests.truth.landings.flight import Attempt, Noise
from tests.truth.landings.flight import fly as fly_truth

COUNT = 6
"""Landings of a campaign here; docs/gap_landings_judged.md has the figures of twelve and twenty."""


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load_vehicle("crazyflie21-upgraded-stored")


@dataclasses.dataclass(frozen=True)
class Campaign:
    flights: list[Flight]
    answer: dict[str, Any]


def find_landings(flights: Iterable[Flight]) -> list[LandingSegment]:
    """The landings in `flights`, in their order; flights without one are left out."""
    return [found for found in map(landing_of, flights) if isinstance(found, LandingSegment)]


def _campaign(folder: Path, case: str, seed: int, count: int = COUNT) -> Campaign:
    write_campaign(case, count, seed, folder / "flights", folder / "answer.json", every=2)
    flights, unusable = open_flights(sorted((folder / "flights").glob("*.csv")))
    assert not unusable
    return Campaign(flights, json.loads((folder / "answer.json").read_text()))


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    return _campaign(tmp_path_factory.mktemp("healthy"), "none", seed=11)


@pytest.fixture(scope="module")
def soft(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    return _campaign(tmp_path_factory.mktemp("soft"), "stiffness-0.5", seed=12)


@pytest.fixture(scope="module")
def one_soft(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """A landing with the hinges of `soft`."""
    (flight,) = _campaign(tmp_path_factory.mktemp("one"), "stiffness-0.5", seed=12, count=1).flights
    return flight


@pytest.fixture(scope="module")
def soft_findings(soft: Campaign, vehicle: Vehicle) -> LandingFindings:
    return judge_landings(soft.flights, vehicle, np.random.default_rng(0))


@pytest.mark.further
def test_truth_loses_energy_and_keeps_momentum() -> None:
    """The independent landings are no perpetual motion: what swings after the motors stop dies away."""
    log = fly_truth(CASES["damping-10"], Attempt(2.6, 0.7, 0.23, -0.0066), Noise(), np.random.default_rng(3))
    rates = np.linalg.norm([log[f"g{axis}"] for axis in "xyz"], axis=0)
    after = log["t"] - float(log["touch"])
    assert log["feet"] >= 3
    assert rates[(after > 0.0) & (after < 0.1)].max() > 15.0
    assert rates[after > 0.8].max() < 0.5
    assert np.ptp(log["z"][after > 0.8]) < 2e-3


def test_contact_is_found_to_the_sample(healthy: Campaign) -> None:
    landings = find_landings(healthy.flights)
    assert len(landings) == COUNT
    for landing, outcome in zip(landings, healthy.answer["outcomes"], strict=True):
        # The first sample after a touch of a millisecond ago may look like the one before it.
        assert landing.before - 1e-9 <= outcome["touch"] + 0.002
        assert outcome["touch"] <= landing.after + 1e-9


@pytest.mark.further
def test_state_before_the_contact_is_known_well(tmp_path: Path, vehicle: Vehicle) -> None:
    """Dead reckoning through 0.1 s of noisy poses gives the velocity to 2 cm/s, the ceiling to 5 mm."""
    still = Noise(position=0.0, attitude=0.0, gyro=0.0)
    write_campaign("none", 3, 5, tmp_path / "exact", tmp_path / "a.json", still)
    write_campaign("none", 3, 5, tmp_path / "noisy", tmp_path / "b.json")
    exact, noisy = (open_flights(sorted((tmp_path / n).glob("*.csv")))[0] for n in ("exact", "noisy"))
    problems, refused = pose_problems(find_landings(noisy), vehicle)
    assert not refused
    for problem in problems:
        truth = next(f for f in exact if f.name == problem.segment.name)
        t, position = truth.series("x", "y", "z")
        rows = (t > problem.start.t - 0.03) & (t <= problem.start.t)
        velocity = np.polyfit(t[rows] - problem.start.t, position[rows], 2)[1]
        assert problem.start.state["velocity"][0] == pytest.approx(velocity, abs=0.02)
        assert problem.ceiling == pytest.approx(2.1, abs=0.005)


def test_kernel_is_the_simulation(vehicle: Vehicle) -> None:
    """The loop of the finder and the simulation's own step land in the same place, to the last bit or so."""
    parameters = physics_parameters(vehicle, RoomGeometry())
    start = new_states(1)
    start["position"][0], start["velocity"][0] = [0.0, 0.0, 1.95], [1.5, 0.1, 1.4]
    start["quaternion"][0], start["omega"][0] = [0.02, -0.7, 0.0, 0.7137926], [0.5, -22.0, 0.0]
    start["quaternion"][0] /= np.linalg.norm(start["quaternion"][0])
    told = np.zeros((300, 4))
    told[:20, [0, 3]] = 0.1
    mine, other = start.copy(), start.copy()
    trace = np.empty((301, COLUMNS))
    fly(mine[0], parameters, told, 1, trace)
    for row in told:
        step_thrust(other[0], parameters, tuple(row), 1e-3)
    assert other["ceiling_contact"][0] == 1
    assert trace[-1, POSITION : POSITION + 3] == pytest.approx(other["position"][0], abs=1e-9)


@pytest.mark.further
def test_a_vehicle_too_stiff_for_the_step_is_infinitely_unlikely(healthy: Campaign, vehicle: Vehicle) -> None:
    problems, _ = pose_problems(find_landings(healthy.flights), vehicle)
    solver = Solver(problems[:2], np.random.default_rng(1), random_starts=2, descents=1)
    too_stiff = apply(physics_parameters(vehicle, RoomGeometry()), Theta(stiffness=30.0, damping=20.0))

    costs, found = solver.costs(too_stiff)

    assert np.all(costs == np.inf)
    assert np.all(np.isfinite(found))


@pytest.mark.soak
def test_hidden_hinge_costs_least_where_it_is(soft: Campaign, vehicle: Vehicle) -> None:
    problems, _ = pose_problems(find_landings(soft.flights), vehicle)
    solver = Solver(problems, np.random.default_rng(1))
    parameters = physics_parameters(vehicle, RoomGeometry())
    scales = (0.3, 0.4, 0.5, 0.62, 1.0)
    costs = [
        np.median(solver.costs(apply(parameters, Theta(stiffness=float(np.log(scale)))))[0] / solver.counts)
        for scale in scales
    ]
    assert np.argmin(costs) == 2
    assert costs[2] < 0.7
    assert costs[4] > 10.0 * costs[2]


@pytest.mark.soak
def test_soft_hinge_is_named_and_measured(soft_findings: LandingFindings) -> None:
    assert soft_findings.verdict is Verdict.EFFECTS_FOUND
    finding = soft_findings.findings[0]
    assert [found.name for found in soft_findings.findings] == ["leg_stiffness"]
    value, (low, high) = finding.parameters["scale"].value, finding.parameters["scale"].ci95
    assert value == pytest.approx(0.5, rel=0.1)
    assert low < 0.5 < high
    assert finding.error_after < 0.3 * finding.error_before
    low, high = finding.improvement_ci95
    assert 0.3 * finding.error_before < low < finding.error_before - finding.error_after < high
    assert not finding.parameters["scale"].at_bound
    assert len(soft_findings.usable) == COUNT
    assert soft_findings.misfit is not None
    assert soft_findings.misfit > 2.0


def test_an_improvement_is_a_difference_in_the_unit_of_the_errors() -> None:
    before, after = np.array([4.0, 5.0, 6.0, 4.5, 5.5, 5.2]), np.array([1.0, 1.2, 0.9, 1.1, 1.3, 1.0])
    low, high = improvement(before, after, np.random.default_rng(0)).improvement_ci95
    assert 2.5 < low < np.median(before) - np.median(after) < high < 5.5


def test_a_fit_at_the_end_of_its_range_is_no_value() -> None:
    stuck = NOMINAL._replace(adhesion=-1.0, preload=HIGHEST.preload)
    assert at_bound(stuck, "foot_slip") == ("minimum_preload",)
    assert at_bound(stuck, "leg_stiffness") == ()


@pytest.mark.further
def test_healthy_legs_are_cleared(healthy: Campaign, vehicle: Vehicle) -> None:
    found = judge_landings(healthy.flights, vehicle, np.random.default_rng(0))
    assert found.verdict is Verdict.NO_GAP
    assert not found.findings
    low, high = found.allowed["leg_stiffness"]["scale"]
    assert 0.8 < low < 1.0 < high < 1.25


@pytest.mark.soak
def test_damped_hinge_is_not_called_stiff(tmp_path: Path, vehicle: Vehicle) -> None:
    campaign = _campaign(tmp_path, "damping-10", seed=13)
    found = judge_landings(campaign.flights, vehicle, np.random.default_rng(0))
    assert [finding.name for finding in found.findings] == ["leg_damping"]
    scale = found.findings[0].parameters["scale"]
    value, (low, high) = scale.value, scale.ci95
    assert value == pytest.approx(10.0, rel=0.2)
    assert low < 10.0 < high


def test_one_landing_or_its_copies_name_nothing(one_soft: Flight, vehicle: Vehicle) -> None:
    copies = [one_soft] * 8
    found = judge_landings(copies, vehicle, np.random.default_rng(0))
    assert found.verdict is Verdict.CANNOT_TELL
    assert not found.findings
    assert "can be held out" in found.limitations[0]
    refused = as_json(found)["refused"]
    assert sum("the same landing" in flight["reason"] for flight in refused) == 7


def test_flights_without_a_landing_are_named(one_soft: Flight, vehicle: Vehicle) -> None:
    before = one_soft.t < 0.5
    flight = dataclasses.replace(
        one_soft,
        t=one_soft.t[before],
        data={name: values[before] for name, values in one_soft.data.items()},
        valid={name: rows[before] for name, rows in one_soft.valid.items()},
        trigger=None,
    )
    found = judge_landings([flight], vehicle, np.random.default_rng(0))
    assert found.verdict is Verdict.CANNOT_TELL
    assert found.unused[0].reason == "the flight has no flip"


def test_authors_flips(shared_data: Path, vehicle: Vehicle) -> None:
    """What is left of the flips agrees with our analysis of the authors' data (notes, section 2)."""
    flights = [_open(path) for path in sorted((shared_data / "habas2022" / "flights").glob("*.csv.gz"))]
    landings = find_landings([flight for flight in flights if flight is not None])
    assert 25 <= len(landings) <= 29
    flip = flip_residual(landings, vehicle)
    assert flip is not None
    assert len(flip.flights) >= 20
    assert abs(flip.mean["as filed"]) < 2.5
    assert flip.rms["as filed"] < 3.0
    assert flip.rms["no motor lag"] > 10.0
    assert flip.rms["pitch inertia 10 % smaller"] < flip.rms["as filed"]


def _open(path: Path) -> Flight | None:
    flights, _ = open_flights([path])
    return flights[0] if flights else None


def test_authors_flights_want_more_damping(shared_data: Path, vehicle: Vehicle) -> None:
    """Seven of the landings are enough for it (all of them: docs/gap_landings_authors.md)."""
    folder = shared_data / "habas2022" / "flights"
    names = ("1.75_30.00_10-27_11-31", "2.00_40.00_10-26_17-16", "2.25_40.00_10-26_17-27",
             "2.50_40.00_10-26_16-34", "2.50_40.00_10-27_11-25", "2.75_50.00_10-26_17-37",
             "3.00_30.00_10-27_11-16")  # fmt: skip
    flights = [open_flight(folder / f"SVL--NL_{name}.csv.gz") for name in names]
    problems, _ = pose_problems(find_landings(flights), vehicle)
    solver = Solver(problems, np.random.default_rng(1))
    parameters = physics_parameters(vehicle, RoomGeometry())
    costs = {
        scale: np.sum(
            np.log1p(solver.costs(apply(parameters, Theta(damping=float(np.log(scale)))))[0] / 60.0)
        )
        for scale in (1.0, 6.0)
    }
    assert costs[6.0] < costs[1.0] - 1.5
