"""The simulated world: drones with their physics, batteries, firmware and start marks, in steps of 1 ms.

An operator belongs to it: a drone that is rebooted and lies, stands or hangs still is put back on its start
mark with a fresh battery. That is how campaigns reset in simulation, as a person does in the laboratory.
"""

import math
from collections import deque
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import Quaternion, Vector
from onboard.room import RoomGeometry
from onboard.vehicle import Battery, Vehicle
from sim_backend.crazyflie.build import OURS, Build
from sim_backend.crazyflie.firmware import Firmware
from sim_backend.crazyflie.interfaces import Localization
from sim_backend.engine_name import EngineName
from sim_backend.errors import SimulationError
from sim_backend.fault_values import NO_TIME
from sim_backend.handling import WIRED, Wiring, attitude_in_hand, hold_in_hand, wiring_of
from sim_backend.hung import HungDrone
from sim_backend.lab_faults import DroneFaults
from sim_backend.physics.parameters import PARAMETERS, physics_parameters
from sim_backend.physics.reset import resting_on_floor
from sim_backend.physics.state import STATE
from sim_backend.physics.step import is_finite, step_first
from sim_backend.pose_feed import PERIOD_TICKS, PoseFeed
from sim_backend.survey import SimulatedSurvey
from sim_backend.tracked import Pose, tracked_pose
from sim_backend.truth import RATE_HZ, TruthRecorder

DT = 0.001
LAG_LIMIT_S = 0.05
"""A process that is further behind than this gives up simulated time instead of catching up."""
AT_REST_M_S = 0.2
CHECK_PERIOD_TICKS = 10
PADS = 1
"""Stream of random numbers for the pads of a drone's feet."""

NOISE_PERIOD_TICKS = 1000
"""Every so often the noise begins anew from the seed and the time, so that it hangs on nothing else."""
TRUTH_PERIOD_TICKS = 1000 // RATE_HZ


class WorldError(SimulationError):
    """The simulated world broke: its numbers are no longer numbers."""


@dataclass(frozen=True, slots=True)
class Placement:
    """Where the operator puts a drone down: x, y [m], heading [rad]."""

    x: float
    y: float
    yaw: float = 0.0


ROWS_TO_THE_WALL = 7


def start_marks(count: int) -> list[Placement]:
    """Marks for `count` drones, 2.5 m before the impact point: side by side in threes, rows 0.6 m apart, away
    from that point until the wall, then towards it and beyond."""
    rows = [-k if k < ROWS_TO_THE_WALL else k - ROWS_TO_THE_WALL + 1 for k in range(-(-count // 3))]
    return [Placement(-2.5 + 0.6 * rows[i // 3], (0.0, 0.5, -0.5)[i % 3]) for i in range(count)]


@lru_cache(maxsize=64)
def _standing(parameters: bytes, mark: Placement, charge_used: float) -> NDArray[np.void]:
    """The state in which a drone stands on its mark, found once for all that are alike: it settles for 2 s of
    its time. Not to be changed."""
    (record,) = np.frombuffer(parameters, dtype=PARAMETERS).copy()
    return np.array([resting_on_floor(record, mark.x, mark.y, mark.yaw, charge_used)], dtype=STATE)


class Drone:
    """One drone in the world.

    Attributes:
        name: as the mocap room knows it, ``cf1`` ...
        firmware: what flies it.
        state: record of :data:`sim_backend.physics.state.STATE`, changed in place.
        mark: its start mark.
        frozen: the firmware hangs (fault).
        dead: no power any more (fault).
        placements: how often the operator put it on its mark.
        held: attitude in which a person holds it; None: nobody does.
        hung: it hangs on a thread, without propellers; None: it does not.
        turned: whether a person who surveys the room has turned it.
    """

    def __init__(
        self,
        name: str,
        firmware: Firmware,
        parameters: Any,
        mark: Placement,
        charge_used: float,
        pads: np.random.Generator,
        wiring: Wiring = WIRED,
    ) -> None:
        self.name = name
        self.firmware = firmware
        self.mark = mark
        self.frozen = False
        self.dead = False
        self.placements = 0
        self.held: Quaternion | None = None
        self.hung: HungDrone | None = None
        self.turned = False
        self._wiring = wiring
        self._parameters = parameters
        self._pads = pads
        self._stored_parameters: NDArray[np.void] = np.array([parameters], dtype=PARAMETERS)
        self._at_mark = _standing(parameters.tobytes(), mark, charge_used).copy()
        self._storage: NDArray[np.void] = self._at_mark.copy()
        self.state: Any = self._storage[0]
        self._draw_pads()
        self._past: deque[Pose] = deque(maxlen=1 + round(float(parameters["pose_delay"]) / DT))
        # Views into the record: fields of a record are slow to look up a thousand times a second.
        self._specific_force = self.state["specific_force"]
        self._rates = self.state["omega"]
        self._outputs = self._duties = np.zeros(4)
        self._boots = firmware.boot_count
        self._to_be_placed = False

    def step(self) -> None:
        """One ms of firmware and physics."""
        if self.firmware.boot_count != self._boots:
            self._boots = self.firmware.boot_count
            self._to_be_placed = True
        if self._to_be_placed and self.at_rest:
            self.place_on_start_mark()
        if not self.frozen:
            voltage = float(self.state["battery_voltage"])
            self._outputs = self._duties = self.firmware.step(self._specific_force, self._rates, voltage)
            if self._wiring is not WIRED:
                self._duties = self._wiring.delivered(self._outputs)
        if self.hung is not None:
            self.hung.step(self.state, self._outputs, float(self.state["battery_voltage"]), DT)
            return
        if self.held is not None:
            hold_in_hand(self.state, self.held)
            return
        step_first(self._storage, self._stored_parameters, self._duties, DT)
        if self._past.maxlen != 1:
            self._past.append(self._tracked())

    @property
    def at_rest(self) -> bool:
        """Whether a person could pick it up: motors off, still, on the floor or hanging from the ceiling."""
        velocity, z = self.state["velocity"], float(self.state["position"][2])
        held = bool(self.state["foot_attached"].any()) or z < float(self._parameters["reach"]) + 0.02
        return held and not self.firmware.ratios.any() and float(np.abs(velocity).max()) < AT_REST_M_S

    @property
    def silent(self) -> bool:
        """Whether its radio answers nothing any more."""
        return self.frozen or self.dead

    def stand_turned(self, survey: SimulatedSurvey) -> None:
        """On its mark, with another heading."""
        self.place_on_start_mark()
        half = 0.5 * (self.mark.yaw + survey.heading)
        self.state["quaternion"] = (0.0, 0.0, math.sin(half), math.cos(half))
        self.state["position"][:2] += survey.aside
        self.turned = True

    def hang(self) -> None:
        """Take its propellers off and hang it on a thread, until it is put back on its mark."""
        self.hung = HungDrone(float(self._parameters["inertia"][2]), self._wiring)

    def place_on_start_mark(self) -> None:
        """The operator's work: back on the mark, upright, still, with a fresh battery."""
        self._storage[0] = self._at_mark[0]
        self._draw_pads()
        self._past.clear()
        self._to_be_placed = self.turned = False
        self.hung = None
        self.placements += 1

    @property
    def localization(self) -> Localization:
        """Where its poses go when the lab sends them."""
        return self.firmware.localization

    def _draw_pads(self) -> None:
        """How the pads of the next landing differ (their limits' spreads): one draw a placement."""
        self.state["pad_deviate"] = self._pads.standard_normal()

    def pose(self) -> tuple[str, Vector, Quaternion]:
        """Name, position (m) and quaternion (x, y, z, w) that the room sees, by the vehicle's effects."""
        position, quaternion = self._past[0] if self._past else self._tracked()
        return self.name, position, quaternion

    def _tracked(self) -> Pose:
        return tracked_pose(self._storage, self._stored_parameters)

    def check(self) -> None:
        """Raise WorldError when the state is not finite."""
        if not is_finite(self.state):
            raise WorldError(
                f"the physics of {self.name} diverged at {self.state['time']:.3f} s: {self.state!r}; this is "
                "a bug of the simulation, please keep this message and the seed"
            )


class World:
    """All drones in one room.

    Attributes:
        ticks: ms of simulated time so far.
        dropped: s of real time that were given up because the process fell behind.
        drones: the drones, ``cf1`` first.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        room: RoomGeometry | None = None,
        *,
        flashed: Vehicle | None = None,
        drones: int = 1,
        seed: int = 0,
        faults: DroneFaults | None = None,
        build: Build = OURS,
        truth: TruthRecorder | None = None,
        engine: EngineName = EngineName.REFERENCE,
        poses: PoseFeed | None = None,
    ) -> None:
        """Build the world.

        Args:
            vehicle: what the drones are.
            room: floor and ceiling.
            flashed: what their firmware was built to believe they are; None: the truth.
            drones, seed, faults: how many, their noise, and what goes wrong.
            build: how their firmware was built.
            truth: records the true states.
            engine: the code that their firmware runs.
            poses: sends the drones their poses; None: their clients do.
        """
        room = room or RoomGeometry()
        self.ticks = 0
        self.dropped = 0.0
        self._faults = faults or DroneFaults()
        self._truth = truth
        self._poses = poses
        parameters = physics_parameters(vehicle, room)
        used = _charge_used(vehicle.battery, self._faults.battery_voltage)
        bias = (np.array(self._faults.gyro_bias) + parameters["gyro_bias"]).tolist()
        gyro_bias = (bias[0], bias[1], bias[2])
        self._seed = seed
        self._handled = any(
            window is not NO_TIME
            for window in (self._faults.hung_at, self._faults.held_at, self._faults.survey_at)
        )
        self._survey = SimulatedSurvey(
            self._faults.survey_at, self._faults.survey_ceiling, self._faults.survey_missed, room, seed
        )
        self._generators = [np.random.default_rng((seed, i, 0)) for i in range(drones)]
        self.drones = [
            Drone(
                f"cf{i + 1}",
                Firmware(
                    flashed or vehicle,
                    self._generators[i],
                    engine=engine,
                    gyro_bias=gyro_bias,
                    build=build,
                    policy_weight=self._faults.policy_weight,
                ),
                parameters,
                mark,
                used,
                np.random.default_rng((seed, i, 0, PADS)),
                wiring_of(self._faults),
            )
            for i, mark in enumerate(start_marks(drones))
        ]

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.ticks * DT

    def run(self, seconds: float) -> None:
        """Simulate `seconds`, as fast as it goes."""
        for _ in range(round(seconds / DT)):
            self.step()

    def advance(self, to_time: float, at_most_s: float = LAG_LIMIT_S) -> bool:
        """Catch up with `to_time` (s since the start of the lab, real time), by no more than `at_most_s` in
        one go; False: there is more to do.

        Lateness beyond 0.05 s is given up and counted in `dropped`, so that a busy machine makes time
        run slower instead of making the lab spin.
        """
        lag = to_time - self.dropped - self.time
        if lag > LAG_LIMIT_S:
            self.dropped += lag - LAG_LIMIT_S
            lag = LAG_LIMIT_S
        behind = int(lag / DT + 1e-6)
        for _ in range(min(behind, round(at_most_s / DT))):
            self.step()
        return behind <= round(at_most_s / DT)

    def pass_time(self, to_time: float) -> None:
        """Let the time go on with nothing happening: the drones rest where they are."""
        self.ticks = max(self.ticks, int(to_time / DT))

    def step(self) -> None:
        """One ms."""
        self.ticks += 1
        if self.ticks % NOISE_PERIOD_TICKS == 0:
            for i, generator in enumerate(self._generators):
                anew = np.random.default_rng((self._seed, i, self.ticks))
                generator.bit_generator.state = anew.bit_generator.state
        self._strike()
        for drone in self.drones:
            drone.step()
        if self.ticks % CHECK_PERIOD_TICKS == 0:
            for drone in self.drones:
                drone.check()
        if self._poses is not None and self.ticks % PERIOD_TICKS == 0:
            self._poses.send(self.drones)
        if self._truth is not None and self.ticks % TRUTH_PERIOD_TICKS == 0:
            for drone in self.drones:
                self._truth.record(self.time, drone.name, drone.state, int(drone.firmware.ratios.max()))

    def _strike(self) -> None:
        """Faults that have a time."""
        if self._handled:
            self._hold()
        if self.time >= self._faults.freeze_drone_at:
            for drone in self.drones:
                drone.frozen = True
        if self.time >= self._faults.drone_dies_at:
            for drone in self.drones:
                if not drone.dead:
                    drone.dead = True
                    drone.firmware.power_off()

    def seen(self) -> list[tuple[str, Vector, Quaternion]]:
        """What the room's cameras look at: name, position (m) and quaternion of each body."""
        wand = self._survey.wand(self.time)
        return [drone.pose() for drone in self.drones] + ([] if wand is None else [wand])

    def _hold(self) -> None:
        """A person hangs, holds or turns the drones, and puts them back on their marks."""
        hung = self._faults.hung_at.covers(self.time)
        for drone in self.drones:
            if hung and drone.hung is None:
                drone.hang()
            elif drone.hung is not None and not hung:
                drone.place_on_start_mark()
        turned = self._survey.turns(self.time)
        for drone in self.drones:
            if turned and not drone.turned and drone.at_rest:  # nobody reaches for one that flies
                drone.stand_turned(self._survey)
            elif drone.turned and not turned:
                drone.place_on_start_mark()
        attitude = attitude_in_hand(self._faults.held_at, self.time)
        for drone in self.drones:
            if drone.held is not None and attitude is None:
                drone.place_on_start_mark()
            drone.held = attitude


def _charge_used(battery: Battery, open_circuit: float | None) -> float:
    """Charge (C) drawn from a pack with this open-circuit voltage (V); 0 for None."""
    if open_circuit is None:
        return 0.0
    slope = battery.open_circuit_slope.value
    if slope <= 0.0:
        raise WorldError("--fault battery_voltage: this vehicle's battery has no slope; give it one")
    return (battery.open_circuit_full.value - open_circuit) / slope * battery.capacity.value
