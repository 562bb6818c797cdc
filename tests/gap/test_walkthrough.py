"""The walk-through: its parts that take seconds. The whole of it is one command (docs/gap_walkthrough.md)."""

from pathlib import Path
from typing import Any

import pytest

from onboard.policy.files import load_policy, shipped_policy_path
from onboard.vehicle import load_vehicle
from perchhw.walkthrough.gap.story import BELIEVED, HIDDEN, write_hidden
from perchhw.walkthrough.rates import RATE_GRID, SWEEP, landing_rates
from perchhw.walkthrough.steps import step


def test_the_hidden_change_costs_landings(tmp_path: Path) -> None:
    policy = load_policy(shipped_policy_path("default"))
    hidden = write_hidden(tmp_path / "hidden")
    before, after = landing_rates(policy, BELIEVED, 1), landing_rates(policy, str(hidden), 1)
    assert before["realistic"]["clean"] > 0.9
    assert after["realistic"]["clean"] < before["realistic"]["clean"] - 0.15
    assert after["late"]["clean"] < before["late"]["clean"] - 0.4


def test_only_the_effects_are_hidden(tmp_path: Path) -> None:
    hidden, believed = load_vehicle(write_hidden(tmp_path / "hidden")), load_vehicle(BELIEVED)
    assert {effect.name for effect in hidden.effects} == set(HIDDEN)
    assert hidden.body == believed.body
    assert hidden.motors == believed.motors


def test_what_is_learned_covers_where_rates_are_counted() -> None:
    speeds, angles = {c.speed for c in RATE_GRID}, {c.angle_deg for c in RATE_GRID}
    assert min(SWEEP.speeds) < min(speeds) < max(speeds) < max(SWEEP.speeds)
    assert min(SWEEP.angles_deg) < min(angles) < max(angles) < max(SWEEP.angles_deg)


def test_a_step_is_done_once_and_only_when_it_came_to_its_end(tmp_path: Path) -> None:
    calls: list[Path] = []

    def work(folder: Path) -> dict[str, Any]:
        calls.append(folder)
        if len(calls) == 1:
            raise RuntimeError("interrupted")
        return {"answer": len(calls)}

    with pytest.raises(RuntimeError):
        step(tmp_path / "one", work)
    assert step(tmp_path / "one", work) == {"answer": 2}
    assert step(tmp_path / "one", work) == {"answer": 2}
    assert len(calls) == 2
