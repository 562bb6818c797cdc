"""The simulated bench in steps of 1 ms: drone, pendulum, motors, scale, supply and boards; no sockets.

Everything counts in bench time, which begins at zero; who steps it decides how fast that is.
"""

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle
from sim_backend.bench.balance import SimulatedBalance
from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.hanging import BifilarDrone, SimulatedJig
from sim_backend.bench.korad import SimulatedKoradSupply
from sim_backend.bench.motors import BenchMotors
from sim_backend.bench.power import BROWN_OUT_V, ELECTRONICS_A, RECOVERY_V, Pack, PowerStage
from sim_backend.bench.scale import ScaleBoard, SimulatedLoadCell
from sim_backend.bench.scpi import SimulatedScpiSupply
from sim_backend.bench.spin_record import SpinRecord
from sim_backend.bench.tachometer import OpticalSensor, TachometerBoard
from sim_backend.crazyflie.firmware import Firmware
from sim_backend.engine_name import EngineName
from sim_backend.lab_faults import DroneFaults

DT = 0.001
GAUGE_ERROR = 0.01
"""Standard deviation of the relative error of the drone's battery reading."""
STAND_G = 45.0
"""g of the stand that carries the drone over the scale."""
BURNT_V = 5.5
"""V at which the drone's electronics die."""


class Place(Enum):
    """Where the drone is."""

    FLOOR = "floor"
    HANGING = "hanging"
    CLAMPED = "clamped"
    ON_SCALE = "on_scale"


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """What a bench is made of.

    Attributes:
        seed: of all random numbers.
        faults: of the bench.
        drone: faults of the drone itself.
        jig: what holds a hung drone.
        engine: which code the drone runs; both compute the same.
    """

    seed: int = 0
    faults: BenchFaults = field(default_factory=BenchFaults)
    drone: DroneFaults = field(default_factory=DroneFaults)
    jig: SimulatedJig = field(default_factory=SimulatedJig)
    engine: EngineName = EngineName.REFERENCE


class BenchFirmware(Firmware):
    """A firmware that counts the packets it gets.

    Attributes:
        packets: so far.
    """

    packets = 0

    def on_packet(self) -> None:
        """A packet arrived."""
        self.packets += 1
        super().on_packet()


class Bench:
    """A bench with one drone; call :meth:`step` for each ms.

    Attributes:
        vehicle: the truth.
        options: as given.
        ticks: ms so far.
        firmware, motors, supply, pack: of the drone.
        hung: the drone on its strings, while it hangs.
        place: where the drone is.
        watched: motor (1..4) that the tachometer looks at.
        weights: kg on the scale.
        tachometer, scale, scpi: the instruments' electronics.
        balance: under the scale, and reads the same load.
        korad: the supply's other remote control.
        record: when motors were driven.
        board_voltage: V at the drone.
        on_supply: whether the supply feeds the drone.
        driven: whether a motor has a duty.
    """

    def __init__(self, vehicle: Vehicle, options: BenchOptions | None = None) -> None:
        """Raises BenchInputError when the vehicle does not say how fast its rotors turn."""
        options = options or BenchOptions()
        faults = options.faults
        self.vehicle, self.options = vehicle, options
        names = (
            "firmware",
            "motors",
            "sensor",
            "tachometer",
            "cell",
            "scale",
            "scpi",
            "gauge",
            "hands",
            "balance",
        )
        rngs = dict(zip(names, np.random.default_rng(options.seed).spawn(len(names)), strict=True))
        self.hands_rng = rngs["hands"]
        self.firmware = BenchFirmware(
            vehicle, rngs["firmware"], gyro_bias=options.drone.gyro_bias, engine=options.engine
        )
        self.motors = BenchMotors(vehicle, rngs["motors"], missing=faults.missing_propeller)
        self.supply = PowerStage(faults)
        self.pack = Pack(vehicle.battery, options.drone.battery_voltage)
        self.tachometer = TachometerBoard(rngs["tachometer"], faults)
        self.scale = ScaleBoard(rngs["scale"], faults)
        self.scpi = SimulatedScpiSupply(self.supply, rngs["scpi"], faults)
        drawn = GAUGE_ERROR * float(rngs["gauge"].standard_normal())
        self.gauge_gain = 1.0 + (drawn if faults.gauge_error is None else faults.gauge_error)
        self.korad = SimulatedKoradSupply(self.supply)
        self.cell = SimulatedLoadCell(rngs["cell"], faults)
        self.balance = SimulatedBalance(rngs["balance"])
        self.hung: BifilarDrone | None = None
        self.place = Place.FLOOR
        self.watched = 1
        self.weights = 0.0
        self.record = SpinRecord()
        self.board_voltage = 0.0
        self.on_supply = self.driven = False
        self.ticks = 0
        self._sensor = OpticalSensor(rngs["sensor"], faults)
        self._dark = self._burnt = False
        self._duties: FloatArray = np.zeros(4)
        self._packets = 0
        self._told = list(self.firmware.motor_override)
        self._force: FloatArray = np.array([0.0, 0.0, GRAVITY])
        self._rates: FloatArray = np.zeros(3)
        self._weight = GRAVITY * vehicle.body.mass.value
        self._current_per_newton = vehicle.battery.motor_current_per_newton.value

    @property
    def time(self) -> float:
        """Bench time, s."""
        return self.ticks * DT

    @property
    def silent(self) -> bool:
        """Whether the drone's radio carries nothing."""
        drone = self.options.drone
        frozen = self.time >= min(drone.freeze_drone_at, drone.drone_dies_at)
        return frozen or self._dark or self.options.faults.link_loss.covers(self.time)

    def run(self, seconds: float) -> None:
        """Go on by `seconds`, as fast as it goes."""
        for _ in range(round(seconds / DT)):
            self.step()

    def step(self) -> None:
        """One ms."""
        self.ticks += 1
        if self.hung is not None:
            self.hung.step(DT)
        self._feed()
        self._fly()
        self._turn()
        self._weigh()
        self.tachometer.step(self.time)
        self.scale.step(self.time)
        self._note()

    def put(self, place: Place) -> None:
        """The drone goes somewhere; its battery is exchanged where the supply had fed it."""
        self.place = place
        self._force[:] = 0.0, 0.0, -GRAVITY if place is Place.ON_SCALE else GRAVITY
        self._rates[:] = 0.0
        if place is not Place.HANGING:
            self.hung = None
        if place in (Place.FLOOR, Place.HANGING) and self.on_supply:
            self.on_supply = False
            self.pack.exchange()

    def _feed(self) -> None:
        demand = ELECTRONICS_A + self._current_per_newton * self.motors.thrust
        on_stand = self.place in (Place.CLAMPED, Place.ON_SCALE)
        if on_stand and not self.on_supply and not self.options.faults.on_battery:
            # The person plugs the supply in as soon as it gives what the drone needs.
            self.on_supply = self.supply.terminal >= RECOVERY_V
        fed = self.supply.feed(demand if self.on_supply else 0.0, DT)
        self.board_voltage = fed if self.on_supply else self.pack.feed(demand, DT)
        dies = self.time >= self.options.drone.drone_dies_at or self._burnt
        if self.board_voltage > BURNT_V:
            self._burnt = True
            self.record.incident(self.time, f"the drone got {self.board_voltage:.1f} V and burnt")
        if not self._dark and (dies or self.board_voltage < BROWN_OUT_V):
            self._dark = True
            self.firmware.power_off()
        elif self._dark and not dies and self.board_voltage >= RECOVERY_V:
            self._dark = False
            self.firmware.reboot()

    def _fly(self) -> None:
        if self.time >= self.options.drone.freeze_drone_at:
            return
        if self.hung is not None:
            self.hung.feel(self._force, self._rates)
        self._duties = self.firmware.step(self._force, self._rates, self.gauge_gain * self.board_voltage)
        self.driven = bool(np.count_nonzero(self._duties))

    def _turn(self) -> None:
        motor = self.watched - 1
        before = float(self.motors.speed[motor])
        self.motors.step(self._duties, self.board_voltage, DT)
        after = float(self.motors.speed[motor])
        if self.place is Place.CLAMPED or self.options.faults.flicker is not None:
            self.tachometer.edges(self._sensor.step(self.time, DT, before, after))

    def _weigh(self) -> None:
        thrust, load = 0.0, 1000.0 * self.weights
        if self.place is Place.ON_SCALE:
            thrust = 1000.0 / GRAVITY * self.motors.thrust
            load += STAND_G + 1000.0 / GRAVITY * self._weight
        self.scale.conversion(self.cell.step(self.time, load, thrust))
        self.balance.step(load, -thrust if self.options.faults.inverted else thrust)

    def _note(self) -> None:
        record = self.record
        if self.firmware.packets != self._packets:
            self._packets = self.firmware.packets
            record.heard(self.time)
        if self.firmware.motor_override != self._told:
            self._told = list(self.firmware.motor_override)
            record.commanded(self.time)
        record.step(self.time, self.driven, self.place.value)
        if self.driven and self.place is Place.HANGING:
            record.incident(self.time, "the motors turned while the drone hung on its strings")
        if self.place is Place.FLOOR and self.motors.thrust > self._weight:
            record.incident(self.time, "the drone took off from the floor")
