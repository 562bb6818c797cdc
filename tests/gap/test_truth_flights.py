"""The hidden flights as a whole: the closed loop flies, the noise is as told, the files can be read and hold
no answer."""

import ast
import json
import math
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.flights import open_flight
from onboard.vehicle.effects import EFFECTS
from tests.tiers import some
from tests.truth import hidden_effects
from tests.truth.hidden_effects import CASES, SIZES, make_flights
from tests.truth.hidden_effects.cases import AGILE, SINGLE, Hidden, hide
from tests.truth.hidden_effects.effects import EFFECT_NAMES, apply, draw
from tests.truth.hidden_effects.flight import HiddenFlight, hidden_flight
from tests.truth.hidden_effects.layout import GRAVITY, MOTORS, nominal
from tests.truth.hidden_effects.rotors import settled_thrusts, terminal_voltage
from tests.truth.hidden_effects.shapes import SHAPES, campaign

MASS, INERTIA = 0.030, np.array([12.19e-6, 14.55e-6, 23.55e-6])
ALOFT = slice(2500, 14700)
"""Control ticks in which the manoeuvre is flown."""
ALOFT_ROWS = slice(500, 2940)


@pytest.fixture(scope="module")
def vehicle() -> np.ndarray:
    return nominal("crazyflie21-stock")


@pytest.fixture(scope="module")
def flights(vehicle: np.ndarray) -> dict[str, HiddenFlight]:
    """One flight of each shape with nothing hidden."""
    return {shape: hidden_flight(vehicle, shape, shape, 7, k) for k, shape in enumerate(SHAPES)}


def with_effect(vehicle: np.ndarray, name: str, **values: float) -> np.ndarray:
    p = vehicle.copy()
    apply(p, name, values)
    return p


def turned(q: np.ndarray, vector: list[float]) -> np.ndarray:
    """World components of a body vector at each attitude, shape (n, 3)."""
    return np.asarray(Rotation.from_quat(q).apply(vector))


def fly(p: np.ndarray, shape: str = "attitude_chirp") -> HiddenFlight:
    return hidden_flight(p, shape, shape, 3, 0)


@pytest.mark.further
def test_delay_sag_and_sensors_in_flight(vehicle: np.ndarray) -> None:
    plain, late = fly(vehicle), fly(with_effect(vehicle, "command_delay", delay=0.0085))

    def first_thrust(flight: HiddenFlight) -> int:
        return int(np.flatnonzero(flight.states[:, 13] > 0)[0])

    # 8.5 ms are four ticks and a quarter: seen at the fifth tick after
    assert first_thrust(late) - first_thrust(plain) == 4
    partly = late.states[first_thrust(late), 13] / plain.states[first_thrust(plain), 13]
    assert partly == pytest.approx(0.75, abs=0.02)

    tired = fly(with_effect(vehicle, "battery_sag", resistance=0.1))
    thrust = tired.states[::5, MOTORS].sum(axis=1)
    charge = tired.states[::5, 17]
    expected = 4.12 - 0.6 * charge / 900.0 - (0.17 + 0.1) * 6.9 * thrust
    assert np.abs(np.mean(tired.log[:, 17] - expected)) < 5e-4

    biased = fly(with_effect(vehicle, "gyro_bias", x=0.02, y=-0.03, z=0.05))
    miss = biased.log[:, 7:10] - biased.states[::5, 10:13]
    assert miss.mean(axis=0) == pytest.approx([0.02, -0.03, 0.05], abs=1e-3)

    old = fly(with_effect(vehicle, "pose_delay", delay=0.02))
    assert np.std(old.log[2:, :3] - old.states[:-10:5, :3], axis=0) == pytest.approx(2e-4, rel=0.05)

    moved = fly(with_effect(vehicle, "pose_offset", x=0.02, y=0.0, z=0.03))
    aside = turned(moved.states[::5, 6:10], [0.02, 0.0, 0.03])
    assert np.std(moved.log[:, :3] - moved.states[::5, :3] - aside, axis=0) == pytest.approx(2e-4, rel=0.05)

    skewed = fly(with_effect(vehicle, "pose_rotation", x=0.02, y=-0.03, z=0.04))
    true, seen = Rotation.from_quat(skewed.states[::5, 6:10]), Rotation.from_quat(skewed.log[:, 3:7])
    assert (true.inv() * seen).as_rotvec().mean(axis=0) == pytest.approx([0.02, -0.03, 0.04], abs=5e-4)


def test_the_sensors_ride_on_the_frame_not_on_the_centre_of_mass(vehicle: np.ndarray) -> None:
    flight = fly(with_effect(vehicle, "com_offset", x=0.005, y=0.0, z=0.0))
    aside = turned(flight.states[::5, 6:10], [-0.005, 0.0, 0.0])
    assert np.std(flight.log[:, :3] - flight.states[::5, :3] - aside, axis=0) == pytest.approx(2e-4, rel=0.05)
    pwm = flight.log[ALOFT_ROWS, 13:17].mean(axis=0)
    assert pwm[[0, 3]].min() > 1.05 * pwm[[1, 2]].max()  # nose-heavy: the front motors carry more


@pytest.mark.further
def test_saturation_clips_the_share_it_should(vehicle: np.ndarray) -> None:
    hidden = hide("motor_saturation", "strong", 4, vehicle)
    limit = hidden.effects["motor_saturation"]["thrust_limit"]
    shares = []
    for number, shape in enumerate(AGILE):
        flight = hidden_flight(hidden.vehicle, shape, shape, 4, number)
        assert flight.states[:, MOTORS].max() < limit * 1.02  # a lucky flight has half a per cent more
        shares.append(np.mean(settled_thrusts(flight.parameters, flight.log[ALOFT_ROWS, 13:18]) > limit))
        assert flight.states[ALOFT, 2].min() > 0.15  # and it still flies
    assert np.mean(shares) == pytest.approx(0.15, rel=0.3)


# --- ----------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", some(SHAPES, 8))
def test_the_loop_flies_every_shape(shape: str, flights: dict[str, HiddenFlight]) -> None:
    flight = flights[shape]
    miss = flight.states[:, :3] - flight.setpoints[:, :3]
    assert np.abs(miss[14900:15500]).max() < 0.2  # it comes home
    if not shape.startswith(("doublet", "vertical", "chops", "lissajous")):
        assert np.sqrt(np.mean(miss[ALOFT] ** 2, axis=0)).max() < 0.2
    assert flight.states[ALOFT, 2].min() > 0.02
    assert flight.states[:, 2].max() < 2.1 - 0.02
    still = np.r_[0:1200, 17300:17500]
    assert np.abs(flight.states[still, 3:6]).max() < 0.02
    assert np.abs(flight.states[still, 10:13]).max() < 0.1
    assert flight.log[[0, -1], 13:17] == pytest.approx(0.0)
    assert np.mean(flight.log[:, 13:17] >= 65534) < 0.02


@pytest.mark.parametrize("case", some(sorted({*SINGLE} - {"motor_saturation"}), 8))
def test_a_strong_effect_does_not_bring_it_down(case: str, vehicle: np.ndarray) -> None:
    p = hide(case, "strong", 2, vehicle).vehicle
    shape = "near_ceiling" if case == "ceiling_effect" else "doublet_x"
    flight = hidden_flight(p, shape, shape, 2, 0)
    assert np.isfinite(flight.states).all()
    assert np.abs(flight.states[ALOFT, :3] - flight.setpoints[ALOFT, :3]).max() < 1.0
    assert flight.states[ALOFT, 2].min() > 0.4
    assert flight.states[ALOFT, 2].max() < 2.1 - 0.02


def test_sensor_noise_is_as_specified(flights: dict[str, HiddenFlight]) -> None:
    log = np.concatenate([f.log for f in flights.values()])
    true = np.concatenate([f.states[::5] for f in flights.values()])
    assert np.std(log[:, 7:10] - true[:, 10:13], axis=0) == pytest.approx(0.01, rel=0.02)
    assert np.std(log[:, :3] - true[:, :3], axis=0) == pytest.approx(2e-4, rel=0.02)
    miss = Rotation.from_quat(true[:, 6:10]).inv() * Rotation.from_quat(log[:, 3:7])
    assert np.std(miss.as_rotvec(), axis=0) == pytest.approx(np.deg2rad(0.17), rel=0.02)
    for f in flights.values():  # on the floor the accelerometer shows gravity, bias and noise
        assert np.std(f.log[:240, 10:13], axis=0) == pytest.approx(0.05, rel=0.2)
        p = f.parameters
        rest = [terminal_voltage(p, y) for y in f.states[:1200:5]]
        assert np.std(f.log[:240, 17] - rest) == pytest.approx(0.005, rel=0.2)
    bias = np.concatenate([f.log[:240, 10:13].mean(axis=0) - [0, 0, GRAVITY] for f in flights.values()])
    assert np.std(bias) == pytest.approx(0.03, rel=0.35)


@pytest.mark.further
def test_the_air_is_coloured_as_specified(flights: dict[str, HiddenFlight], vehicle: np.ndarray) -> None:
    gusts = np.array([f.gusts for f in flights.values()])
    force, torque = gusts[..., :3] / MASS, gusts[..., 3:] / INERTIA
    assert np.std(torque[..., :2]) == pytest.approx(2.2, rel=0.03)
    assert np.std(torque[..., 2]) == pytest.approx(0.7, rel=0.05)
    assert np.std(force) == pytest.approx(0.06, rel=0.05)
    for series, span in ((torque[..., 0], 30), (torque[..., 1], 30), (force, 200)):
        kept = np.mean(series[:, span:] * series[:, :-span]) / np.mean(series**2)
        assert kept == pytest.approx(math.exp(-1.0), abs=0.06)
    slow = np.array([hidden_flight(vehicle, "a", "hover", 1, k, defects=True).gusts for k in range(6)])
    blocks = (slow[:, :17000, 3:5] / INERTIA[:2]).reshape(6, 17, 1000, 2)
    assert 1.5 < np.std(blocks.mean(axis=2)) < 3.2


def test_the_motors_answer_the_disturbance(flights: dict[str, HiddenFlight]) -> None:
    """The trap: what the loop commands is made of what it met, so the logged input is no cause of its own."""
    f = flights["hover"]
    told = settled_thrusts(f.parameters, f.log[ALOFT_ROWS, 13:18])
    roll = 0.0325 * (told[:, 2] + told[:, 3] - told[:, 0] - told[:, 1])
    met = f.gusts[ALOFT, 3][::5]
    lags = [np.corrcoef(roll[k:], met[: met.size - k])[0, 1] for k in range(20)]
    assert min(lags) < -0.5


def test_nuisances_differ_from_flight_to_flight(flights: dict[str, HiddenFlight]) -> None:
    many = [f.parameters for f in flights.values()]
    gain = np.array([p["gain"][0] for p in many])
    trim = np.array([p["trim"] for p in many]) / INERTIA
    assert np.std(gain) == pytest.approx(0.005, rel=0.4)
    assert np.std(trim[:, :2]) == pytest.approx(1.0, rel=0.3)
    assert np.mean(gain) == pytest.approx(1.0, abs=0.004)


# --- files, answers, reproducibility ------------------------------------------------------------------------


def test_every_case_of_every_size_is_within_the_declared_bounds(vehicle: np.ndarray) -> None:
    rng = np.random.default_rng(1)
    for name in EFFECT_NAMES:
        if name == "motor_saturation":
            continue
        for size in SIZES:
            values = draw(name, size, rng)
            for parameter, value in EFFECTS[name].values({}).items() if not values else values.items():
                declared = EFFECTS[name].parameters[parameter]
                assert declared.low <= value <= declared.high, (name, size, parameter, value)
            assert set(values) == set(EFFECTS[name].parameters)
    for case in CASES:
        if case == "motor_saturation":
            continue
        sizes = [hide(case, size, 3, vehicle).answer() for size in SIZES]
        verdict = {"none": "no_gap"}.get(case, "unexplained_gap" if "unlisted" in case else "effects_found")
        assert all(answer["verdict"] == verdict for answer in sizes)
        assert len(sizes[1]["effects"]) == {"none": 0, "two": 2, "three": 3, "wind": 2}.get(
            case, 0 if "unlisted" in case else 1
        )


def test_weak_medium_and_strong_are_in_order() -> None:
    for name in EFFECT_NAMES:
        if name in ("motor_saturation", "ceiling_effect"):
            continue
        rng = np.random.default_rng(5)
        sizes = []
        for size in SIZES:
            values = draw(name, size, rng)
            neutral = {k: v.neutral for k, v in EFFECTS[name].parameters.items()}
            keys = {"tether": ["stiffness"], "motor_warming": ["loss"]}.get(name, list(values))
            sizes.append(np.linalg.norm([values[k] - (neutral[k] or 0.0) for k in keys]))
        assert sizes[0] < sizes[1] < sizes[2], name


def test_a_campaign_is_files_that_can_be_read_and_an_answer_elsewhere(tmp_path: Path) -> None:
    out, answer = tmp_path / "flights", tmp_path / "sealed" / "answer.json"
    paths = make_flights("rotor_drag", "medium", 1, 3, out=out, answer=answer)
    assert sorted(out.iterdir()) == sorted(paths)
    assert [p.stem for p in paths] == [name for name, _ in campaign(3)]
    for path in paths:
        assert "rotor_drag" not in path.read_text()
        flight = open_flight(path)
        assert flight.t.size == 3500
        assert np.diff(flight.t) == pytest.approx(0.01)
        assert flight.has("x", "qw", "gx", "ax", "m1", "vbat")
        assert not flight.has("vx")
        assert set(np.unique(flight.data["m1"] % 1.0)) == {0.0}
    sealed = json.loads(answer.read_text())
    assert sealed["effects"][0]["name"] == "rotor_drag"
    assert sealed["effects"][0]["parameters"]["coefficient"] == pytest.approx(1e-6, rel=0.16)
    assert sealed["flights"] == [p.name for p in paths]


@pytest.mark.parametrize("place", ["answer.json", "below/answer.json"])
def test_the_answer_never_lies_with_the_flights(place: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must not lie"):
        make_flights("none", "medium", 1, 1, out=tmp_path, answer=tmp_path / place)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.further
def test_one_seed_gives_the_same_bytes_and_another_others(tmp_path: Path) -> None:
    def made(folder: str, seed: int, defects: bool) -> list[bytes]:
        paths = make_flights(
            "two",
            "weak",
            seed,
            1 + defects,
            out=tmp_path / folder,
            answer=tmp_path / f"{folder}.json",
            defects=defects,
        )
        return [*(p.read_bytes() for p in paths), (tmp_path / f"{folder}.json").read_bytes()]

    for defects in (False, True):
        first = made("a", 5, defects)
        assert made("b", 5, defects) == first
        assert all(x != y for x, y in zip(made("c", 6, defects), first, strict=True))


@pytest.mark.further
def test_the_second_tier_is_damaged_as_told(tmp_path: Path, vehicle: np.ndarray) -> None:
    paths = make_flights("none", "weak", 8, 4, out=tmp_path / "f", answer=tmp_path / "a.json", defects=True)
    shares, lags, tilts = [], [], []
    for number, (path, (name, shape)) in enumerate(zip(paths, campaign(4), strict=True)):
        flight = open_flight(path)
        true = hidden_flight(vehicle, name, shape, 8, number, defects=True)
        pwm = np.column_stack([flight.data[f"m{k}"] for k in (1, 2, 3, 4)])[ALOFT_ROWS]
        straight = np.all(np.abs(np.diff(pwm, n=2, axis=0)) < 2.0, axis=1)
        if number == 3:  # the last one's link died: a straight line to the end
            tail = np.diff(flight.data["m1"][2850:], n=2)
            assert np.abs(tail).max() < 0.05
            assert np.ptp(flight.data["m1"][2850:]) > 0.0
            continue
        shares.append(straight.mean())
        x = np.column_stack([flight.data[c] for c in "xyz"])[ALOFT_ROWS]
        misses = [np.sum((x - true.states[2500 + s : 14700 + s : 5, :3]) ** 2) for s in range(-60, 61)]
        lags.append(-0.002 * (int(np.argmin(misses)) - 60))
        q = np.column_stack([flight.data[c] for c in ("qx", "qy", "qz", "qw")])[:200]
        tilts.append(np.degrees(np.arccos(turned(q, [0.0, 0.0, 1.0])[:, 2].mean())))
    assert 0.02 < np.mean(shares) < 0.09
    assert np.ptp(lags) > 0.01
    assert max(np.abs(lags)) < 0.1
    assert all(0.4 < tilt < 3.2 for tilt in tilts)


def test_the_program_shares_no_code_with_what_it_judges() -> None:
    for path in Path(hidden_effects.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names = [f"{node.module}"]
            for name in names:
                assert not name.startswith(("sim_backend", "calibration", "perchhw")), (path, name)
                assert not name.startswith("onboard") or name == "onboard.vehicle", (path, name)


def test_the_command_writes_a_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = ["--case", "none", "--flights", "1", "--seed", "4"]
    where = ["--out", str(tmp_path / "f"), "--answer", str(tmp_path / "a.json")]
    monkeypatch.setattr(sys, "argv", ["truth", *given, *where])
    runpy.run_module("tests.truth.hidden_effects", run_name="__main__")
    assert json.loads((tmp_path / "a.json").read_text())["verdict"] == "no_gap"
    assert len(list((tmp_path / "f").iterdir())) == 1


def test_a_case_that_does_not_exist_is_refused(vehicle: np.ndarray) -> None:
    with pytest.raises(ValueError, match="unknown case 'gremlins'"):
        hide("gremlins", "weak", 1, vehicle)


def test_an_effect_of_no_size_is_no_effect(vehicle: np.ndarray) -> None:
    """Two vehicles meet the same air: what differs between their flights is the effect alone."""
    plain = hidden_flight(vehicle, "a", "circle_fast", 3, 1)
    same = Hidden(vehicle.copy())
    same.add("rotor_drag", {"coefficient": 0.0})
    assert np.array_equal(hidden_flight(same.vehicle, "a", "circle_fast", 3, 1).log, plain.log)
