"""Pads hidden by the independent landings, judged by the search over outcomes."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from calibration.gap.data.found_effect import Verdict
from calibration.gap.landings.outcomes.scores import score
from calibration.gap.landings.outcomes.vehicles import HINGES, Point, bare_parameters, filed_point, grid
from calibration.gap.landings.outcomes.verdict import improved_vehicle, in_words, judge_outcomes
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters
from tests.likely import assert_likely
from tests.truth.landings.drone import Drone
from tests.truth.landings.judge import (
    HEALTHY,
    VEHICLE,
    Judged,
    as_point,
    as_vehicle,
    drawn,
    judge,
    lines_of,
    main,
    mixed,
    summary,
)
from tests.truth.landings.judge import HINGES as DAMPED
from tests.truth.landings.outcomes import attempts, land

PADS = Drone(stiffness=DAMPED.stiffness, damping=DAMPED.damping, capture=0.9, capture_spread=0.2)


def test_a_foot_that_comes_slowly_is_refused_and_leaves() -> None:
    """Above every speed that occurs nothing sticks; at none all is as without a limit, to the last bit."""
    attempt = attempts(1, 4)[0]
    deaf = land(Drone(capture=50.0), attempt, 4, 0)
    assert deaf.feet == 0
    assert deaf.log["z"][-1] < attempt.ceiling - 0.2
    without, with_none = land(HEALTHY, attempt, 4, 0), land(Drone(capture=-50.0), attempt, 4, 0)
    assert without.feet >= 3
    np.testing.assert_array_equal(without.log["gy"], with_none.log["gy"])


@pytest.fixture(scope="module")
def few() -> list[Judged]:
    """Eight landings, and a grid of two hinges."""
    pads = [(0.0, 0.0), *product((0.3, 0.6, 0.9, 1.2), (0.2,))]
    points = [Point(*hinge, *pad, 1.0) for hinge, pad in product(HINGES[:3:2], pads)]
    return judge([HEALTHY, PADS], 8, 1, 40, points)


@pytest.mark.further
def test_nothing_is_named_where_nothing_is_hidden(few: list[Judged]) -> None:
    assert few[0].named == ()


@pytest.mark.further
def test_landings_of_another_program_end_as_often_as_ours_predict(few: list[Judged]) -> None:
    """Healthy ones, and ones with hidden hinges and pads, each by the model that is right."""
    for one in few:
        assert one.predicted is not None
        for landed, shares in zip(one.counts, one.predicted.T, strict=True):
            assert_likely(landed, shares.tolist(), simulated=40)


@pytest.mark.further
def test_hidden_pads_are_named_with_their_speed(few: list[Judged]) -> None:
    assert few[1].counts[1] > few[0].counts[1]
    assert "pads" in few[1].named
    _, low, high = few[1].speed
    assert low <= PADS.capture <= high


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_thirty_landings_name_drawn_pads() -> None:
    """docs/gap_landings_judged.md has the figures of more seeds."""
    claims, named, inside = 0, 0, 0
    for seed in range(21, 24):
        healthy, _, *pads = judge(drawn(seed, 4), 30, seed, 100)
        claims += bool(healthy.named)
        for one in pads:
            if "pads" in one.named:
                named += 1
                _, low, high = one.speed
                inside += low <= one.hidden.capture <= high
    assert claims == 0
    assert named >= 9
    assert inside > named / 2


@pytest.mark.further
def test_a_lab_is_told_what_its_vehicle_file_lacks(few: list[Judged]) -> None:
    """In words with the value in the file beside it, and as a vehicle file that has it."""
    found = few[1].found
    scored = found.fits[0].left_one_out
    assert judge_outcomes(scored, found) is Verdict.EFFECTS_FOUND
    sentences = in_words(Verdict.EFFECTS_FOUND, scored, found)
    assert "pad_capture.speed" in sentences[0]
    assert "(filed 0; runs to 1.2, the end of what was tried" in sentences[0]
    better = improved_vehicle(load_vehicle(VEHICLE), found, "a test")
    effects = {effect.name: effect.values() for effect in better.effects}
    mean = found.best.values["speed"].mean
    low, high = found.values["speed"].ci95
    assert effects["pad_capture"]["speed"] == pytest.approx(mean)
    assert low <= PADS.capture <= high
    assert filed_point(better).speed == pytest.approx(mean)


def test_counts_that_the_model_does_not_expect_are_a_gap_without_a_name() -> None:
    """Ten flights that were said to hold on four legs; as few as three did."""
    sure = np.tile([0.9, 0.08, 0.02], (10, 1))
    rng = np.random.default_rng(0)
    few = score(sure, np.array([0] * 3 + [1] * 7), 100, rng)
    assert judge_outcomes(few, None) is Verdict.UNEXPLAINED_GAP
    assert "--search" in in_words(Verdict.UNEXPLAINED_GAP, few, None)[0]
    as_said = score(sure, np.array([0] * 9 + [1]), 100, rng)
    assert judge_outcomes(as_said, None) is Verdict.NO_GAP
    assert judge_outcomes(None, None) is Verdict.CANNOT_TELL


def test_a_table_of_judged_sets_goes_on_and_counts_what_was_named(tmp_path: Path) -> None:
    """Of each kind: false names of nothing, and hidden limits inside the interval of a name."""
    made = [
        {"seed": 1, "hidden": {"hinges": False, "speed": 0.0}, "named": [], "values": {}},
        {"seed": 2, "hidden": {"hinges": False, "speed": 0.0}, "named": ["hull"], "values": {}},
        {
            "seed": 2,
            "hidden": {"hinges": True, "speed": 0.8},
            "named": ["pads"],
            "values": {"speed": [1.0, 0.9, 1.1]},
        },
        {
            "seed": 3,
            "hidden": {"hinges": True, "speed": 0.8},
            "filed": {"hinges": True, "speed": 0.8},
            "named": [],
            "values": {},
            "fewer": {"8": {"named": ["pads"], "values": {"speed": [0.8, 0.7, 0.9]}}},
        },
    ]
    table = tmp_path / "judged.jsonl"
    assert lines_of(table) == []
    table.write_text("".join(json.dumps(one) + "\n" for one in made), encoding="utf-8")
    assert lines_of(table) == made
    counted = summary(lines_of(table))
    nothing, pads = counted["nothing"], counted["pads"]
    assert (nothing["sets"], nothing["named"]["anything"]["sets"]) == (2, 1)
    assert nothing["named"]["anything"]["wilson95"] == pytest.approx((0.095, 0.905), abs=1e-3)
    assert (pads["sets"], pads["named"]["pads"]["sets"]) == (1, 1)
    for name, named in (("mixed_healthy", 0), ("mixed_healthy, first 8", 1)):  # its file says what it is
        assert (counted[name]["sets"], counted[name]["named"]["anything"]["sets"]) == (1, named)
    assert pads["named"]["pads, limit inside the interval"]["sets"] == 0


def test_a_file_that_says_what_a_mixed_drone_is_hides_nothing() -> None:
    """The physics of the file is that of the hidden drone, and of the grid's vehicle that is as filed."""
    drones = mixed(5, 2)
    assert drones[0] != drones[1]
    for drone in drones:
        vehicle = as_vehicle(drone)
        assert filed_point(vehicle) == as_point(drone)
        filed = physics_parameters(vehicle, RoomGeometry())
        assert filed["capture_speed"] == drone.capture
        assert filed["capture_spread"] == drone.capture_spread
        assert filed["hinge_stiffness"] == pytest.approx(drone.stiffness)
        assert filed["hinge_damping"] == pytest.approx(drone.damping)
        assert as_point(drone) in grid(bare_parameters(vehicle), filed_point(vehicle))


@pytest.mark.further
def test_a_drone_that_is_as_its_file_says_is_told_nothing_and_ends_as_the_file_expects() -> None:
    """Eight landings each, of drones with pads of their own luck, whose file has hinges and pads."""
    drones = mixed(1, 2)
    points = [Point(*hinge, *pad) for hinge, pad in product(HINGES[:3:2], [(0.0, 0.0), (0.9, 0.2)])]
    points += map(as_point, drones)
    judged = judge(drones, 8, 1, 40, points, [as_vehicle(drone) for drone in drones])
    for one, drone in zip(judged, drones, strict=True):
        assert one.named == ()
        assert one.found.filed == as_point(drone)
        assert one.predicted is not None
        for landed, shares in zip(one.counts, one.predicted.T, strict=True):
            assert_likely(landed, shares.tolist(), simulated=40)


def test_a_seed_that_is_in_the_table_is_not_flown_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "judged.jsonl"
    line = {"seed": 7, "hidden": {"hinges": False, "speed": 0.0}, "named": [], "values": {}}
    table.write_text(json.dumps(line) + "\n", encoding="utf-8")
    monkeypatch.setattr("sys.argv", ["judge", "--first", "7", "--seeds", "1", "--table", str(table)])
    main()
    assert json.loads(capsys.readouterr().out)["in_all"]["nothing"]["sets"] == 1
