"""The landing machine with its inputs in hand, step by step."""

import math
from typing import Any

from onboard.app_interface import TrajectoryStatus
from onboard.landing.state_machine import (
    EndReason,
    LandingInputs,
    LandingLimits,
    LandingOutput,
    LandingState,
    OutputMode,
    landing_limits,
    landing_step,
    new_landing_memory,
)
from onboard.rotation import integrate
from onboard.trajectory import (
    ApproachPlan,
    plan_approach,
    sample_approach,
)
from onboard.vehicle import load_vehicle

LIMITS = landing_limits(load_vehicle("crazyflie21-upgraded"), 0.206)
PLAN = plan_approach(2.5, 40.0, 0.0, 2.1, 1.0, 3.1, 0.5)
LEVEL = (0.0, 0.0, 0.0, 1.0)
UPSIDE_DOWN = (0.0, 1.0, 0.0, 0.0)
NAN = math.nan


class Rig:
    """The machine at the start point, flying, with a clock of 1 ms steps."""

    def __init__(self, plan: ApproachPlan = PLAN, limits: LandingLimits = LIMITS) -> None:
        self.memory = new_landing_memory()
        self.plan = plan
        self.limits = limits
        self.inputs = LandingInputs(
            time=10.0,
            dt=1e-3,
            position=(plan.x0, plan.y0, plan.z0),
            velocity=(0.0, 0.0, 0.0),
            quaternion=LEVEL,
            gyro=(0.0, 0.0, 0.0),
            pose_age=0.01,
            tau=math.inf,
            theta_x=0.0,
            d_ceil=1.0,
            evaluated=False,
            trigger_value=-1.0,
            a_rot=0.0,
            policy_armed=False,
            trajectory_armed=False,
            go=False,
            abort=False,
            flying=True,
        )

    @property
    def state(self) -> LandingState:
        return LandingState(int(self.memory["state"]))

    @property
    def reason(self) -> EndReason:
        return EndReason(int(self.memory["reason"]))

    @property
    def status(self) -> TrajectoryStatus:
        return TrajectoryStatus(int(self.memory["trajectory_status"]))

    def step(self, **changes: Any) -> LandingOutput:
        """One step; the changes stay for the steps that follow."""
        self.inputs = self.inputs._replace(**{"time": self.inputs.time + self.inputs.dt, **changes})
        output: LandingOutput = landing_step(self.memory, self.inputs, self.plan, self.limits)
        return output

    def approach(self, elapsed: float = 0.0, **changes: Any) -> LandingOutput:
        """Arm, go, and jump `elapsed` s into the approach, exactly on the plan."""
        self.step(trajectory_armed=True)
        self.step(go=True)
        assert self.state is LandingState.APPROACH
        position, velocity, _ = sample_approach(self.plan, elapsed)
        self.inputs = self.inputs._replace(time=self.inputs.time + elapsed - self.inputs.dt)
        return self.step(go=False, position=position, velocity=velocity, **changes)

    def trigger_sample(self) -> dict[str, Any]:
        """Inputs of an armed policy that fires, 0.25 s before the ceiling."""
        position, velocity, _ = sample_approach(self.plan, self.plan.impact_time - 0.25)
        d_ceil = self.plan.ceiling_z - position[2]
        return {
            "position": position,
            "velocity": velocity,
            "policy_armed": True,
            "evaluated": True,
            "trigger_value": 0.1,
            "a_rot": -7e-3,
            "tau": d_ceil / velocity[2],
            "theta_x": velocity[0] / d_ceil,
            "d_ceil": d_ceil,
        }

    def flip(self, **changes: Any) -> LandingOutput:
        self.approach(self.plan.impact_time - 0.251, policy_armed=True)
        output = self.step(**self.trigger_sample(), **changes)
        assert self.state is LandingState.FLIP
        return output

    def brake(self) -> LandingOutput:
        self.approach(self.plan.impact_time - 0.4)
        output = self.step(abort=True)
        assert self.state is LandingState.BRAKE
        return output

    def hold(self) -> LandingOutput:
        self.brake()
        output = self.step(velocity=(1.5, 0.0, -0.6), abort=False)
        assert self.state is LandingState.HOLD
        return output


def steps_until_cut(rig: Rig, rate: float = -20.0, bad: dict[int, dict[str, Any]] | None = None) -> int:
    """Turn at `rate` rad/s about y with a matching estimate, replaced by `bad` at some steps."""
    attitude = rig.inputs.quaternion
    for count in range(1, 1000):
        attitude = integrate(attitude, (0.0, rate, 0.0), 1e-3)
        sample: dict[str, Any] = {"gyro": (0.0, rate, 0.0), "quaternion": attitude}
        output = rig.step(**{**sample, **(bad or {}).get(count, {})})
        if rig.state is not LandingState.FLIP:
            assert rig.state is LandingState.CUT
            assert output.mode == OutputMode.OFF
            return count
    raise AssertionError("the flip never ended")
