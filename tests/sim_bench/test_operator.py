"""The person at the bench: what they do, read, and refuse."""

import math
from typing import Any

import numpy as np
import pytest

from onboard.gravity import GRAVITY
from sim_backend.bench.bench import Bench, BenchOptions, Place
from sim_backend.bench.hanging import SimulatedJig
from sim_backend.bench.operator import SimulatedOperator
from sim_backend.bench.readings import Grade
from tests.sim_bench.benches import HANG_Z, STRINGS, Stand, vehicle


def hang(stand: Stand, axis: list[float]) -> None:
    assert stand.say(do="hang", axis=axis, **STRINGS) == {"done": True}


def swing(stand: Stand, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """True body rates (n, 3) and specific forces (n, 3) for so long."""
    hung, count = stand.bench.hung, round(seconds * 1000)
    assert hung is not None
    rates, forces = np.zeros((count, 3)), np.zeros((count, 3))
    for rate, force in zip(rates, forces, strict=True):
        hung.step(0.001)
        hung.feel(force, rate)
    return rates, forces


def let_go(stand: Stand, **request: object) -> float:
    """A request without the rest of the bench living on; the s that it takes."""
    seconds = stand.operator.perform(request).at - stand.bench.time
    swing(stand, seconds)
    return seconds


def test_nothing_can_be_twisted_or_measured_before_it_hangs() -> None:
    stand = Stand()
    for request in ({"do": "twist", "angle": 0.1}, {"do": "damp"}, {"do": "take_down"}):
        assert "hang it first" in stand.say(**request)["error"]
    assert "hang the drone first" in stand.say(ask="string_length")["error"]


@pytest.mark.parametrize(
    "request_",
    [
        {},
        {"do": "dance"},
        {"do": ["hang"]},
        {"ask": "age"},
        {"ask": {}},
        {"do": "hang"},
        {"do": "hang", "axis": [0, 0, 0], **STRINGS},
        {"do": "hang", "axis": [0, 0, math.nan], **STRINGS},
        {"do": "hang", "axis": "z", **STRINGS},
        {"do": "hang", "axis": [0, 0, 1], **(STRINGS | {"string_distance_top": 60})},
        {"do": "hang", "axis": [0, 0, 1], **(STRINGS | {"string_distance_top": 0.7})},
        {"do": "clamp"},
        {"do": "clamp", "motor": 5},
        {"do": "clamp", "motor": 1.5},
        {"do": "clamp", "motor": True},
        {"do": "put_weight", "mass": "50 g"},
        {"do": "replug"},
    ],
)
def test_what_makes_no_sense_is_answered_with_a_reason(request_: dict[str, Any]) -> None:
    stand = Stand()
    reply = stand.operator.perform(request_).document
    assert len(reply["error"]) > 10
    assert stand.bench.place is Place.FLOOR


def test_turns_about_the_axis_that_was_asked_for_with_its_inertia() -> None:
    body = vehicle().body
    inertia = {0: body.inertia_xx.value, 1: body.inertia_yy.value, 2: body.inertia_zz.value}
    for index in range(3):
        axis = [float(i == index) for i in range(3)]
        stand = Stand(seed=index)
        hang(stand, axis)
        let_go(stand, do="twist", angle=0.1)
        rates, _ = swing(stand, 30.0)
        direction = np.linalg.svd(rates, full_matrices=False)[2][0]
        assert abs(direction[index]) > math.cos(math.radians(4.0))
        spin = rates @ direction
        ups = np.flatnonzero((spin[:-1] < 0) & (spin[1:] >= 0))
        period = (ups[-1] - ups[0]) * 1e-3 / (len(ups) - 1)
        d = [stand.say(ask=f"string_distance_{end}")["value"] for end in ("top", "bottom")]
        length, mass = stand.say(ask="string_length")["value"], stand.say(ask="mass")["value"]
        found = mass * GRAVITY * d[0] * d[1] * period**2 / (16 * math.pi**2 * length)
        assert found == pytest.approx(inertia[index], rel=0.015)


def test_rest_shows_the_tilt_and_hangs_still() -> None:
    tilts = []
    for seed in range(30):
        stand = Stand(seed=seed)
        hang(stand, [0, 0, 1])
        rates, forces = swing(stand, 0.01)
        assert np.abs(rates).max() == 0.0
        assert np.linalg.norm(forces[-1]) == pytest.approx(GRAVITY, rel=1e-6)
        tilts.append(math.degrees(math.acos(forces[-1][2] / GRAVITY)))
    assert math.sqrt(np.mean(np.square(tilts))) == pytest.approx(1.0, abs=0.3)


def test_hanging_again_draws_new_errors_but_keeps_the_strings() -> None:
    stand = Stand()
    hang(stand, [0, 0, 1])
    first, strings = stand.bench.hung, stand.operator._strings
    hang(stand, [0, 0, 1])
    assert first is not None
    assert stand.bench.hung is not None
    assert not np.allclose(first.vertical, stand.bench.hung.vertical)
    assert first.pendulum.hung.offset != stand.bench.hung.pendulum.hung.offset
    assert stand.operator._strings is strings
    stand.say(do="hang", axis=[0, 0, 1], **(STRINGS | {"string_length": 0.7}))
    assert stand.operator._strings is not strings


def test_twist_swings_a_little_and_damp_ends_it() -> None:
    shares = []
    for seed in range(12):
        stand = Stand(seed=seed)
        hang(stand, [0, 0, 1])
        assert let_go(stand, do="twist", angle=0.15) == pytest.approx(1.5)
        rates, _ = swing(stand, 3.0)
        first, second = np.linalg.svd(rates, full_matrices=False)[1][:2]
        shares.append(second / first)
    assert min(shares) > 0.005
    assert max(shares) < 0.08
    let_go(stand, do="damp")
    assert np.abs(swing(stand, 0.1)[0]).max() == 0.0


def test_swinging_touching_and_draughty_pendulums() -> None:
    def rates(**faults: float) -> np.ndarray:
        stand = Stand(seed=5, **faults)
        hang(stand, [0, 0, 1])
        let_go(stand, do="twist", angle=0.15)
        return swing(stand, 20.0)[0]

    free, touching, wild = rates(), rates(touch=0.05), rates(swing=0.3)
    assert np.abs(touching[-2000:, 2]).max() < 0.2 * np.abs(free[-2000:, 2]).max()
    size = np.abs(np.fft.rfft(wild[:, 2] * np.hanning(len(wild))))
    lines = np.fft.rfftfreq(len(wild), 1e-3)
    main = lines[np.argmax(size)]
    near = (lines > 0.4) & (lines < 1.2) & (np.abs(lines - main) > 0.12)
    assert size[near].max() > 0.1 * size.max()
    stand = Stand(seed=5, draught=0.2)
    hang(stand, [0, 0, 1])
    assert swing(stand, 5.0)[0].std() > 0.02


def test_readings_spread_as_the_instruments_do() -> None:
    stand = Stand()
    hang(stand, [0, 0, 1])
    for name, half in (("mass", 2e-5), ("string_distance_top", 1e-4), ("string_length", 5e-4)):
        values = np.array([stand.say(ask=name)["value"] for _ in range(500)])
        assert np.ptp(values) == pytest.approx(2 * half, rel=0.05)
        assert values.std() == pytest.approx(half / math.sqrt(3.0), rel=0.1)
    assert stand.say(ask="mass")["unit"] == "kg"
    assert stand.say(ask="mass")["value"] == pytest.approx(vehicle().body.mass.value, abs=2e-5)
    ruler = SimulatedOperator(stand.bench, lambda name: name, Grade(distance=5e-4, length=1e-3, mass=5e-5))
    ruler.perform(HANG_Z)
    rough = [ruler.perform({"ask": "string_distance_top"}).document["value"] for _ in range(300)]
    assert np.ptp(rough) == pytest.approx(2 * 5e-4, rel=0.05)


def test_a_jig_weighs_and_turns_with_the_drone() -> None:
    bench = Bench(vehicle(), BenchOptions(jig=SimulatedJig(0.004, 1e-6)))
    operator = SimulatedOperator(bench, lambda name: name)
    operator.perform(HANG_Z)
    assert bench.hung is not None
    hung = bench.hung.pendulum.hung
    assert hung.mass == pytest.approx(vehicle().body.mass.value + 0.004)
    assert hung.inertia == pytest.approx(vehicle().body.inertia_zz.value + 1e-6, rel=0.01)
    assert operator.perform({"ask": "jig_mass"}).document == {"value": 0.004, "unit": "kg"}
    assert operator.perform({"ask": "jig_inertia"}).document == {"value": 1e-6, "unit": "kg m2"}


def test_nobody_touches_an_armed_drone_or_turning_motors() -> None:
    stand = Stand()
    stand.bench.run(1.0)
    hang(stand, [0, 0, 1])
    stand.bench.firmware.supervisor.arm(True)
    stand.bench.run(0.2)
    assert stand.bench.firmware.supervisor.is_armed
    assert "armed" in stand.say(do="twist", angle=0.1)["error"]
    stand.bench.firmware.supervisor.arm(False)
    stand.command(20 * 256, 0, 0, 0)
    stand.bench.run(0.1)
    for action in ("twist", "clamp", "mount_on_scale", "place_on_floor"):
        assert "turn" in stand.say(do=action, angle=0.1, motor=1)["error"]
    assert "hung on its strings" in stand.bench.record.incidents[0]


def test_weights_push_the_scale() -> None:
    stand = Stand()

    def grams() -> float:
        return float(np.mean(stand.bench.cell._recent))

    for mass in (0.0, 0.02, 0.05):
        stand.say(do="put_weight", mass=mass)
        stand.bench.run(0.2)
        assert grams() == pytest.approx(1000 * mass, rel=2e-4, abs=1e-9)
    stand.say(do="remove_weight")
    stand.say(do="mount_on_scale")
    stand.bench.run(0.2)
    assert grams() == pytest.approx(45.0 + 38.1, abs=0.01)


def test_multimeter_reads_the_drone_once_it_is_on_the_supply() -> None:
    stand = Stand(lead_resistance=0.5)
    stand.supply("VOLT 4.0", "CURR 8", "OUTP ON")
    stand.say(do="clamp", motor=2)
    stand.bench.run(1.0)
    stand.command(0, 100 * 256, 0, 0)
    stand.bench.run(2.0)
    volts = stand.say(ask="supply_voltage")["value"]
    assert volts == pytest.approx(stand.bench.board_voltage, rel=0.0011)
    assert volts < 3.9


def test_replugging_gives_the_new_name() -> None:
    assert Stand().say(do="replug", instrument="scale") == {"done": True, "device": "/dev/new-scale"}
