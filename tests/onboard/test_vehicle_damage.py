"""A damaged vehicle file gives a vehicle or an error that names file and key, never anything else."""

import contextlib
import copy
import math
import random
import tomllib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.errors import InputError
from onboard.vehicle import check_vehicle, known_vehicles, load_vehicle, vehicle_to_toml
from onboard.vehicle.file_format import LIBRARY, parse_vehicle
from tests.drawn_examples import examples

UPGRADED = LIBRARY / "crazyflie21-upgraded.toml"


def _damage(value: Any, rng: random.Random) -> Any:
    """`value` with one random part replaced, removed or added."""
    junk: list[Any] = [
        None,
        -1,
        0,
        1e308,
        math.inf,
        math.nan,
        "",
        "m",
        True,
        [],
        {},
        [{}],
        {"value": 1},
        10**400,
    ]
    junk += ["wind", {"name": []}, "paper-stock", {"name": "wind", "x": {"value": 1.0}}]
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = rng.choice(list(value))
        choice = rng.random()
        if choice < 0.1:
            del value[key]
        elif choice < 0.2:
            value[rng.choice(["x", "mass", "name", "form", "unit", "schema"])] = rng.choice(junk)
        else:
            value[key] = _damage(value[key], rng)
        return value
    return rng.choice(junk)


@settings(max_examples=examples(100))
@given(st.integers(0, 2**32), st.integers(1, 6), st.sampled_from(known_vehicles()), st.booleans())
def test_damaged_content_gives_a_vehicle_or_an_input_error(
    seed: int, hits: int, name: str, full: bool
) -> None:
    rng = random.Random(seed)
    changed = copy.deepcopy(_CONTENTS[name, full])
    for _ in range(hits):
        changed = _damage(changed, rng) if rng.random() < 0.98 else _damage({}, rng)
        if not isinstance(changed, dict):
            return
    try:
        vehicle = parse_vehicle(changed, "x.toml")
    except InputError:
        return
    assert vehicle.body.mass.value > 0.0


_CONTENTS = {
    (name, full): tomllib.loads(
        vehicle_to_toml(load_vehicle(name, legs="wide-short"))
        if full
        else (LIBRARY / f"{name}.toml").read_text()
    )
    for name in known_vehicles()
    for full in (False, True)
}


@settings(max_examples=examples(80))
@given(st.integers(0, 2**32), st.integers(1, 4))
def test_damaged_text_gives_a_vehicle_or_an_input_error(
    tmp_path_factory: pytest.TempPathFactory, seed: int, hits: int
) -> None:
    rng = random.Random(seed)
    data = bytearray(UPGRADED.read_bytes())
    for _ in range(hits):
        at = rng.randrange(len(data))
        match rng.randrange(3):
            case 0:
                data[at] = rng.randrange(256)
            case 1:
                del data[at : at + rng.randrange(200)]
            case _:
                data[at:at] = bytes(rng.randrange(256) for _ in range(rng.randrange(4)))
    path = tmp_path_factory.getbasetemp() / "damaged.toml"
    path.write_bytes(data)
    for problem in check_vehicle(path):
        assert "damaged.toml" in problem or problem.strip()


@pytest.mark.parametrize("name", known_vehicles())
def test_a_coefficient_of_any_size_gives_a_vehicle_or_an_input_error(name: str) -> None:
    """Of the thrust map, whose squares may be more than a float holds."""
    content = _CONTENTS[name, True]
    for coefficient in set(content["motors"]["thrust_map"]) - {"name", "form"}:
        changed = copy.deepcopy(content)
        changed["motors"]["thrust_map"][coefficient]["value"] = 1e308
        with contextlib.suppress(InputError):
            parse_vehicle(changed, name)
