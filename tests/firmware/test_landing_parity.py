"""One step of the landing machine in C, from any memory and on any sample, held to the reference's."""

import math
from typing import Any

import numpy as np
import pytest

from onboard.app_interface import EndReason, LandingState
from onboard.arrays import Quaternion
from onboard.firmware.library import CoreLibrary
from onboard.landing.model import LandingInputs, LandingLimits, LandingOutput, new_landing_memory
from onboard.landing.state_machine import landing_step
from onboard.rotation import from_rotation_vector
from onboard.trajectory import ApproachPlan, plan_from_velocity, sample_approach
from tests.firmware.float32 import VEHICLES, limits32, rounded, rounded_all
from tests.firmware.mutation.machine import LandingInC

VEHICLE = VEHICLES[0]
PLANS: tuple[ApproachPlan, ...] = tuple(
    rounded_all(plan_from_velocity(*numbers))
    for numbers in (
        (1.607, 1.9151, 0.2, 0.1, 2.1, 2.0, 3.1, 0.4),
        (0.0, 1.5, 0.0, -0.1, 2.1, 1.0, 3.5, 0.5),
        (1.0, 3.0, 0.3, 0.0, 3.0, 3.0, 3.1, 0.3),
        (1.0, 3.0, 0.3, 0.0, 1.0, 3.0, 3.1, 0.3),  # begins below the floor
    )
)
FLAGS = ("state", "trajectory_status", "reason", "arm_seen", "go_seen", "attitude_known", "snapshot_count")
TIMES = ("start_time", "flip_time", "usable_time", "hold_time", "snapshot_time")
COPIED = ("hold_position", "hold_velocity", "snapshot_velocity", "snapshot_tau", "snapshot_theta_x",
          "snapshot_d_ceil", "snapshot_trigger_value", "snapshot_a_rot", "snapshot_z")  # fmt: skip
STRANGE = (math.nan, math.inf, -math.inf, 0.0, -1.0, 30.0)
LEVEL = (0.0, 0.0, 0.0, 1.0)
DAY, WRAP = 86_400_000, 2**32 + 300
"""ms: a clock of a day, and one that has just begun again."""


class Cases:
    """Random memories and samples, float32 all of them, near enough to an approach to matter."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def one_of(self, *choices: Any) -> Any:
        return choices[self.rng.integers(len(choices))]

    def mostly(self, value: Any, *others: Any) -> Any:
        return value if self.rng.random() < 0.9 else self.one_of(*others)

    def off(self, *scales: float) -> np.ndarray:
        """Three numbers around zero, of one of these sizes."""
        return self.rng.normal(0.0, self.one_of(*scales), 3)

    def ago(self, tick: int, most: int) -> float:
        """A time (s) up to `most` ms before; none of the machine's limits exactly."""
        ms = int(self.rng.integers(most))
        return (tick - ms - (ms % 50 == 0)) / 1000.0

    def attitude(self) -> Quaternion:
        """Level or tilted by up to 170 deg."""
        axis = self.rng.normal(0.0, 1.0, 3)
        turn = self.one_of(0.0, 0.1, 1.1, 1.3, 2.0, 3.0) * axis / np.linalg.norm(axis)
        x, y, z, w = from_rotation_vector(tuple(turn))
        return rounded(x), rounded(y), rounded(z), rounded(w)

    def memory(self, tick: int) -> Any:
        memory = new_landing_memory()
        memory.state = self.one_of(*(int(state) for state in LandingState), int(LandingState.APPROACH))
        memory.trajectory_status, memory.reason = self.rng.integers(6), self.rng.integers(len(EndReason))
        memory.arm_seen, memory.go_seen = self.mostly(0, 1), self.mostly(0, 1)
        memory.attitude_known = self.mostly(1, 0)
        memory.attitude = self.mostly(self.attitude(), LEVEL)
        memory.start_time, memory.flip_time = self.ago(tick, 3000), self.ago(tick, 700)
        memory.usable_time, memory.hold_time = self.ago(tick, 700), self.ago(tick, 2000)
        memory.snapshot_count, memory.snapshot_a_rot = (
            self.rng.integers(200),
            rounded(self.rng.normal(0, 8e-3)),
        )
        return memory

    def sample(self, memory: Any, tick: int, plan: ApproachPlan) -> LandingInputs:
        """Near where the memory has the drone: at the start, on its plan, in its hold, or at the ceiling."""
        rng, state = self.rng, LandingState(int(memory.state))
        known = math.isfinite(plan.x0)
        elapsed = tick / 1000.0 - memory.start_time if state is LandingState.APPROACH else 0.0
        position, velocity, _ = sample_approach(plan, elapsed) if known else ((0.0,) * 3, (0.0,) * 3, None)
        x, y, z = position + self.off(1e-3, 0.05, 0.15, 0.4)
        v = self.one_of(velocity, np.zeros(3)) + self.off(1e-3, 0.05, 0.2, 1.0, 3.0)
        z = self.one_of(z, z, plan.ceiling_z - rng.uniform(-0.05, 0.3))
        memory.hold_position = np.float32(np.array([x, y, z]) + self.off(1e-3, 0.3, 0.8))
        memory.hold_velocity = np.float32(self.mostly(self.off(0.3, 1.5), np.zeros(3)))
        tau = abs(rng.normal(0.0, 0.3))
        ended = state in (LandingState.CUT, LandingState.FAULT)
        switches = (0.3, 0.3, 0.3, 0.1, 0.4) if ended else (0.7, 0.7, 0.7, 0.1, 0.9)
        numbers = {
            "position": (x, y, z),
            "velocity": v,
            "quaternion": tuple(memory.attitude) if rng.random() < 0.5 else self.attitude(),
            "gyro": self.off(0.05, 2.0, 15.0),
            "cues": (tau, rng.normal(0.0, 4.0), tau * max(v[2], 0.01)),
            "policy": (rng.normal(0.5, 0.5), rng.normal(0.0, 8e-3)),
        }
        for part, values in numbers.items():
            numbers[part] = tuple(rounded(value) for value in values)
            if rng.random() < 0.05:
                spoilt = list(numbers[part])
                spoilt[rng.integers(len(spoilt))] = self.one_of(*STRANGE)
                numbers[part] = tuple(spoilt)
        return LandingInputs(
            tick / 1000.0, rounded(self.mostly(self.one_of(0.001, 0.002), 0.0, -0.001, 0.099, 0.1, math.nan)),
            numbers["position"], numbers["velocity"], numbers["quaternion"], numbers["gyro"],
            self.mostly(0.005, 0.149, 0.151, math.inf), *numbers["cues"], bool(rng.random() < 0.7),
            *numbers["policy"], *(bool(rng.random() < share) for share in switches),
        )  # fmt: skip


def check(case: int, found: tuple[Any, LandingOutput], wanted: tuple[Any, LandingOutput]) -> None:
    (memory, output), (reference, motors) = found, wanted
    for name in FLAGS:
        assert memory[name] == reference[name], (case, name)
    for name in TIMES:
        assert memory[name] == pytest.approx(reference[name], abs=1e-6), (case, name)
    for name in COPIED:
        assert np.array_equal(memory[name], reference[name], equal_nan=True), (case, name)
    assert output.mode == motors.mode, case
    for name, bound in (("attitude", 1e-6), ("snapshot_pitch", 2e-6)):
        assert np.allclose(memory[name], reference[name], 0.0, bound, equal_nan=True), (case, name)
    for name in ("position", "velocity", "acceleration", "collective", "thrusts"):
        mine, other = getattr(output, name), getattr(motors, name)
        assert np.allclose(mine, other, 1e-5, 1e-5, equal_nan=True), (case, name, mine, other)


def compare(core: CoreLibrary, seed: int, count: int) -> set[tuple[int, int]]:
    """`count` steps from different memories; the states before and after."""
    cases, in_c, seen = Cases(seed), LandingInC(core, VEHICLE), set()
    for case in range(count):
        tick = cases.one_of(DAY, WRAP) + int(cases.rng.integers(5000)) % 400
        plan = cases.one_of(*PLANS)
        limits: LandingLimits = limits32(VEHICLE, cases.one_of(0.206, 0.05, 0.0, math.nan))
        memory = cases.memory(tick)
        inputs = cases.sample(memory, tick, plan)
        mine, reference = memory.copy(), memory.copy()
        with np.errstate(all="ignore"):
            wanted = landing_step(reference, inputs, plan, limits)
        check(case, (mine, in_c.step(mine, inputs, plan, limits)), (reference, wanted))
        seen.add((int(memory.state), int(reference.state)))
    return seen


def test_one_step_from_any_memory(core: CoreLibrary) -> None:
    changes = compare(core, seed=1, count=3000)
    ways = {(LandingState(before).name, LandingState(after).name) for before, after in changes}
    assert ways >= {
        ("IDLE", "TRAJECTORY_ARMED"), ("TRAJECTORY_ARMED", "IDLE"), ("TRAJECTORY_ARMED", "APPROACH"),
        ("APPROACH", "FLIP"), ("APPROACH", "BRAKE"), ("APPROACH", "CUT"), ("FLIP", "CUT"),
        ("BRAKE", "HOLD"), ("BRAKE", "CUT"), ("BRAKE", "FAULT"), ("HOLD", "IDLE"), ("HOLD", "CUT"),
        ("HOLD", "FAULT"), ("CUT", "IDLE"), ("FAULT", "IDLE"),
    }  # fmt: skip


def last_height(step: Any, climb: float, after: float) -> float:
    """Up to where an approach without a policy goes on, `after` s into it, at that climb (m/s)."""
    plan, limits = PLANS[0], limits32(VEHICLE, math.nan)
    low, high = 0.5, plan.ceiling_z - limits.contact_distance - 1e-3
    while high - low > 1e-5:
        z = rounded(0.5 * (low + high))
        memory = new_landing_memory()
        memory.state, memory.attitude_known, memory.attitude = int(LandingState.APPROACH), 1, LEVEL
        memory.start_time = 10.0
        inputs = (
            Cases(seed=1)
            .sample(memory, 10_000 + round(1000 * after), plan)
            ._replace(
                dt=rounded(0.001),
                position=(0.0, plan.y0, z),
                velocity=(0.0, 0.0, rounded(climb)),
                quaternion=LEVEL,
                gyro=(0.0, 0.0, 0.0),
                pose_age=0.0,
                policy_armed=False,
                trajectory_armed=True,
                abort=False,
                flying=True,
            )
        )
        step(memory, inputs, plan, limits)
        low, high = (z, high) if memory.state == int(LandingState.APPROACH) else (low, z)
    return low


@pytest.mark.parametrize("after", [1.0, 1.7])
def test_an_approach_without_a_policy_brakes_at_the_same_height(core: CoreLibrary, after: float) -> None:
    """While it still speeds up, and after; slow and fast."""
    for climb in (0.05, 1.0, 2.0):
        heights = [last_height(step, climb, after) for step in (LandingInC(core, VEHICLE).step, landing_step)]
        assert heights[0] == pytest.approx(heights[1], abs=2e-5), climb
        assert heights[0] < PLANS[0].ceiling_z - limits32(VEHICLE, math.nan).brake_margin
