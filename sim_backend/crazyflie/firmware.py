"""The simulated Crazyflie's firmware: the 1 kHz loop behind the ports, with everything it keeps in RAM.

Order and rates of one step as in bitcraze/crazyflie-firmware 2026.08 (``stabilizer.c``): sensors, estimator,
high-level commander (100 Hz), commander, supervisor (25 Hz), the supervisor's override, the landing app or
the controller (500 Hz), battery compensation, 8-bit PWM. It needs no sockets and no clock: one call of
:meth:`Firmware.step` is one ms of the drone's life.
"""

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import FloatArray
from onboard.battery import FULL_RATIO
from onboard.gravity import GRAVITY
from onboard.landing.model import OutputMode
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.bindings import log_sources, parameter_setters
from sim_backend.crazyflie.build import OURS, Build
from sim_backend.crazyflie.commander import Commander, Priority
from sim_backend.crazyflie.engine import EngineEvent, Sample
from sim_backend.crazyflie.engines import make_engine
from sim_backend.crazyflie.estimator import Estimator
from sim_backend.crazyflie.high_level import FlatState, HighLevelCommander
from sim_backend.crazyflie.interfaces import FirmwareAssertion, Memory
from sim_backend.crazyflie.landing_app import LandingApp
from sim_backend.crazyflie.memory import (
    EEPROM_SIZE,
    TRAJECTORY_SIZE,
    DeckMemory,
    MemoryTester,
    MemoryType,
    RamMemory,
)
from sim_backend.crazyflie.power import PowerManager
from sim_backend.crazyflie.sensors import InertialSensors
from sim_backend.crazyflie.services import CommanderService, LocalizationService
from sim_backend.crazyflie.setpoint import Setpoint
from sim_backend.crazyflie.stabilizer import applied_duties, level_out, motor_ratios
from sim_backend.crazyflie.supervisor import RATE_HZ, Supervisor, SupervisorState
from sim_backend.crazyflie.tables import LogTable, Number, ParameterTable
from sim_backend.engine_name import EngineName

DT = 0.001
HIGH_LEVEL_PERIOD_MS = 10
SUPERVISOR_PERIOD_MS = 1000 // RATE_HZ
_KALMAN = 2
_NULL = (Setpoint(), 0)  # in force, from the boot on, while flying is not allowed
APP_PERIOD_MS = 20
"""Between two looks of the app's slow task (`LOOK_PERIOD_MS` of its C code)."""


class Firmware:
    """One drone's firmware; the ``FirmwarePort`` of the CRTP server.

    Attributes:
        params, logs: the tables of the real firmware, with our app's groups unless `with_app` is False.
        app: the landing app, or None.
        engine: all that is computed between the estimate and the motors.
        thrust_max: of a motor, N.
        supervisor, estimator, high_level, sensors, power: the parts; new ones after each boot.
        setpoint: what the controller follows, after the supervisor's override.
        setpoints: what clients ask for, and who may overwrite whom.
        idle_thrust: least ratio of a motor that may turn.
        ratios: int64[4], motor ratios 0..65535 as given to the motor drivers.
        running: False while the microcontroller has no power.
        boot_count: boots so far.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        rng: np.random.Generator,
        *,
        engine: EngineName = EngineName.REFERENCE,
        with_app: bool = True,
        gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
        build: Build = OURS,
        policy_weight: float = 1.0,
    ) -> None:
        self._build = build
        self.idle_thrust = build.idle_thrust
        self._vehicle = vehicle
        self._rng = rng
        self._gyro_bias = gyro_bias
        self.params = ParameterTable.firmware(with_app)
        self._estimator_parameter = self.params.entry("stabilizer.estimator").ident
        self.logs = LogTable.firmware(with_app)
        self.engine = make_engine(engine, vehicle)
        self.app: LandingApp | None = None
        if with_app:
            self.app = LandingApp(
                vehicle,
                self.engine,
                engine,
                self.params,
                self._is_flying,
                self._at_rest,
                self.tick_ms,
                policy_weight,
            )
        self._trajectories = RamMemory(MemoryType.TRAJECTORY, TRAJECTORY_SIZE)
        self._tester = MemoryTester()
        app_memory: tuple[Memory, ...] = (self.app.slot.memory,) if self.app else ()
        self.memories: tuple[Memory, ...] = (
            RamMemory(MemoryType.EEPROM, EEPROM_SIZE),
            *app_memory,
            self._trajectories,
            self._tester,
            DeckMemory(),
        )
        self.localization = LocalizationService(self)
        self.commander = CommanderService(self)
        self.ratios: NDArray[np.int64] = np.zeros(4, dtype=np.int64)
        self.motor_override = [0, 0, 0, 0, 0]
        self._duties: FloatArray = np.zeros(4)
        self.thrust_max = vehicle.motors.thrust_max.value
        self._thrust_map = vehicle.motors.thrust_map_compiled()
        self._console: list[str] = []
        self.boot_count = 0
        self.poses_received = self._rejected = 0
        self._boot()
        self._setters = parameter_setters(self)
        for name, setter in self._setters.items():
            self.params.mirror(name, setter)
        self.params.on_write("system.doAssert", _fail_assert)
        self.logs.bind("sys.testLogParam", lambda: self.params["system.testLogParam"])
        self.params.mirror("memTst.resetW", lambda _: self._tester.reset_write_errors())
        self.logs.bind("memTst.errCntW", lambda: self._tester.write_errors)
        self.logs.bind_all(log_sources(self))
        build.bind(self.logs)
        if self.app:
            self.logs.bind_all(self.app.log_sources())
            self.app.connect()
        self._apply_parameters()

    # FirmwarePort

    def tick_ms(self) -> int:
        """Milliseconds since boot."""
        return self._tick

    def on_packet(self) -> None:
        """A packet arrived; the firmware only counts the time since the last one."""
        self._packet_tick = self._tick

    def battery_voltage(self) -> float:
        """V, as the radio chip measures it."""
        return self._terminal_voltage

    def power_off(self) -> None:
        """The radio chip cut the power: motors stop, nothing runs until :meth:`reboot`."""
        self.running = False
        self.ratios[:] = 0
        self._duties[:] = 0.0

    def reboot(self) -> None:
        """Start anew; RAM is lost."""
        self._boot()
        self._apply_parameters()

    def assert_failed(self, reason: str) -> None:
        """Motors off and restart, as after a failed ``ASSERT``."""
        self.power_off()
        self.reboot()
        self._console.append(f"SYS: The system resumed after a failed assert [{reason}]\n")

    def take_console(self) -> list[str]:
        """Console lines since the last call."""
        lines, self._console = self._console, []
        return lines

    def supervisor_info(self) -> int:
        """Log ``supervisor.info``."""
        return self.supervisor.info_bits()

    # The loop

    def step(self, specific_force: FloatArray, rates: FloatArray, terminal_voltage: float) -> FloatArray:
        """One ms of the drone.

        Args:
            specific_force: what an ideal accelerometer shows (3,), m/s2, body.
            rates: true body rates (3,), rad/s.
            terminal_voltage: true battery voltage, V.

        Returns:
            Duties of the four motors (0..1 of the battery voltage); overwritten by the next call.
        """
        self._terminal_voltage = terminal_voltage
        if not self.running:
            return self._duties
        if self._tick == 0:
            self.sensors.settle(specific_force)
        self._tick += 1
        tick = self._tick
        self.sensors.sample(specific_force, rates)
        self.power.step(tick, terminal_voltage)
        self.supervisor.watch(tick)
        if self.estimator.step(self.sensors.acc, self.sensors.gyro, self.supervisor.is_flying):
            self._console.append("ESTKALMAN: State out of bounds, resetting\n")
        setpoint, set_at = self._commanded(tick)
        self._supervise(tick, set_at)
        self._hold_to_configuration(tick)
        self._control(tick, *self._overridden(setpoint, set_at))
        self._idle_motors()
        self.run_parameter_task()
        return self._duties

    def idle(self, terminal_voltage: float) -> None:
        """One ms of a drone that stands: nothing is sensed, estimated or driven, all else lives."""
        self._terminal_voltage = terminal_voltage
        if not self.running:
            return
        self._tick += 1
        self.power.step(self._tick, terminal_voltage)
        self.supervisor.watch(self._tick)
        if self._tick % SUPERVISOR_PERIOD_MS == 0:
            info = self.high_level.info_bits(self._tick * DT)
            self.supervisor.update(self._tick, (0.0, 0.0, 1.0), False, 0, info)
            self._console += self.supervisor.take_console()
        self._hold_to_configuration(self._tick)
        self.run_parameter_task()

    def run_parameter_task(self) -> None:
        """The parameter task runs when the loop above, of higher priority, sleeps."""
        try:
            self.params.run_callback()
        except FirmwareAssertion as assertion:
            self.assert_failed(str(assertion))

    def _commanded(self, tick: int) -> tuple[Setpoint, int]:
        """The setpoint in force, null while flying is not allowed, and the ms since boot of its setting."""
        can_fly = self.supervisor.can_fly
        self.high_level.block(not can_fly)
        if can_fly and tick % HIGH_LEVEL_PERIOD_MS == 0:
            # As in the firmware, the planner knows where the drone is only from here on: a take-off in the
            # first 10 ms starts from where it was last told.
            planned = self.high_level.setpoint(self.flat_state(), tick * DT)
            if planned is not None:
                self.setpoints.set(planned, Priority.HIGH_LEVEL, tick)
        return (self.setpoints.setpoint, self.setpoints.set_at) if can_fly else _NULL

    def _supervise(self, tick: int, set_at: int) -> None:
        if tick % SUPERVISOR_PERIOD_MS:
            return
        acc = self.sensors.acc / GRAVITY
        self.supervisor.update(
            tick,
            (float(acc[0]), float(acc[1]), float(acc[2])),
            bool((self.ratios > self.idle_thrust).any()),
            set_at,
            self.high_level.info_bits(tick * DT),
        )
        # A radio needs longer than this step to tell that flying is allowed and to bring a command. Here both
        # can happen between two steps, and the planner would still refuse it.
        self.high_level.block(not self.supervisor.can_fly)
        self._console += self.supervisor.take_console()
        if tick % 1000 == 0:
            self.pose_rate, self.poses_received = self.poses_received, 0
            self.rejected_rate = self.estimator.rejected - self._rejected
            self._rejected = self.estimator.rejected

    def _hold_to_configuration(self, tick: int) -> None:
        """Without the app's configuration nothing stays armed on the ground; in the air an approach ends."""
        if self.app is None or not self.supervisor.is_armed or self._is_configured():
            return
        if self.supervisor.is_flying:
            self.engine.ask_abort(True)
        elif tick % APP_PERIOD_MS == 0:
            self.supervisor.arm(False)

    def _overridden(self, setpoint: Setpoint, set_at: int) -> tuple[Setpoint, int]:
        """The supervisor's say on the setpoint, and when that was set."""
        if self.supervisor.state is SupervisorState.WARNING_LEVEL_OUT:
            return level_out(setpoint), set_at
        return (setpoint, set_at) if self.supervisor.motors_allowed else _NULL

    def _control(self, tick: int, setpoint: Setpoint, set_at: int) -> None:
        engine = self.engine
        sample = Sample(
            tick=tick,
            estimator=self.estimator,
            gyro=self.sensors.gyro,
            setpoint=setpoint,
            set_at=set_at,
            pose_age=None if self.last_pose_tick is None else tick - self.last_pose_tick,
            voltage=self.power.voltage,
            flying=self.supervisor.is_flying,
            levelling=self.supervisor.state is SupervisorState.WARNING_LEVEL_OUT,
            thrust_seen=bool(np.count_nonzero(self.ratios)),  # `any` of so few takes six times as long
        )
        events = engine.step(sample)
        flown = engine.mode is OutputMode.SETPOINT and not setpoint.is_null
        self.setpoint = engine.target if flown else setpoint
        self._tell_others(tick, events)
        self.ratios[:] = engine.ratios if self.supervisor.motors_allowed and not self._rehearses() else 0
        if self.app is not None and self.app.motors_abandoned():
            self.params["motorPowerSet.enable"] = 0
            self.motor_override[0] = 0
        if self.motor_override[0]:
            self._override_motors()
        applied_duties(self.ratios, self._duties)

    def _tell_others(self, tick: int, events: EngineEvent) -> None:
        """What a step of the engine means for the planner and for who asked."""
        if events and EngineEvent.CUT in events:
            self.high_level.stop()
        if events and EngineEvent.HANDED_OVER in events:
            self.high_level.hold(self.flat_state(), tick * DT)
        if self.app is not None:
            self.app.answer(events)

    def _idle_motors(self) -> None:
        """Motors that may turn turn at least so fast (``power_distribution_quadrotor.c``)."""
        if self.idle_thrust and self.supervisor.motors_allowed and not self.motor_override[0]:
            np.maximum(self.ratios, self.idle_thrust, out=self.ratios)
            applied_duties(self.ratios, self._duties)

    def _override_motors(self) -> None:
        """``motorPowerSet``: it wins in every state, disarmed and locked included, as in the firmware."""
        mode, *values = self.motor_override
        if mode == 1:
            self.ratios[:] = values
        elif mode == 2:
            self.ratios[:] = values[0]
        else:
            thrust, least = values[0] / FULL_RATIO * self.thrust_max, self._vehicle.motors.thrust_min.value
            thrusts = (thrust, thrust, thrust, thrust)
            motor_ratios(thrusts, self.power.supply, self._thrust_map, least, self.ratios)

    def flat_state(self) -> FlatState:
        """The estimate as the planner wants it."""
        yaw = self.estimator.roll_pitch_yaw()[2]
        return FlatState(self.estimator.position(), self.estimator.velocity(), yaw=yaw)

    def _is_flying(self) -> bool:
        return self.supervisor.is_flying

    def _rehearses(self) -> bool:
        return self.app is not None and self.app.rehearses

    def _is_configured(self) -> bool:
        """As the app needs it; else idle motors turn after CUT, or others have the estimate or the motors."""
        has_kalman = self.params.raw(self._estimator_parameter)[0] == _KALMAN  # its byte: asked every ms
        return has_kalman and self.idle_thrust == 0 and not self.motor_override[0]

    def _at_rest(self) -> bool:
        """Nobody flies, nothing turns, and the firmware is configured as the app needs it."""
        moves = self.supervisor.is_armed or self.supervisor.is_flying or bool(self.ratios.any())
        return self._is_configured() and not moves

    def _boot(self) -> None:
        self.boot_count += 1
        self.running = True
        self._tick, self._packet_tick = 0, 0
        self._terminal_voltage = 0.0
        self.params.reset()
        sensing = self._vehicle.sensing
        self.supervisor = Supervisor(self._build.auto_arm, lambda: not self._rehearses())
        self.estimator = Estimator()
        self.sensors = InertialSensors(sensing, self._rng)
        self.sensors.gyro_bias[:] = self._gyro_bias
        self.power = PowerManager(sensing.battery_voltage_noise.value, self._rng)
        self._trajectories.clear()
        self._tester.reset_write_errors()
        self.high_level = HighLevelCommander(self._trajectories.data)
        self.setpoints = Commander(
            self.high_level.stop, lambda: self.high_level.tell_state(self.flat_state())
        )
        self.engine.boot()
        self.setpoint = _NULL[0]
        self.ratios[:] = 0
        self._duties[:] = 0.0
        self.motor_override[:] = [0, 0, 0, 0, 0]
        self.last_pose: tuple[float, ...] = (0.0,) * 7
        self.last_pose_tick: int | None = None
        self.pose_rate = self.rejected_rate = 0
        self.poses_received = self._rejected = 0
        self._console = [
            "SYS: ----------------------------\n",
            "SYS: Crazyflie 2.1 (simulated by perchhw) is up and running!\n",
            "SYS: Free to fly\n",
        ]
        if self.app:
            self.app.boot()

    def _apply_parameters(self) -> None:
        self.params["system.selftestPassed"] = 1
        self._build.apply(self.params)
        self.params["stabilizer.estimator"] = _KALMAN
        self.params["stabilizer.controller"] = 6 if self.app else 5  # out of tree, Lee
        self.params.take_updates()
        for name, setter in self._setters.items():
            setter(self.params[name])


def _fail_assert(value: Number) -> None:
    """``system.doAssert``: an assert that fails on request."""
    if value:
        raise FirmwareAssertion("system.c: doAssert")
