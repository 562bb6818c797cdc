"""The shell of our firmware app in the simulated drone: :mod:`onboard.app_interface` around an engine.

The parameter task posts what a client writes (a request with its plan, flags); the control loop, which is the
engine's, takes what is posted at its next step and answers through the parameters.
"""

from collections.abc import Callable, Iterator

from onboard import app_interface as interface
from onboard.app_interface import (
    MOTOR_TOKEN_MS,
    REQUEST_TIMEOUT_MS,
    LandingState,
    Log,
    Parameter,
    Rehearsal,
    TrajectoryStatus,
)
from onboard.firmware.constants import vehicle_crc32
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.engine import ApproachRequest, Engine, EngineEvent, SnapshotField
from sim_backend.crazyflie.policy_slot import PolicySlot
from sim_backend.crazyflie.tables import Number, ParameterTable
from sim_backend.engine_name import EngineName

_MEANS = (Log.MEAN_M1, Log.MEAN_M2, Log.MEAN_M3, Log.MEAN_M4)

_SNAPSHOT = {
    Log.SNAPSHOT_TAU: SnapshotField.TAU,
    Log.SNAPSHOT_THETA_X: SnapshotField.THETA_X,
    Log.SNAPSHOT_D_CEIL: SnapshotField.D_CEIL,
    Log.SNAPSHOT_TRIGGER_VALUE: SnapshotField.TRIGGER_VALUE,
    Log.SNAPSHOT_A_ROT: SnapshotField.A_ROT,
    Log.SNAPSHOT_VX: SnapshotField.VX,
    Log.SNAPSHOT_VY: SnapshotField.VY,
    Log.SNAPSHOT_VZ: SnapshotField.VZ,
    Log.SNAPSHOT_Z: SnapshotField.Z,
    Log.SNAPSHOT_PITCH: SnapshotField.PITCH,
}
_MODEL = (
    (Log.MODEL_X, Log.MODEL_Y, Log.MODEL_Z),
    (Log.MODEL_VX, Log.MODEL_VY, Log.MODEL_VZ),
)
"""Position and velocity."""

_SWITCHES = (
    Parameter.REHEARSE,
    Parameter.TRAJECTORY_ARM,
    Parameter.POLICY_ARM,
    Parameter.GO,
    Parameter.ABORT,
)
_ENGINES = {EngineName.REFERENCE: interface.EngineCode.REFERENCE, EngineName.C: interface.EngineCode.C}


class LandingApp:
    """The app of one drone.

    Args:
        vehicle: what its firmware was built for.
        engine: what computes; whoever boots the drone boots it.
        name: which one that is.
        params: the drone's parameters.
        is_flying: what the supervisor says.
        at_rest: whether it is configured, neither armed nor flying, and no motor has a thrust.
        tick: ms since boot.
        policy_weight: factor that a fault puts on a weight of the policy (:class:`PolicySlot`).

    Attributes:
        slot: staged and live policy.
        rehearses: whether a rehearsal is on: then nothing turns, and nothing is armed.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        engine: Engine,
        name: EngineName,
        params: ParameterTable,
        is_flying: Callable[[], bool],
        at_rest: Callable[[], bool],
        tick: Callable[[], int],
        policy_weight: float = 1.0,
    ) -> None:
        self._tick = tick
        self._at_rest = at_rest
        self._vehicle_crc = vehicle_crc32(vehicle)
        self._engine = engine
        self._engine_number = int(_ENGINES[name])
        self._params = params
        self.slot = PolicySlot(params, engine, is_flying, policy_weight)
        self.boot()

    def boot(self) -> None:
        """Start anew: no policy, nothing armed."""
        self.slot.boot()
        self._said: dict[Parameter, int] = {}
        self._request = 0
        self._params[Parameter.VEHICLE_CRC] = self._vehicle_crc
        self._params[Parameter.ENGINE] = self._engine_number
        self._params[Parameter.OWN_LAW] = 1
        self._vouched_until: int | None = None
        self.rehearses = False

    def connect(self) -> None:
        """Listen to the app's parameters; once, the callbacks outlive reboots."""
        write = self._params.on_write
        write(Parameter.POLICY_ARM, self._on_policy_arm)
        write(Parameter.TRAJECTORY_ARM, self._on_trajectory_arm)
        write(Parameter.GO, lambda value: self._engine.ask_go(bool(value)))
        write(Parameter.ABORT, lambda value: self._engine.ask_abort(bool(value)))
        write(Parameter.OWN_LAW, self._on_own_law)
        write(Parameter.MOTOR_TOKEN, self._on_motor_token)
        write(Parameter.REHEARSE, self._on_rehearse)
        self._params.mirror(Parameter.CEILING_Z, lambda value: self._engine.set_ceiling(float(value)))

    @property
    def state(self) -> LandingState:
        """State of the landing machine."""
        return self._engine.state

    def log_sources(self) -> dict[str, Callable[[], Number]]:
        """Where the app's log variables come from."""
        engine = self._engine

        def of_snapshot(field: SnapshotField) -> Callable[[], Number]:
            return lambda: engine.snapshot(field)

        def mean_ratio(motor: int) -> Callable[[], Number]:
            return lambda: engine.mean_ratios[motor]

        def of_model(part: int, axis: int) -> Callable[[], Number]:
            return lambda: engine.model[part][axis]

        return {
            Log.STATE: lambda: int(engine.state),
            Log.REASON: lambda: int(engine.reason),
            Log.TAU: lambda: engine.cues[0],
            Log.THETA_X: lambda: engine.cues[1],
            Log.D_CEIL: lambda: engine.cues[2],
            Log.TRIGGER_VALUE: lambda: engine.trigger_value,
            Log.A_ROT: lambda: engine.a_rot,
            Log.POLICY_CRC: lambda: self.slot.crc,
            Log.POLICY_STATUS: lambda: int(self.slot.status),
            Log.SNAPSHOT_TICK: lambda: engine.snapshot_tick,
            Log.SNAPSHOT_COUNT: lambda: engine.snapshot_count & 0xFF,
            **{log: of_snapshot(field) for log, field in _SNAPSHOT.items()},
            **{log: mean_ratio(motor) for motor, log in enumerate(_MEANS)},
            **{log: of_model(i, axis) for i, logs in enumerate(_MODEL) for axis, log in enumerate(logs)},
        }

    def answer(self, events: EngineEvent) -> None:
        """Say what a step of the engine made of what was posted."""
        if events:
            self._take_back(events)
        self._say(Parameter.STATE, int(self._engine.state))
        self._say(Parameter.TRAJECTORY_STATUS, int(self._engine.trajectory_status))

    def _take_back(self, events: EngineEvent) -> None:
        """Switches that a step of the engine turned off."""
        if EngineEvent.GO_TAKEN in events:
            self._params[Parameter.GO] = 0
        if EngineEvent.ABORT_TAKEN in events:
            self._params[Parameter.ABORT] = 0
        if EngineEvent.REFUSED in events:
            self._params[Parameter.TRAJECTORY_ARM] = 0
        if EngineEvent.REHEARSAL_ENDED in events:
            self.rehearses = False
            for name in _SWITCHES:
                self._params[name] = 0

    def _say(self, name: Parameter, value: int) -> None:
        if self._said.get(name) != value:
            self._said[name] = value
            self._params[name] = value

    def _on_policy_arm(self, value: Number) -> None:
        if not self._engine.arm_policy(bool(value)) and value:
            self._params[Parameter.POLICY_ARM] = 0

    def _on_own_law(self, value: Number) -> None:
        """There is no other law here."""
        self._params[Parameter.OWN_LAW] = 1

    def _on_motor_token(self, value: Number) -> None:
        self._vouched_until = self._tick() + MOTOR_TOKEN_MS

    def _on_rehearse(self, value: Number) -> None:
        taken = self._engine.rehearse(int(value), self._at_rest())
        self.rehearses = taken is not Rehearsal.OFF
        if not self.rehearses:
            self._params[Parameter.REHEARSE] = 0

    def motors_abandoned(self) -> bool:
        """Whether a host that vouched for the motors of its bench test has fallen silent; told once."""
        if self._vouched_until is None or self._tick() < self._vouched_until:
            return False
        self._vouched_until = None
        return True

    def _on_trajectory_arm(self, value: Number) -> Iterator[None]:
        """Post a request, and wait for the control loop."""
        self._say(Parameter.TRAJECTORY_STATUS, int(TrajectoryStatus.NONE))
        number = self._engine.post(bool(value), self._approach())
        for _ in range(REQUEST_TIMEOUT_MS):
            yield
            if self._engine.is_consumed(number):
                return

    def _approach(self) -> ApproachRequest:
        """The approach of the present parameters."""
        p = self._params
        return ApproachRequest(
            vx=float(p[Parameter.SPEED_X]),
            vz=float(p[Parameter.SPEED_Z]),
            impact_x=float(p[Parameter.IMPACT_X]),
            impact_y=float(p[Parameter.IMPACT_Y]),
            ceiling_z=float(p[Parameter.CEILING_Z]),
            ax=float(p[Parameter.ACCELERATION_X]),
            az=float(p[Parameter.ACCELERATION_Z]),
            tau0=float(p[Parameter.TAU_START]),
        )
