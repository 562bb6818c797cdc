"""The four factors of a landing: closed forms, brute-force geometry, and energy against simulated swings."""

import math
from typing import Any

import numpy as np
import pytest

from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.landing_factors import FACTORS, fore_foot, landing_factors, window_low
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.state import new_state
from sim_backend.physics.step import step_thrust

OFF = (0.0, 0.0, 0.0, 0.0)
DESIGNS = ("narrow-short", "narrow-long", "semi-narrow-short", "semi-narrow-long", "wide-short", "wide-long")


def _parameters(design: str) -> Any:
    return physics_parameters(load_vehicle("crazyflie21-upgraded-stored", design), RoomGeometry())


def _nose_up(tilt: float) -> list[float]:
    return [0.0, -math.sin(0.5 * tilt), 0.0, math.cos(0.5 * tilt)]


def _factors(p: Any, tilt: float, velocity: tuple[float, float], nose_up_rate: float) -> Any:
    """Factors of an impact with a nose-up tilt (rad), world velocity (x, z) (m/s) and rate (rad/s)."""
    state, out = new_state(), np.zeros(1, FACTORS)[0]
    state["impact_quaternion"] = _nose_up(tilt)
    state["impact_velocity"] = [velocity[0], 0.0, velocity[1]]
    state["impact_omega"] = [0.0, -nose_up_rate, 0.0]
    landing_factors(state, p, out)
    return out


@pytest.fixture
def plain() -> Any:
    """Feet 40 mm before and 50 mm below the centre of mass, 40 g, 30e-6 kg m2, g = 10 m/s2."""
    p = _parameters("semi-narrow-long")
    p["hip"], p["leg_direction"] = 0.0, 0.0
    p["hip"][:, 0], p["hip"][:, 2] = [0.04, -0.04, -0.04, 0.04], -0.02
    p["leg_direction"][:, 2], p["leg_length"], p["foot_radius"] = -1.0, 0.03, 0.0
    p["mass"], p["inertia"][1], p["gravity"] = 0.04, 30e-6, 10.0
    return p


def test_swing_and_gravity_by_hand(plain: Any) -> None:
    """On its side (90 deg) the centre of mass is 40 mm below the feet, at rest 50 mm: gravity gives 4 mJ."""
    out = _factors(plain, 0.5 * math.pi, (0.0, 1.0), 0.0)
    assert (out["fore"], out["tilt"]) == (1, pytest.approx(0.5 * math.pi))
    assert out["swing_angle"] == pytest.approx(0.5 * math.pi)
    assert out["swing_distance"] == pytest.approx(0.08 * 0.5 * math.pi)
    assert out["gravity_height"] == pytest.approx(0.01)
    assert out["gravity_energy"] == pytest.approx(4e-3)
    assert (out["energy_required"], out["sufficiency"]) == (0.0, math.inf)
    # At 3 pi / 4 the feet are (40 - (-50)) / sqrt 2 = 63.6 mm above: it has to climb 13.6 mm.
    out = _factors(plain, 0.75 * math.pi, (0.0, 1.0), 0.0)
    assert out["gravity_height"] == pytest.approx(0.05 - 0.09 / math.sqrt(2.0))
    assert out["energy_required"] == pytest.approx(0.4 * (0.09 / math.sqrt(2.0) - 0.05))


def test_inverted_needs_no_swing(plain: Any) -> None:
    out = _factors(plain, math.pi, (0.0, 1.0), 0.0)
    for name in ("swing_angle", "swing_distance", "gravity_energy"):
        assert out[name] == pytest.approx(0.0, abs=1e-12)


def test_momentum_transfer_by_hand(plain: Any) -> None:
    """On its side b_x is up: 2 m/s forwards is -2 along b_z, 1 m/s up is +1 along b_x."""
    out = _factors(plain, 0.5 * math.pi, (2.0, 1.0), 10.0)
    inertia = 30e-6 + 0.04 * (0.04**2 + 0.05**2)
    translation = 0.04 * (-0.05 * 1.0 - 0.04 * -2.0)
    assert out["rate_translation"] == pytest.approx(translation / inertia)
    assert out["rate_rotation"] == pytest.approx(30e-6 * 10.0 / inertia)
    assert out["swing_rate"] == pytest.approx((translation + 3e-4) / inertia)
    energy = 0.5 * (translation + 3e-4) ** 2 / inertia
    assert out["swing_energy"] == pytest.approx(energy)
    assert out["energy_kept"] == pytest.approx(energy / (0.5 * 0.04 * 5.0 + 0.5 * 30e-6 * 100.0))
    assert out["energy_surplus"] == pytest.approx(energy + 4e-3)


def test_a_swing_that_exists_already_is_kept(plain: Any) -> None:
    """A body that turns about its fore feet loses nothing when they are caught."""
    tilt, rate = 2.0, 7.0
    foot_x, foot_z = fore_foot(plain)
    # The feet stand still: v = -w x f, nose up is -b_y.
    bx, bz = rate * foot_z, -rate * foot_x
    velocity = (bx * math.cos(tilt) - bz * math.sin(tilt), bx * math.sin(tilt) + bz * math.cos(tilt))
    out = _factors(plain, tilt, velocity, rate)
    assert out["swing_rate"] == pytest.approx(rate)
    assert out["energy_kept"] == pytest.approx(1.0)


def test_past_inverted_is_the_mirror_image(plain: Any) -> None:
    fore = _factors(plain, math.pi - 0.5, (1.5, 1.0), 4.0)
    hind = _factors(plain, math.pi + 0.5, (-1.5, 1.0), -4.0)
    assert (fore["fore"], hind["fore"]) == (1, 0)
    for name in FACTORS.names:
        if name != "fore":
            assert hind[name] == pytest.approx(fore[name]), name


@pytest.mark.parametrize("design", DESIGNS)
def test_impact_window_against_brute_force(design: str) -> None:
    """Feet, box corners and points all around the propeller discs, lifted to the ceiling at every tilt."""
    p = _parameters(design)
    foot_x, foot_z = fore_foot(p)
    rim = np.linspace(0.0, 2.0 * math.pi, 721)
    box = [(s * p["body_half_x"], z) for s in (-1, 1) for z in (p["body_top_z"], p["body_bottom_z"])]
    discs = [
        (s * p["arm_x"] + x, p["propeller_height_z"])
        for s in (-1, 1)
        for x in p["propeller_radius"] * np.cos(rim)
    ]
    hull = np.array([*box, *discs])
    low = window_low(p)
    for tilt in np.linspace(0.0, math.pi, 1801):
        up = np.array([math.sin(tilt), math.cos(tilt)])
        foot_first = foot_x * up[0] + foot_z * up[1] + p["foot_radius"] > np.max(hull @ up)
        if abs(tilt - low) > 1e-5:
            assert foot_first == (tilt > low), math.degrees(tilt)
    assert _factors(p, low + 0.1, (0.0, 1.0), 0.0)["foot_first"] == 1
    assert _factors(p, low - 0.1, (0.0, 1.0), 0.0)["foot_first"] == 0


def test_longer_legs_widen_the_window() -> None:
    """The paper's reason for the short designs' losses, in degrees of the window [low, 180]."""
    window = {design: 180.0 - math.degrees(window_low(_parameters(design))) for design in DESIGNS}
    for family in ("narrow", "semi-narrow", "wide"):
        assert window[f"{family}-long"] - window[f"{family}-short"] > 6.0
    assert window["narrow-short"] == pytest.approx(64.6, abs=0.1)
    assert window["wide-long"] == pytest.approx(100.0, abs=0.1)


def _rigid(design: str) -> Any:
    """Legs without give, feet that never let go, and hull and propellers too small to be in the way."""
    p = _parameters(design)
    p["hinge_stiffness"], p["hinge_damping"], p["hinge_limit_cosine"] = 60.0, 0.01, -2.0
    p["axial_stiffness"], p["axial_damping"] = 4e5, 100.0
    p["adhesion_strength"] = np.inf
    for name in ("body_half_x", "body_half_y", "propeller_radius", "arm_x", "arm_y"):
        p[name] = 1e-3
    p["body_top_z"], p["propeller_height_z"], p["body_bottom_z"] = 1e-3, 1e-3, -1e-3
    return p


def _swing(p: Any, rng: np.random.Generator, low: float) -> Any | None:
    """A throw that touches with its fore feet inside the window, 0.6 s at most; None if the feet recede."""
    foot_x, foot_z = fore_foot(p)
    tilt, rate = rng.uniform(low, math.pi - 0.02), rng.uniform(-5.0, 20.0)
    speed, angle = rng.uniform(0.5, 3.0), rng.uniform(math.radians(20.0), 0.5 * math.pi)
    sine, cosine = math.sin(tilt), math.cos(tilt)
    if speed * math.sin(angle) + rate * (foot_x * cosine - foot_z * sine) < 0.05:
        return None
    state = new_state()
    height = foot_x * sine + foot_z * cosine + float(p["foot_radius"])
    state["position"] = [0.0, 0.0, float(p["ceiling_z"]) - height - 1e-5]
    state["velocity"] = [speed * math.cos(angle), 0.0, speed * math.sin(angle)]
    state["quaternion"], state["omega"] = _nose_up(tilt), [0.0, -rate, 0.0]
    for tick in range(4800):  # 0.125 ms: a hinge of 60 N m/rad is stiffer than 1 ms carries
        step_thrust(state, p, OFF, 0.125e-3)
        if tick % 80 == 0 and state["foot_attached"].sum() == 4:
            break  # for good
    return state


@pytest.mark.further
def test_energy_balance_predicts_rigid_swings(rng: np.random.Generator) -> None:
    """The sign of the surplus says whether a swing on rigid legs reaches four feet, over all designs."""
    agree, closed, total = 0, 0, 0
    for design in DESIGNS:
        p, low = _rigid(design), window_low(_parameters(design))
        for _ in range(25):
            state = _swing(p, rng, low)
            if state is None:
                continue
            out = np.zeros(1, FACTORS)[0]
            landing_factors(state, p, out)
            got = bool(state["foot_attached"].sum() >= 3)
            agree += int(got == bool(out["energy_surplus"] > 0.0))
            closed, total = closed + int(got), total + 1
    assert total > 120
    assert 0.5 < closed / total < 0.95
    assert agree / total >= 0.97
