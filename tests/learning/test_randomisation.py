"""Domain randomisation: the paper's draw, and any quantity of the vehicle file by its sigma."""

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle, vehicle_to_toml
from onboard.vehicle.unnamed import UnnamedCurve
from perchhw.learning.domain_randomisation import PAPER, draw_vehicle
from perchhw.learning.errors import LearningInputError
from perchhw.learning.executor import LocalThreads
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid, run_sweep
from perchhw.learning.trial import new_bench
from perchhw.learning.vehicle_pool import POOL, Draw, all_draws, vehicle_pool

VEHICLE = "crazyflie21-upgraded"


def _drawn(setup: LearningSetup, count: int = 4000) -> np.ndarray:
    """(count,) parameter records as rollouts get them."""
    parameters, rules = setup.load()
    bench, rng = new_bench(parameters, 1), np.random.default_rng(3)
    drawn = []
    for _ in range(count):
        draw_vehicle(rng, bench.nominal, rules.domain, bench.drawn)
        drawn.append(bench.drawn[0].copy())
    return np.array(drawn)


def _pool(*draws: Draw) -> Any:
    content = tomllib.loads(vehicle_to_toml(load_vehicle(VEHICLE)))
    return vehicle_pool(np.random.default_rng(0), draws, content, RoomGeometry())


def test_the_papers_draw_moves_mass_and_pitch_inertia_alone() -> None:
    nominal, _ = LearningSetup().load()
    drawn = _drawn(LearningSetup())
    np.testing.assert_allclose(np.std(drawn["mass"]), PAPER.mass, rtol=0.05)
    np.testing.assert_allclose(np.std(drawn["inertia"][:, 1]), PAPER.inertia_yy, rtol=0.05)
    np.testing.assert_allclose(np.mean(drawn["mass"]), 38.1e-3, rtol=0.005)
    for name in drawn.dtype.names or ():
        if name not in ("mass", "inertia"):
            np.testing.assert_array_equal(drawn[name], np.repeat(nominal[name][None], len(drawn), axis=0))


def test_every_vehicle_drawn_keeps_the_curves_without_a_name() -> None:
    one = UnnamedCurve(
        channel="world_force_x",
        regressor="z",
        knots=(0.2, 0.4),
        values=(0.01, 0.0),
        sigma=0.002,
        source="test",
    )
    content = tomllib.loads(vehicle_to_toml(load_vehicle(VEHICLE).with_unnamed([one])))
    assert not any(draw.name.startswith("unnamed") for draw in all_draws(content))
    pool = vehicle_pool(np.random.default_rng(0), [Draw("body.mass", 0.001)], content, RoomGeometry())
    assert len(np.unique(pool["mass"])) == POOL
    assert np.all(pool["unnamed_count"] == 1)
    assert np.all(pool["unnamed_values"][:, 0, 0] == 0.01)


def test_a_named_quantity_is_drawn_by_the_sigma_of_the_file_or_by_the_given_one() -> None:
    motors = load_vehicle(VEHICLE).motors
    setup = LearningSetup(domain="none", randomise=("motors.time_constant_down", "legs.length=0.002"))
    drawn = _drawn(setup)
    assert len(np.unique(drawn["leg_length"])) <= POOL
    down = drawn["time_constant_down"]
    assert np.mean(down) == pytest.approx(0.15, abs=3 * motors.time_constant_down.sigma / 16)
    assert np.std(down) == pytest.approx(motors.time_constant_down.sigma, rel=0.15)
    assert np.std(drawn["leg_length"]) == pytest.approx(0.002, rel=0.15)
    assert abs(np.corrcoef(down, drawn["leg_length"])[0, 1]) < 0.2
    assert np.ptp(drawn["mass"]) == 0.0


def test_what_follows_from_a_quantity_follows_exactly() -> None:
    """The direction of a leg is a sine and a cosine of its angle: each drawn leg must still have length 1."""
    pool = _pool(Draw("legs.angle_deg", 8.0))
    np.testing.assert_allclose(np.linalg.norm(pool["leg_direction"], axis=2), 1.0, rtol=1e-12)
    angles = np.degrees(np.arccos(-pool["leg_direction"][:, 0, 2]))
    assert np.std(angles) == pytest.approx(8.0, rel=0.15)
    assert len(np.unique(pool["reach"])) == POOL


@pytest.mark.further
def test_a_name_replaces_the_preset() -> None:
    drawn = _drawn(LearningSetup(domain="paper", randomise=("body.mass=0.003",)))
    assert np.std(drawn["mass"]) == pytest.approx(0.003, rel=0.15)
    assert len(np.unique(drawn["mass"])) <= POOL
    assert np.std(drawn["inertia"][:, 1]) == pytest.approx(PAPER.inertia_yy, rel=0.05)


@pytest.mark.further
def test_preset_vehicle_draws_all_sigmas_and_only_possible_vehicles() -> None:
    stored = LearningSetup(vehicle="crazyflie21-upgraded-stored", domain="vehicle")
    drawn = _drawn(stored, 1000)
    nominal, _ = stored.load()
    for name in ("mass", "arm_x", "thrust_max", "time_constant_up", "leg_length", "hinge_stiffness"):
        assert np.ptp(drawn[name]) > 0.0, name
        assert np.min(drawn[name]) >= 0.5 * nominal[name], name
    inertia = np.sort(drawn["inertia"], axis=1)
    assert np.all(inertia[:, 0] + inertia[:, 1] > inertia[:, 2])
    assert np.all(drawn["drag"] >= 0.0)
    assert np.std(drawn["drag"][:, 0]) > 0.0
    assert nominal["drag"][0] == 0.0


@pytest.mark.further
def test_parameters_of_effects_are_drawn_too(tmp_path: Path) -> None:
    file = tmp_path / "near.toml"
    effects = """
[[effects]]
name = "ceiling_effect"
inflow = { value = 0.9, unit = "1", sigma = 0.03, source = "test" }
[[effects]]
name = "com_offset"
x = { value = 0.5, unit = "mm", sigma = 2.0, source = "test" }
"""
    file.write_text(vehicle_to_toml(load_vehicle(VEHICLE)) + effects)
    options = ("effects.ceiling_effect.inflow", "effects.com_offset.x")
    drawn = _drawn(LearningSetup(vehicle=str(file), domain="none", randomise=options))
    changed = [name for name in drawn.dtype.names or () if len(np.unique(drawn[name], axis=0)) > 1]
    assert any("ceiling" in name for name in changed), changed
    assert len(changed) >= 2, changed
    everything = _drawn(LearningSetup(vehicle=str(file), domain="vehicle"), 100)
    assert all(len(np.unique(everything[name], axis=0)) > 1 for name in changed)


def test_signed_quantities_go_both_ways_and_positive_ones_stay_above_half() -> None:
    assert np.min(_pool(Draw("legs.hip_z", 0.1))["hip"][:, 0, 2]) < 0.0
    assert np.min(_pool(Draw("legs.stiffness", 1.0))["hinge_stiffness"]) >= 0.04


def test_the_pool_depends_on_the_seed_alone() -> None:
    setup = LearningSetup(randomise=("legs.stiffness", "body.arm_x"))
    _, one = setup.load()
    _, turned = dataclasses.replace(setup, randomise=setup.randomise[::-1]).load()
    _, other = dataclasses.replace(setup, seed=1).load()
    assert one.domain.pool.tobytes() == turned.domain.pool.tobytes()
    assert one.domain.pool.tobytes() != other.domain.pool.tobytes()


def test_uncertain_legs_change_what_a_sweep_finds(tmp_path: Any) -> None:
    grid = SweepGrid((2.5,), (60.0,), 1)
    plain = run_sweep(LearningSetup(), grid, tmp_path / "plain", executor=LocalThreads(1))
    setup = LearningSetup(randomise=("legs.angle_deg=10",))
    drawn = run_sweep(setup, grid, tmp_path / "drawn", executor=LocalThreads(1))
    assert plain.rows != drawn.rows
    with pytest.raises(LearningInputError, match=r"randomise is \['legs.angle_deg=10'\] there and \[\] now"):
        run_sweep(LearningSetup(), grid, tmp_path / "drawn", resume=True)


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("legs.stifness", "the vehicle has no quantity 'legs.stifness'; it has .*legs.stiffness"),
        ("legs.stiffness=soft", "'soft' is not a number"),
        ("legs.stiffness=-1", "SIGMA > 0 in N m/rad"),
        ("legs.stiffness=nan", "SIGMA > 0"),
        ("motors.pwm_bits", "the standard deviation is 0"),
        ("sensing.gyro_noise", "does not act in a landing attempt"),
        ("body.mass=1e6", "give smaller standard deviations"),
    ],
)
def test_draws_that_mean_nothing_are_refused(option: str, words: str) -> None:
    with pytest.raises(LearningInputError, match=words):
        LearningSetup(randomise=(option,)).load()


def test_naming_a_quantity_twice_is_refused() -> None:
    with pytest.raises(LearningInputError, match="twice"):
        LearningSetup(randomise=("body.mass", "body.mass=0.001")).load()
