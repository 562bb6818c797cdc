"""Record thrust against command: scale, supply and drone read together, motors kept alive meanwhile."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from calibration.errors import CalibrationError
from calibration.instruments.load_cell import LoadCell, ScaleCalibration, check_counts
from calibration.instruments.motor_stand import MotorStand
from calibration.instruments.supply import Supply
from calibration.measurement import Finding, rejected
from calibration.thrust_voltage.raw_table import RawTable
from calibration.thrust_voltage.units import Units
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY

SETTLE_S = 1.0
AVERAGE_S = 1.5
"""Of the load cell's time (bench notes 1.3)."""
FALL_S, COAST_S = 2.5, 5.0
"""After a lower command, and before a tare: propellers that coast still push. By the laws of the bench notes
(1.2) 0.003 gf are left."""
MOTORS = 4
_LINEAR_KG = 1e-4
_LOOK_S = 0.1


class ScaleUnusable(CalibrationError):
    """The load cell's readings cannot be used; the message says what is wrong with them."""


@dataclass
class ThrustTable:
    """The raw table as it grows."""

    rows: list[tuple[float, int, str, int, float, float, float]] = field(default_factory=list)

    def add(self, block: int, kind: str, command: int, reading: "StandReading") -> None:
        """One row."""
        self.rows.append(
            (reading.time, block, kind, command, reading.supply, reading.board, reading.mass * GRAVITY)
        )

    def finished(self, name: str) -> RawTable:
        """The table, SI units."""
        columns = [np.array(column) for column in zip(*self.rows, strict=True)]
        return RawTable(
            name=name,
            units=Units(),
            time=columns[0].astype(np.float64),
            block=columns[1].astype(np.float64),
            kind=tuple(str(kind) for kind in columns[2]),
            command=columns[3].astype(np.float64),
            supply=columns[4].astype(np.float64),
            board=columns[5].astype(np.float64),
            scale=columns[6].astype(np.float64),
            motors=np.full(len(self.rows), float(MOTORS)),
        )


@dataclass(frozen=True)
class StandReading:
    """Everything at one command.

    Attributes:
        time: s, load cell's clock, middle of the average.
        mass: kg that push the scale, zero not yet taken off.
        supply, board: V at the supply's terminals and, by the drone, at the board.
        limited: the supply limited its current.
        findings: of the scale's counts.
    """

    time: float
    mass: float
    supply: float
    board: float
    limited: bool
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class ThrustStand:
    """The instruments of the thrust stand, used together.

    Attributes:
        motors: unlocked.
        cell: load cell.
        supply: feeds the drone.
        calibration: counts to mass.
    """

    motors: MotorStand
    cell: LoadCell
    supply: Supply
    calibration: ScaleCalibration

    def read(self, settle: float = SETTLE_S) -> StandReading:
        """Wait until the thrust has settled, then average; the motors are kept alive meanwhile.

        Raises:
            ScaleUnusable: stuck, saturated or powered down. InstrumentError, LinkError, MotorsRefused.
        """
        self._pass(settle)
        times, raw, volts = self._pass(AVERAGE_S)
        findings = check_counts(times, raw)
        if rejected(findings):
            raise ScaleUnusable(f"load cell {self.cell.device}: {findings[0].text}")
        measured = self.supply.measure()
        mean = float(np.mean(self.calibration.mass(raw.astype(np.float64))))
        return StandReading(
            time=float(np.mean(times)),
            mass=mean,
            supply=measured.voltage,
            board=float(np.mean(volts)),
            limited=measured.limited,
            findings=findings,
        )

    def _pass(self, seconds: float) -> tuple[FloatArray, np.ndarray, FloatArray]:
        """Counts and board voltages of the next `seconds` of the load cell's time."""
        times: list[FloatArray] = []
        raw: list[np.ndarray] = []
        volts: list[FloatArray] = []
        begin = end = None
        self.cell.take(0.0)
        self.motors.take(0.0)
        while begin is None or end is None or end - begin < seconds:
            batch = self.cell.take(_LOOK_S)
            if batch.times.size:
                begin = float(batch.times[0]) if begin is None else begin
                end = float(batch.times[-1])
                times.append(batch.times)
                raw.append(batch.raw)
            volts.append(self.motors.take(_LOOK_S).values["pm.vbat"])
        return np.concatenate(times), np.concatenate(raw), np.concatenate(volts)


def calibrate_scale(cell: LoadCell, masses: Sequence[float], counts: Sequence[float]) -> ScaleCalibration:
    """Counts to mass from weights that were put on.

    Raises:
        ScaleUnusable: not linear within 0.1 g.
        InstrumentInputError: the counts do not follow the weights.
    """
    calibration = ScaleCalibration.fit(masses, counts)
    if calibration.nonlinearity > _LINEAR_KG:
        raise ScaleUnusable(
            f"load cell {cell.device}: a weight lies {1e3 * calibration.nonlinearity:.2f} g off the line "
            f"(limit {1e3 * _LINEAR_KG:g} g): does something touch the cell, are the weights what they say?"
        )
    return calibration


def counts_now(cell: LoadCell, seconds: float = AVERAGE_S) -> float:
    """Mean counts over `seconds` of the load cell's time, motors off.

    Raises:
        ScaleUnusable: stuck, saturated or powered down.
    """
    cell.take(0.0)
    times: list[FloatArray] = []
    raw: list[np.ndarray] = []
    while not times or times[-1][-1] - times[0][0] < SETTLE_S + seconds:
        batch = cell.take()
        if batch.times.size:
            times.append(batch.times)
            raw.append(batch.raw)
    stamps, counts = np.concatenate(times), np.concatenate(raw)
    findings = check_counts(stamps, counts)
    if rejected(findings):
        raise ScaleUnusable(f"load cell {cell.device}: {findings[0].text}")
    return float(np.mean(counts[stamps >= stamps[0] + SETTLE_S]))
