"""Record thrust against command: scale, supply and drone read together, motors kept alive meanwhile."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from calibration.bench.instruments.drone_log import LogBatch
from calibration.bench.instruments.errors import ScaleUnusable
from calibration.bench.instruments.manual import BY_EYE_S
from calibration.bench.instruments.motor_stand import MotorStand
from calibration.bench.instruments.scale import Scale, ScaleCalibration
from calibration.bench.instruments.supply import Supply, SupplyReading
from calibration.bench.thrust.raw_table import RawTable
from calibration.bench.thrust.units import Units
from calibration.measurement import Finding
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY

SETTLE_S = 1.0
AVERAGE_S = 1.5
"""Of the drone's time (bench notes 1.3)."""
FALL_S, COAST_S = 2.5, 5.0
"""After a lower command, and before a tare: propellers that coast still push. By the laws of the bench notes
(1.2) 0.003 gf are left."""
MOTORS = 4
_LINEAR_KG, _LINEAR_TYPED_KG = 1e-4, 3e-4
"""A kitchen scale shows steps of 0.1 g."""
_LOOK_S = 0.1


@dataclass
class ThrustTable:
    """The raw table as it grows.

    Attributes:
        calibration: of the scale.
        rows: so far.
    """

    calibration: ScaleCalibration
    rows: list[tuple[float, int, str, int, float, float, float]] = field(default_factory=list)

    def add(self, block: int, kind: str, command: int, reading: "StandReading") -> None:
        """One row."""
        force = self.calibration.mass(reading.indication) * GRAVITY
        self.rows.append((reading.time, block, kind, command, reading.supply, reading.board, force))

    def finished(self, name: str) -> RawTable:
        """The table, SI units."""
        time, block, kind, *numbers = zip(*self.rows, strict=True)
        command, supply, board, scale = (np.array(column, dtype=np.float64) for column in numbers)
        return RawTable(
            name=name,
            units=Units(),
            time=np.array(time),
            block=np.array(block, dtype=np.float64),
            kind=kind,
            command=command,
            supply=supply,
            board=board,
            scale=scale,
            motors=np.full(len(self.rows), float(MOTORS)),
        )


@dataclass(frozen=True)
class StandReading:
    """Everything at one command.

    Attributes:
        time: s, drone's clock, middle of the average.
        indication: by the scale, in its unit.
        supply, board: V at the supply's terminals and, by the drone, at the board.
        command: 0..65535, mean of what the drone gives its motors.
        limited: the supply limited its current.
        findings: of the scale.
    """

    time: float
    indication: float
    supply: float
    board: float
    command: float
    limited: bool
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class ThrustStand:
    """The instruments of the thrust stand, used together; the drone keeps the time.

    Attributes:
        motors: of the drone.
        scale: that it pushes.
        supply: feeds the drone; None for its battery.
    """

    motors: MotorStand
    scale: Scale
    supply: Supply | None

    def read(self, settle: float = SETTLE_S) -> StandReading:
        """Wait until the thrust has settled, then average; the motors are kept alive meanwhile.

        A person reads the scale with the motors on, and types when they have stopped: nothing turns while a
        program waits for a key.

        Raises:
            ScaleUnusable: stuck, saturated, powered down. InstrumentError, LinkError, MotorsRefused.
        """
        self.pass_time(settle)
        self.scale.begin()
        with ThreadPoolExecutor(1) as beside:
            measured = None if self.supply is None else beside.submit(self.supply.measure)
            samples = self.pass_time(BY_EYE_S if self.scale.typed else AVERAGE_S)
            while measured is not None and not measured.done():
                self.motors.take(_LOOK_S)
        board = float(np.mean(samples["pm.vbat"]))
        supply = SupplyReading(board, math.nan, False, 0.0) if measured is None else measured.result()
        if self.scale.typed:
            self.motors.stop("a reading is typed")
        scale = self.scale.read()
        return StandReading(
            time=float(np.mean(samples["time"])),
            indication=scale.indication,
            supply=supply.voltage,
            board=board,
            command=float(np.mean([samples[f"motor.m{motor}"] for motor in range(1, MOTORS + 1)])),
            limited=supply.limited,
            findings=scale.findings,
        )

    def set_supply(self, voltage: float, current_limit: float) -> None:
        """Give the supply, which must be there, another voltage; motors that turn are kept alive meanwhile,
        unless a person sets it: then they stop before.

        Raises:
            InstrumentError, LinkError, MotorsRefused.
        """
        assert self.supply is not None
        if self.supply.typed:
            self.motors.stop("the supply is set by hand")
            self.supply.set(voltage, current_limit)
            return
        with ThreadPoolExecutor(1) as beside:
            setting = beside.submit(self.supply.set, voltage, current_limit)
            while not setting.done():
                self.motors.take(_LOOK_S)
        setting.result()

    def pass_time(self, seconds: float) -> dict[str, FloatArray]:
        """Look at scale and drone for that long on the drone's clock; the drone's log, and ``time`` [s]."""
        batches: list[LogBatch] = []
        self.motors.take(0.0)
        begin = end = math.nan
        while not end - begin >= seconds:
            self.scale.look(_LOOK_S)
            batch = self.motors.take(_LOOK_S)
            if batch.times.size:
                begin = float(batch.times[0]) if math.isnan(begin) else begin
                end = float(batch.times[-1])
                batches.append(batch)
        values = {name: np.concatenate([one.values[name] for one in batches]) for name in batches[0].values}
        return values | {"time": np.concatenate([batch.times for batch in batches])}


def calibrate_scale(scale: Scale, masses: Sequence[float], indications: Sequence[float]) -> ScaleCalibration:
    """What a scale shows to mass, from weights that were put on.

    Raises:
        ScaleUnusable: not linear within 0.1 g.
        InstrumentInputError: the readings do not follow the weights.
    """
    calibration = ScaleCalibration.fit(masses, indications, scale.least_span)
    limit = _LINEAR_TYPED_KG if scale.typed else _LINEAR_KG
    if calibration.nonlinearity > limit:
        raise ScaleUnusable(
            f"scale {scale.device}: a weight lies {1e3 * calibration.nonlinearity:.2f} g off the line "
            f"(limit {1e3 * limit:g} g): does something touch it, are the weights what they say?"
        )
    return calibration
