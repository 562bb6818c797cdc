"""Whole approaches with the drone's code in C and with its reference: do they end alike? One JSON document.

    python benchmarks/engines.py [--flights 200] [--seed 0]

Each condition (speed 1.5 to 3.5 m/s, angle 30 to 90 deg, those that the policy covers and the room has
place for) is flown twice in a simulated world, from the floor to 1.5 s after the motors were cut, with the
same noise. Two flights end alike when they trigger on the same sample and land the same way. Where they do
not, the trigger values of the last samples and the touches of the feet (how fast each met the ceiling, what
its pad wants) tell whether it was a threshold.
"""

import argparse
import json
import math
import struct
import sys
from typing import Any

import numpy as np
from landings_in_the_lab import LOOKS, time_in_region

from onboard.app_interface import MEMORY_TYPE_APP, LandingState, Parameter
from onboard.policy.bundle import bundle_crc32, encode_bundle
from onboard.policy.files import Policy, find_policy, load_policy, policy_crc32
from onboard.room import RoomGeometry
from onboard.rotation import rotate
from onboard.trajectory import ApproachError, ApproachPlan, fit_approach
from onboard.vehicle import load_vehicle
from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE
from sim_backend.crazyflie.engine import SnapshotField
from sim_backend.crazyflie.high_level import HighLevelCommand
from sim_backend.engine_name import EngineName, usable_engine
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.state import FootMode
from sim_backend.world import World

POSE_DELAY_MS = 10
SETTLED_S = 1.5
"""s after the cut: what holds then stays."""


class Pilot:
    """The hands of an operator, and a mocap room, for one flight in a world of its own."""

    def __init__(self, engine: EngineName, seed: int) -> None:
        vehicle = load_vehicle(DEFAULT_VEHICLE)
        self.world = World(vehicle, seed=seed, engine=engine)
        self.drone = self.world.drones[0]
        self.firmware = self.drone.firmware
        self.values: list[float] = []
        self.touches: dict[int, dict[str, Any]] = {}
        self._climbs = [0.0] * 4
        self._physics = physics_parameters(vehicle, RoomGeometry())
        self._poses: list[tuple[float, ...]] = []

    def run(self, seconds: float) -> None:
        """Simulate, with poses at 100 Hz; keep the trigger values of the approach."""
        for _ in range(round(1000 * seconds)):
            if self.world.ticks % POSE_DELAY_MS == 0:
                _, position, quaternion = self.drone.pose()
                self._poses.append((*position, *quaternion))
                if len(self._poses) > 1:
                    self.firmware.localization.external_pose(*self._poses.pop(0))  # type: ignore[arg-type]
            self.world.step()
            engine = self.firmware.engine
            if self.firmware.tick_ms() % 10 == 0 and engine.state in (
                LandingState.APPROACH,
                LandingState.FLIP,
            ):
                self.values.append(engine.trigger_value)
            if engine.state is LandingState.CUT:
                self._watch_feet()

    def _watch_feet(self) -> None:
        """Keep how fast (m/s) each foot first met the ceiling: in the ms before."""
        state, physics = self.drone.state, self._physics
        for foot in range(4):
            mode = FootMode(int(state["foot_mode"][foot]))
            if foot not in self.touches and mode in (FootMode.PRESSING_CEILING, FootMode.ATTACHED):
                spread = physics["capture_spread"] * state["pad_deviate"][foot]
                self.touches[foot] = {
                    "tick": self.firmware.tick_ms(),
                    "climb_m_s": self._climbs[foot],
                    "pad_wants_m_s": float(physics["capture_speed"] + spread),
                    "sticks": not state["foot_refused"][foot],
                }
            arm = physics["hip"][foot] + physics["leg_length"] * physics["leg_direction"][foot]
            turning = rotate(state["quaternion"], np.cross(state["omega"], arm))
            self._climbs[foot] = float(state["velocity"][2] + turning[2])

    def write(self, name: str, value: float) -> None:
        """Write a parameter, and wait until its callback is done."""
        entry = self.firmware.params.entry(name)
        self.firmware.params.write_raw(entry.ident, entry.encode(value))
        self.firmware.params.notify(entry.ident)
        while self.firmware.params.busy:
            self.run(0.001)

    def order(self, command: HighLevelCommand, layout: str, *values: float) -> None:
        """A command of the planner."""
        self.firmware.commander.high_level(int(command), struct.pack(layout, *values))

    def fly(self, policy: Policy, plan: ApproachPlan) -> dict[str, Any]:
        """From the floor to the ceiling; how it went."""
        bundle = encode_bundle(policy)
        memory = next(part for part in self.firmware.memories if part.type_id == MEMORY_TYPE_APP)
        self.run(0.5)
        memory.write(0, bundle)
        self.write(Parameter.POLICY_LENGTH, len(bundle))
        self.write(Parameter.POLICY_CRC, bundle_crc32(bundle))
        self.write(Parameter.POLICY_COMMIT, 1)
        self.firmware.supervisor.arm(True)
        self.run(0.2)
        self.order(HighLevelCommand.TAKEOFF_2, "<BffBf", 0, 0.5, 0.0, 1, 1.5)
        self.run(2.0)
        self.order(HighLevelCommand.GO_TO_2, "<BBB5f", 0, 0, 0, plan.x0, plan.y0, plan.z0, 0.0, 3.0)
        self.run(4.5)
        for name, value in approach_parameters(plan).items():
            self.write(name, value)
        self.write(Parameter.TRAJECTORY_ARM, 1)
        self.write(Parameter.POLICY_ARM, 1)
        self.write(Parameter.GO, 1)
        self.run(plan.impact_time + 0.5 + SETTLED_S)
        engine, state = self.firmware.engine, self.drone.state
        triggered = engine.snapshot_count > 0
        return {
            "state": engine.state.name,
            "reason": engine.reason.name,
            "trigger_tick": engine.snapshot_tick if triggered else None,
            "a_rot": engine.snapshot(SnapshotField.A_ROT) if triggered else None,
            "legs": int(np.count_nonzero(state["foot_attached"])),
            "body_contact": bool(state["body_contact"]),
        }


def approach_parameters(plan: ApproachPlan) -> dict[str, float]:
    """What the ground writes of an approach."""
    return {
        Parameter.CEILING_Z: plan.ceiling_z,
        Parameter.IMPACT_X: plan.impact_x,
        Parameter.IMPACT_Y: plan.y0,
        Parameter.SPEED_X: plan.vx,
        Parameter.SPEED_Z: plan.vz,
        Parameter.ACCELERATION_X: plan.ax,
        Parameter.ACCELERATION_Z: plan.az,
        Parameter.TAU_START: plan.tau0,
    }


def draw(rng: np.random.Generator, policy: Policy) -> tuple[float, float, ApproachPlan]:
    """Speed (m/s), angle (deg) and plan of a condition that policy and room have place for."""
    while True:
        speed, angle = round(rng.uniform(1.5, 3.5), 2), round(rng.uniform(30.0, 90.0), 1)
        if time_in_region(policy, speed, math.radians(angle)) < LOOKS * 0.01:
            continue
        try:
            return speed, angle, fit_approach(speed, angle, RoomGeometry())
        except ApproachError:
            continue


def way(end: dict[str, Any]) -> tuple[Any, ...]:
    """What must be alike: the trigger's sample, the machine's end, and the kind of landing."""
    legs = "four" if end["legs"] >= 3 else "two" if end["legs"] >= 1 else "none"
    return end["state"], end["reason"], end["trigger_tick"], legs, end["body_contact"]


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--flights", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="of the conditions and of the noise")
    arguments = parser.parse_args()
    usable_engine(EngineName.C)
    policy = load_policy(find_policy(DEFAULT_POLICY))
    rng = np.random.default_rng(arguments.seed)
    alike, same_trigger, moments, differences = 0, 0, [0.0], []
    for index in range(arguments.flights):
        speed, angle, plan = draw(rng, policy)
        pilots = {engine: Pilot(engine, arguments.seed + index) for engine in EngineName}
        ends = {engine.value: pilot.fly(policy, plan) for engine, pilot in pilots.items()}
        c, reference = ends["c"], ends["reference"]
        alike += way(c) == way(reference)
        if c["trigger_tick"] == reference["trigger_tick"]:
            same_trigger += 1
            moments.append(abs((c["a_rot"] or 0.0) - (reference["a_rot"] or 0.0)))
        if way(c) != way(reference):
            values = {engine.value: pilot.values[-3:] for engine, pilot in pilots.items()}
            touches = {engine.value: pilot.touches for engine, pilot in pilots.items()}
            differences.append(
                {"speed_m_s": speed, "angle_deg": angle, **ends, "last_values": values, "touches": touches}
            )
        print(f"{index + 1} flown, {alike} alike", file=sys.stderr, flush=True)
    document = {
        "benchmark": "engines",
        "policy_crc32": policy_crc32(policy),
        "seed": arguments.seed,
        "flights": arguments.flights,
        "alike": alike,
        "same_trigger": same_trigger,
        "largest_a_rot_difference_n_m": max(moments),
        "differences": differences,
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
