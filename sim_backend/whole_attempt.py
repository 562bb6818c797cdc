"""One landing attempt with all that is on board, from the hover where its approach starts to rest.

A rollout (:mod:`sim_backend.physics.rollout`) begins half a second below the ceiling at exactly the velocity
that it was told, knows its state, and gets the thrusts that it asks for. Here everything takes part that
decides how an attempt ends in the simulated lab: inertial sensors with their filters, the Crazyflie's
estimator on the poses of the simulated room (rate, noise, latency), the landing app, its battery
compensation, and a pack that sags. Motors and estimator are still settling from the acceleration when the
policy looks at the cues. Left out: radio, supervisor, take-off and the way to the start.
"""

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.app_interface import LandingState, TrajectoryStatus
from onboard.arrays import FloatArray
from onboard.policy.bundle import bundle_crc32
from onboard.trajectory import ApproachPlan
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.engine import ApproachRequest, Engine, Sample, SnapshotField
from sim_backend.crazyflie.engines import make_engine
from sim_backend.crazyflie.estimator import Estimator
from sim_backend.crazyflie.power import PowerManager
from sim_backend.crazyflie.sensors import InertialSensors
from sim_backend.crazyflie.setpoint import complete_setpoint
from sim_backend.crazyflie.stabilizer import applied_duties
from sim_backend.engine_name import EngineName
from sim_backend.errors import SimulationError
from sim_backend.physics.reset import approaching, charged
from sim_backend.physics.rollout import End, RolloutSettings, record_end
from sim_backend.physics.state import STATE
from sim_backend.physics.step import is_finite, step_first
from sim_backend.room.cameras import Cameras
from sim_backend.room.feed import TruePose
from sim_backend.room.settings import RoomSettings
from sim_backend.tracked import tracked_pose

DT = 1e-3
ARM_MS, ARMED_MS = 680, 20
"""ms of hover before the approach is armed, in which estimator and battery compensation settle, and after."""

PAUSE_MS = 100
"""ms by which the approach begins later in one attempt than in another."""

ON_THE_WAY_S = 8.0
"""s of hover that take-off and the way to the start take out of a full pack."""

RULES = RolloutSettings()
"""When an attempt is over, as a rollout."""

PATIENCE_S = 1.0
"""s after which an approach that should have met the ceiling is over."""

_SEEN = {
    "tau": SnapshotField.TAU,
    "theta_x": SnapshotField.THETA_X,
    "d_ceil": SnapshotField.D_CEIL,
    "a_rot": SnapshotField.A_ROT,
}


class WholeAttempts:
    """Flies attempts of one vehicle with one policy.

    Args:
        vehicle: what the drone was built for.
        bundle: the policy, as it is uploaded.
        engine: which code computes on board.

    Raises:
        NoCompiler, CompilationFailed: of the engine in C.
    """

    def __init__(self, vehicle: Vehicle, bundle: bytes, engine: EngineName) -> None:
        self._vehicle, self._bundle = vehicle, bundle
        self._engine = make_engine(engine, vehicle)

    def fly(
        self, parameters: NDArray[np.void], plan: ApproachPlan, rng: np.random.Generator, out: Any
    ) -> None:
        """One attempt.

        Args:
            parameters: (1,) physics of the vehicle that flies.
            plan: its approach.
            rng: noise, pads, and how the clocks of drone and cameras meet.
            out: zeroed record of :data:`sim_backend.physics.rollout.ROLLOUT` for the result, without the
                commanded speed and angle. Its times count from the start of the approach.

        Raises:
            SimulationError: the drone refuses policy or approach.
        """
        engine = self._engine
        engine.boot()
        status = engine.commit(self._bundle, bundle_crc32(self._bundle), False)
        if not engine.has_policy:
            raise SimulationError(f"the drone refuses the policy: {status.name}")
        engine.set_ceiling(plan.ceiling_z)
        body = _Body(parameters, plan, rng)
        drone = _Drone(self._vehicle, engine, body, rng)
        drone.fly(ARM_MS)
        body.discharge(ON_THE_WAY_S)
        engine.arm_policy(True)
        engine.post(
            True,
            ApproachRequest(
                plan.vx, plan.vz, plan.impact_x, plan.y0, plan.ceiling_z, plan.ax, plan.az, plan.tau0
            ),
        )
        drone.fly(ARMED_MS + int(rng.integers(PAUSE_MS)))
        if engine.trajectory_status is not TrajectoryStatus.ARMED:
            raise SimulationError(f"the drone refuses the approach: {engine.trajectory_status.name}")
        engine.ask_go(True)
        body.state["time"] = 0.0
        triggered, highest, end = None, -np.inf, None
        while end is None:
            drone.fly(1)
            if triggered is None and engine.snapshot_count:
                _record_trigger(out, engine, body.state)
                triggered = body.now
            highest = max(highest, body.height)
            end = body.end(triggered, engine)
        out["d_min"] = plan.ceiling_z - highest
        record_end(out, body.state, int(end))


class _Body:
    """The vehicle in the air: its physics, from a hover at the start of an approach."""

    def __init__(self, parameters: NDArray[np.void], plan: ApproachPlan, rng: np.random.Generator) -> None:
        start = approaching(parameters[0], np.array([plan.x0, plan.y0, plan.z0]), np.zeros(3))
        self.parameters = parameters
        self._latest = plan.impact_time + PATIENCE_S
        self._states = np.array([charged(start, parameters[0])], dtype=STATE)
        self.state: Any = self._states[0]
        self.state["specific_force"] = (0.0, 0.0, parameters[0]["gravity"])
        self.state["pad_deviate"] = rng.standard_normal()
        # Views into the record: its fields are slow to look up a thousand times a second.
        self.specific_force, self.rates = self.state["specific_force"], self.state["omega"]
        self._position, self._velocity = self.state["position"], self.state["velocity"]
        self._time, self._contact = self._states["time"], self._states["ceiling_contact"]
        self._voltage = self._states["battery_voltage"]

    @property
    def now(self) -> float:
        """s since the approach began."""
        return self._time.item()

    @property
    def height(self) -> float:
        """m, of the centre of mass."""
        return self._position.item(2)

    @property
    def voltage(self) -> float:
        """V, of the battery."""
        return self._voltage.item()

    def step(self, duties: FloatArray) -> None:
        """One ms."""
        step_first(self._states, self.parameters, duties, DT)

    def pose(self) -> TruePose:
        """What the cameras look at, by the vehicle's effects."""
        return TruePose(*tracked_pose(self._states, self.parameters))

    def discharge(self, seconds: float) -> None:
        """Take so much of the present current out of the pack."""
        self.state["charge_used"] += seconds * self.state["battery_current"]

    def end(self, triggered: float | None, engine: Engine) -> End | None:
        """Why the attempt is over (a policy that did not fire: TIMEOUT); None while it goes on.

        Args:
            triggered: s since the approach began; None: not yet.
            engine: what is on board.
        """
        now = self.now
        if self._contact.item() and now - self.state["impact_time"] > RULES.after_contact:
            return End.SETTLED if is_finite(self.state) else End.NOT_FINITE
        if triggered is None:
            ended = engine.state not in (LandingState.TRAJECTORY_ARMED, LandingState.APPROACH)
            return End.TIMEOUT if ended or now > self._latest else None
        if now - triggered > RULES.after_trigger:
            return End.FLIP_TIMEOUT if is_finite(self.state) else End.NOT_FINITE
        falls = self._velocity.item(2) <= -RULES.fall_speed and self.height <= RULES.fall_height
        return End.FALLING if falls else None


class _Drone:
    """What is on board, and the cameras that tell it where it is; a ms at a time."""

    def __init__(self, vehicle: Vehicle, engine: Engine, body: _Body, rng: np.random.Generator) -> None:
        self._engine, self._body = engine, body
        x, y, z = body.state["position"].tolist()
        self._estimator = Estimator()
        self._estimator.settings.initial = (x, y, z, 0.0)
        self._estimator.reset()
        self._sensors = InertialSensors(vehicle.sensing, rng)
        self._sensors.gyro_bias[:] = body.parameters[0]["gyro_bias"]
        self._sensors.settle(body.specific_force)
        self._power = PowerManager(vehicle.sensing.battery_voltage_noise.value, rng)
        room = RoomSettings()
        self._cameras = Cameras(room, rng)
        self._name = room.subjects[0]
        self._period = round(room.period / DT)
        self._exposure = int(rng.integers(self._period))
        age = room.latency + float(body.parameters[0]["pose_delay"])
        self._latency = round(age / DT)
        self._frames: deque[tuple[int, TruePose]] = deque()
        self._hover = complete_setpoint((x, y, z))
        self._duties = np.zeros(4)
        self._tick = 0
        self._last_pose: int | None = None

    def fly(self, milliseconds: int) -> None:
        """Let so much time pass."""
        for _ in range(milliseconds):
            self._tick += 1
            self._step(self._tick)

    def _step(self, tick: int) -> None:
        body, sensors, estimator = self._body, self._sensors, self._estimator
        sensors.sample(body.specific_force, body.rates)
        self._power.step(tick, body.voltage)
        self._look(tick)
        estimator.step(sensors.acc, sensors.gyro, True)
        self._engine.step(
            Sample(
                tick=tick,
                estimator=estimator,
                gyro=sensors.gyro,
                setpoint=self._hover,
                set_at=tick,
                pose_age=None if self._last_pose is None else tick - self._last_pose,
                voltage=self._power.voltage,
                flying=True,
                levelling=False,
                thrust_seen=True,
            )
        )
        applied_duties(self._engine.ratios, self._duties)
        body.step(self._duties)

    def _look(self, tick: int) -> None:
        """The pose that a camera frame showed a latency ago reaches the drone."""
        if (tick + self._exposure) % self._period == 0:
            self._frames.append((tick + self._latency, self._body.pose()))
        while self._frames and self._frames[0][0] <= tick:
            due, true = self._frames.popleft()
            seen = self._cameras.expose(due, DT * due, {self._name: true}, None).bodies[0].pose
            if seen is not None:
                self._estimator.external_pose(*seen.position, *seen.quaternion)
                self._last_pose = tick


def _record_trigger(out: Any, engine: Engine, state: Any) -> None:
    out["triggered"], out["trigger_time"] = 1, state["time"]
    out["velocity_x"], out["velocity_z"] = state["velocity"][0], state["velocity"][2]
    for name, field in _SEEN.items():
        out[name] = engine.snapshot(field)
