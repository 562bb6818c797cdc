"""What may happen to a drone: writes of its parameters, estimates and times, for two engines at once."""

import copy
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from onboard.app_interface import AVERAGED_MS, Rehearsal
from onboard.landing.model import OutputMode
from onboard.policy.bundle import bundle_crc32, encode_bundle
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.rotation import integrate
from onboard.trajectory import plan_from_velocity, sample_approach
from sim_backend.crazyflie.c_engine import CEngine
from sim_backend.crazyflie.engine import ApproachRequest, Engine, EngineEvent, Sample
from sim_backend.crazyflie.estimator import Estimator
from sim_backend.crazyflie.reference_engine import ReferenceEngine
from sim_backend.crazyflie.setpoint import Mode, Setpoint
from tests.firmware.float32 import VEHICLES

NAN = math.nan
VEHICLE = VEHICLES[0]
BUNDLE = encode_bundle(load_policy(shipped_policy_path("default")))
APPROACHES = (
    ApproachRequest(1.6070, 1.9151, 0.0, 0.0, 2.1, 2.0, 3.1, 0.4),
    ApproachRequest(0.0, 1.5, 0.0, 0.1, 2.1, 1.0, 3.5, 0.5),
    ApproachRequest(1.0, 3.0, 0.3, 0.0, 3.0, 3.0, 3.1, 0.3),
    ApproachRequest(1.0, 0.7, 0.0, 0.0, 2.1, 1.0, 3.1, 0.5),
    ApproachRequest(0.0, 0.0, 0.0, 0.0, 2.1, 1.0, 3.1, 0.5),
    ApproachRequest(NAN, 1.0, 0.0, 0.0, 2.1, 1.0, 3.1, 0.5),
    ApproachRequest(1.0, 1.0, 0.0, 0.0, 2.1, 0.0, -1.0, 0.5),
)
"""Sound ones first; the last three are none."""

WRITES = (
    "commit",
    "spoilt commit",
    "policy on",
    "policy off",
    "arm",
    "disarm",
    "go",
    "abort",
    "ceiling",
    "rehearse",
    "rehearse off",
)
MOTIONS = (
    "hover", "plan", "stay", "climb", "rise fast", "fall", "flip", "tilt", "beside", "impossible",
    "estimate lost", "gyro lost", "attitude lost", "reset", "at the ceiling",
)  # fmt: skip
POSE_AGES = (5, 150, 152, None)
SETPOINTS = ("hover", "null", "velocity", "attitude", "body velocity")


@dataclass(frozen=True)
class Stretch:
    """Some ms of a drone's life, begun by a write.

    Attributes:
        ms: how long.
        write: what the ground writes first, one of `WRITES`, or None.
        approach: index into `APPROACHES`, for arming.
        motion: how the estimate moves, one of `MOTIONS`.
        pose_age: ms, one of `POSE_AGES`.
        setpoint: the commander's, one of `SETPOINTS`.
        flying, levelling: what the supervisor says.
    """

    ms: int
    write: str | None = None
    approach: int = 0
    motion: str = "hover"
    pose_age: int | None = 5
    setpoint: str = "hover"
    flying: bool = True
    levelling: bool = False


LANDING = (
    Stretch(20, "commit", flying=False),
    Stretch(30, "policy on"),
    Stretch(30, "arm"),
    Stretch(1600, "go", motion="plan"),
)
"""An approach whose policy fires on the way."""


@dataclass
class Motion:
    """The estimate, which goes on from where it is, whoever flies.

    Attributes:
        state: position, velocity, attitude: the first ten numbers of the filter's state.
        gyro: rad/s.
    """

    rng: np.random.Generator
    state: np.ndarray = field(default_factory=lambda: np.array([0.0] * 9 + [1.0]))
    gyro: np.ndarray = field(default_factory=lambda: np.zeros(3))
    approach: int = 0
    elapsed: float = 0.0

    def step(self, kind: str) -> None:
        """One ms."""
        a = APPROACHES[self.approach]
        plan = plan_from_velocity(a.vx, a.vz, a.impact_x, a.impact_y, a.ceiling_z, a.ax or 1.0, a.az, a.tau0)
        self.elapsed = self.elapsed + 1e-3 if kind == "plan" else 0.0
        still = np.zeros(3)
        noise = self.rng.normal(0.0, 1e-4, 6)
        position, velocity = self.state[:3].copy(), self.state[3:6].copy()
        self.gyro = self.rng.normal(0.0, 0.02, 3)
        if kind in ("hover", "plan", "beside") and math.isfinite(plan.x0):
            p, v, _ = sample_approach(plan, self.elapsed)
            position, velocity = np.array(p), np.array(v)
            position[1] += 0.6 if kind == "beside" else 0.0
        elif kind == "flip":
            self.gyro[1] -= 14.0
        elif kind == "tilt":
            self.gyro[0] += 9.0
        velocity = {
            "climb": np.array([0.3, 0.0, 1.2]), "rise fast": np.array([0.2, 0.1, 3.0]),
            "fall": np.array([0.1, 0.0, -0.8]), "stay": still, "impossible": np.array([0.0, 6.0, 0.0]),
        }.get(kind, velocity)  # fmt: skip
        if kind in ("climb", "rise fast", "fall", "impossible"):
            position = position + 1e-3 * velocity
        if kind == "reset":
            position = np.array([4.0, 0.0, 0.0])
        if kind == "at the ceiling":
            position, velocity = np.array([0.0, plan.y0, plan.ceiling_z - 0.01]), still
        attitude = np.array(integrate(tuple(self.state[6:10]), tuple(self.gyro), 1e-3))
        self.state = np.concatenate([position, velocity, attitude])
        self.state[:6] += noise
        if not np.isfinite(self.state).all():
            self.state = np.array([0.0] * 9 + [1.0])

    def seen(self, kind: str) -> tuple[np.ndarray, np.ndarray]:
        """Estimate and gyro in float32, with what is lost."""
        state, gyro = self.state.astype(np.float32).astype(float), self.gyro.astype(np.float32).astype(float)
        if kind == "estimate lost":
            state[2] = NAN
        elif kind == "attitude lost":
            state[6:10] = 0.0
        elif kind == "gyro lost":
            gyro[1] = NAN
        return state, gyro


def write(engine: Engine, stretch: Stretch) -> Any:
    """What the ground asks; the answer."""
    answers: dict[str, Callable[[], Any]] = {
        "commit": lambda: engine.commit(BUNDLE, bundle_crc32(BUNDLE), stretch.flying),
        "spoilt commit": lambda: engine.commit(BUNDLE[:-1] + b"\xff", bundle_crc32(BUNDLE), stretch.flying),
        "policy on": lambda: engine.arm_policy(True),
        "policy off": lambda: engine.arm_policy(False),
        "arm": lambda: engine.post(True, APPROACHES[stretch.approach]),
        "disarm": lambda: engine.post(False, APPROACHES[stretch.approach]),
        "go": lambda: engine.ask_go(True),
        "abort": lambda: engine.ask_abort(True),
        "ceiling": lambda: engine.set_ceiling(2.5),
        "rehearse": lambda: engine.rehearse(Rehearsal.POSES, not stretch.flying),
        "rehearse off": lambda: engine.rehearse(Rehearsal.OFF, not stretch.flying),
    }
    return answers[stretch.write]() if stretch.write is not None else None


def setpoint(kind: str) -> Setpoint:
    """A commander's wish."""
    absolute, velocity = Mode.ABSOLUTE, Mode.VELOCITY
    return {
        "null": Setpoint(),
        "hover": Setpoint(
            mode_x=absolute, mode_y=absolute, mode_z=absolute, mode_yaw=absolute, position=(0.1, 0.0, 1.0),
            velocity=(0.1, 0.0, -0.2), acceleration=(0.0, 0.3, 0.1), rates=(0.0, 0.0, 0.2),
        ),
        "velocity": Setpoint(
            mode_x=velocity, mode_y=velocity, mode_z=velocity, mode_yaw=velocity,
            velocity=(0.3, -0.2, 0.1), rates=(0.0, 0.0, 0.5),
        ),
        "body velocity": Setpoint(
            mode_x=velocity, mode_y=velocity, mode_z=absolute, mode_yaw=velocity, velocity_body=True,
            velocity=(0.3, -0.2, 0.0), position=(0.0, 0.0, 0.7),
        ),
        "attitude": Setpoint(
            mode_roll=absolute, mode_pitch=absolute, mode_yaw=velocity, roll=0.1, pitch=-0.2, thrust=36000.0
        ),
    }[kind]  # fmt: skip


def samples(history: list[Stretch], seed: int) -> Iterator[tuple[Stretch | None, Sample]]:
    """Each ms of a history; a stretch with its first."""
    motion, tick, estimator = Motion(np.random.default_rng(seed)), 0, Estimator()
    for stretch in history:
        if stretch.write == "arm":
            motion.approach = stretch.approach
        wish = setpoint(stretch.setpoint)
        for ms in range(stretch.ms):
            tick += 1
            motion.step(stretch.motion)
            state, gyro = motion.seen(stretch.motion)
            estimator = Estimator()
            estimator.state[:10] = state
            sample = Sample(
                tick,
                estimator,
                gyro,
                wish,
                tick - tick % 20,
                stretch.pose_age,
                4.0,
                stretch.flying,
                stretch.levelling,
            )
            yield (stretch if ms == 0 else None), sample


STEP_MS = 2
"""Period of landing machine and law."""

FORCE = 1e-5
"""N: largest difference of a motor's thrust. The law's is 1e-6, its lead multiplies a moment's by up to 7."""

MEAN = 12
"""Of 65535: largest difference of a mean motor ratio; the thrusts' 1e-5 N are 5 of them."""

EDGES = (VEHICLE.motors.thrust_min.value, VEHICLE.motors.thrust_map_compiled().coefficients[6])
"""N: the least thrust, and the one between the map's rows: there the ratio that a thrust needs jumps."""

JUMP = 0.01
"""m/s2: where a planned acceleration jumps, the rounding of the time may cost one engine a step."""

FORGOTTEN_MS = 200
"""After which the lead of the moments has forgotten that (16 of its time constants)."""

Told = tuple[Any, ...]


def told(engine: Engine, events: EngineEvent) -> Told:
    """What must be the same: the decisions of a step."""
    return (
        engine.state, engine.reason, engine.trajectory_status, engine.mode, events, engine.snapshot_count,
        engine.has_policy, engine.rehearses,
    )  # fmt: skip


@dataclass(frozen=True)
class Compared:
    """How far two engines went together.

    Attributes:
        visited: states of the landing machine, in their order, with the reasons.
        difference: where the decisions first differed, or None.
        explained: whether that was a threshold which the reference crosses itself when its numbers move by
            the rounding of float32, or the clock by a millionth of a second. Engines of which one crosses it
            a step later go on together; others part there.
        force: largest difference of a motor's thrust, N, in each mode, until one of them crossed a
            threshold a step later: from then on they hold a place of different instants. Likewise for a while
            after the planned acceleration jumped a step later.
    """

    visited: tuple[tuple[Any, Any], ...]
    difference: str | None
    explained: bool
    force: dict[OutputMode, float]


@dataclass
class Motors:
    """The motors of two engines, step by step.

    Attributes:
        force: as in `Compared`.
        edge: ms, int64[4]: when each thrust was last so near to one of `EDGES` that the engines may take
            different sides of it.
    """

    force: dict[OutputMode, float] = field(default_factory=dict)
    edge: np.ndarray = field(default_factory=lambda: np.full(4, -AVERAGED_MS))

    def watch(self, reference: Engine, tick: int) -> None:
        """Each ms: how near to an edge."""
        near = np.abs(np.subtract.outer(reference.thrusts, EDGES)) <= FORCE
        self.edge[near.any(axis=1)] = tick

    def compare(self, reference: Engine, c: Engine, tick: int, uncertain: Callable[[], float]) -> None:
        """The thrusts of this step and the mean ratios, which remember an edge.

        In a manoeuvre at its limits (tens of m/s2 asked for, motors clipped) more than `FORCE` is right as
        long as the reference's own thrusts are so `uncertain`, N, in this step and in what the lead of the
        moments remembers of the last ones.
        """
        mean = np.abs(np.subtract(c.mean_ratios, reference.mean_ratios))
        assert mean[tick - self.edge >= AVERAGED_MS].max(initial=0) <= MEAN
        if np.isfinite(reference.thrusts).all():
            most = float(np.abs(np.subtract(c.thrusts, reference.thrusts)).max())
            if most <= FORCE or most > 2.0 * uncertain():
                self.force[reference.mode] = max(self.force.get(reference.mode, 0.0), most)
        else:
            assert np.array_equal(np.isfinite(c.thrusts), np.isfinite(reference.thrusts))


def compare(history: list[Stretch], seed: int) -> Compared:
    """Both engines through one history."""
    reference, c, motors = ReferenceEngine(VEHICLE), CEngine(VEHICLE), Motors()
    difference, parted, jumped = None, -STEP_MS, -FORGOTTEN_MS
    visited: list[tuple[Any, Any]] = []
    for stretch, sample in samples(history, seed):
        if stretch is not None:
            wanted_answer, answer = write(reference, stretch), write(c, stretch)
            assert answer == wanted_answer, f"{stretch}: {answer}, not {wanted_answer}"
        wanted, found = told(reference, reference.step(sample)), told(c, c.step(sample))
        motors.watch(reference, sample.tick)
        if wanted != found and sample.tick > parted + STEP_MS:
            difference = f"{sample.tick} ms: {found}, not {wanted}"
            if found not in nearly(reference_before(history, seed, sample.tick), sample):
                return Compared(tuple(visited), difference, False, motors.force)
            parted = sample.tick
        if sample.tick == parted + STEP_MS and wanted[:4] != found[:4]:
            return Compared(tuple(visited), difference, True, motors.force)
        if sample.tick - parted < STEP_MS:
            continue
        if not visited or visited[-1] != (reference.state, reference.reason):
            visited.append((reference.state, reference.reason))
        if difference is not None or reference.mode is not c.mode:
            continue
        gap = np.subtract(c.target.acceleration, reference.target.acceleration)
        if reference.mode is OutputMode.SETPOINT and np.abs(gap).max() > JUMP:
            jumped = sample.tick
        if sample.tick - jumped < FORGOTTEN_MS or sample.tick % STEP_MS != 0:
            continue
        motors.compare(reference, c, sample.tick, partial(uncertainty, history, seed, sample))
    return Compared(tuple(visited), difference, True, motors.force)


def reference_before(history: list[Stretch], seed: int, tick: int) -> ReferenceEngine:
    """The reference as it was before the step at `tick`, with what is written then."""
    reference = ReferenceEngine(VEHICLE)
    for stretch, sample in samples(history, seed):
        if stretch is not None:
            write(reference, stretch)
        if sample.tick == tick:
            break
        reference.step(sample)
    return reference


ROUNDING = 5e-6
"""m, m/s, 1: what float32 loses of a position in a room, and of an attitude in a flight."""


def moved(sample: Sample) -> Iterator[Sample]:
    """The sample with one number of its estimate a little different."""
    for place in range(10):
        for by in (-ROUNDING, ROUNDING):
            estimator = copy.deepcopy(sample.estimator)
            estimator.state[place] += by
            yield sample._replace(estimator=estimator)


def uncertainty(history: list[Stretch], seed: int, sample: Sample) -> float:
    """How far the reference's thrusts move at `sample`, N, when all its numbers are a little different."""
    before, thrusts = reference_before(history, seed, sample.tick), []
    for each in (sample, *moved(sample)):
        engine = copy.deepcopy(before)
        engine.step(each)
        thrusts.append(engine.thrusts)
    by_number = np.abs(np.subtract(thrusts[1:], thrusts[0])).reshape(-1, 2, 4).max(axis=1)
    return float(by_number.sum(axis=0).max())


def nearly(before: ReferenceEngine, sample: Sample) -> list[Told]:
    """The decisions of the reference when one of its numbers is a little different."""
    found = []
    for each in moved(sample):
        engine = copy.deepcopy(before)
        found.append(told(engine, engine.step(each)))
    memory = before._memory
    for name in ("start_time", "flip_time", "usable_time", "hold_time"):
        for by in (-1e-6, 1e-6):
            engine = copy.deepcopy(before)
            engine._memory[name] = memory[name] + by
            found.append(told(engine, engine.step(sample)))
    for place in range(4):
        for by in (-ROUNDING, ROUNDING):
            engine = copy.deepcopy(before)
            engine._memory["attitude"][place] = memory["attitude"][place] + by
            found.append(told(engine, engine.step(sample)))
    return found
