"""The discharge wizard: one thrust is asked for while the voltage falls, and the scale says what came.

The drone must carry the map that was measured: its firmware divides by the voltage and gives the motors more
of it. On a supply the voltage is lowered in steps; on a battery it falls by itself.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import repeat
from pathlib import Path

import numpy as np

from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE
from calibration.bench.instruments.set_points import PWM_STEP
from calibration.bench.procedures.run_book import Json, RunBook
from calibration.bench.procedures.stand_wizard import StandStep, StandWizard, kept_calibration
from calibration.bench.procedures.thrust import CURRENT_LIMIT_A
from calibration.bench.procedures.thrust_recording import COAST_S, MOTORS, StandReading, ThrustStand
from calibration.bench.thrust.compensation import Discharge, read_discharge, write_discharge
from calibration.bench.thrust.errors import ThrustTableError
from onboard.battery import FULL_RATIO
from onboard.gravity import GRAM_FORCE, GRAVITY
from onboard.vehicle import Vehicle

KIND = "discharge"
TABLE_FILE = "discharge.csv"
FULL_V, EMPTY_V = 4.2, 3.2
VOLTAGES = tuple(float(volts) for volts in np.round(np.arange(FULL_V, EMPTY_V - 0.05, -0.1), 1))
"""Of a supply in the place of the battery: from full to empty."""
_STRONG_SHARE = 0.9
"""Of the most thrust that the vehicle file lets a motor give."""
_PAUSE_S = 1.0


@dataclass(frozen=True)
class DischargePlan:
    """What is asked for.

    Attributes:
        vehicle: whose map is on the drone.
    """

    vehicle: Vehicle

    @property
    def commands(self) -> tuple[int, ...]:
        """0..65535, shares of the most thrust: what hovers, and a strong one."""
        hover = self.vehicle.body.mass.value * GRAVITY / MOTORS / self.vehicle.motors.thrust_max.value
        return tuple(PWM_STEP * round(255 * share) for share in (hover, _STRONG_SHARE))

    def thrust(self, command: int) -> float:
        """N of one motor that the firmware is asked for."""
        return command / FULL_RATIO * self.vehicle.motors.thrust_max.value

    def settings(self) -> Json:
        """What must stay the same when a run goes on."""
        return {"vehicle": self.vehicle.name}


class DischargeWizard(StandWizard):
    """Leads through scale, stand and discharges; a battery is discharged once, at the thrust that hovers.

    Args:
        plan: what is asked for.
        stand: with a supply in the battery's place, or without.
    """

    def __init__(self, plan: DischargePlan, stand: ThrustStand) -> None:
        super().__init__(stand)
        self._plan = plan

    def _steps(self, book: RunBook) -> Iterator[StandStep]:
        for command in self._plan.commands[: 1 if self._stand.supply is None else None]:
            asked = self._plan.thrust(command) / GRAM_FORCE
            title = f"{asked:.1f} gf of each motor while the voltage falls"
            yield StandStep(f"discharge-{command}", title, partial(self._discharge, book, command))

    def _discharge(self, book: RunBook, command: int) -> Json:
        stand, operator = self._stand, book.operator
        calibration = kept_calibration(book, stand)
        readings: list[StandReading] = []
        for voltage in self._voltages():
            if voltage is not None:
                stand.set_supply(voltage, CURRENT_LIMIT_A)
            if not readings:
                stand.motors.unlock(UNLOCK_PHRASE)
                readings.append(stand.read(COAST_S))
            stand.motors.spin_all(command, compensated=True)
            readings.append(stand.read())
            operator.tell(f"{readings[-1].board:.2f} V: {100.0 * readings[-1].command / FULL_RATIO:.0f} % on")
            if voltage is None and readings[-1].board < EMPTY_V:
                break
        stand.motors.stop("the discharge has ended")
        readings.append(stand.read(COAST_S))
        for finding in dict.fromkeys(one for reading in readings for one in reading.findings):
            operator.warn(finding.text)
        time = np.array([reading.time for reading in readings])
        mass = np.array([calibration.mass(reading.indication) for reading in readings])
        zero = np.interp(time, time[[0, -1]], mass[[0, -1]])
        inside = slice(1, -1)
        discharge = Discharge(
            time=(time - time[1])[inside],
            battery=np.array([reading.board for reading in readings])[inside],
            requested=np.full(time.size, self._plan.thrust(command))[inside],
            measured=((mass - zero) * GRAVITY / MOTORS)[inside],
            command=np.array([reading.command for reading in readings])[inside],
        )
        write = partial(write_discharge, discharge=discharge, motors=MOTORS)
        return {"table": book.keep_raw(f"discharge-{command}", write, ".csv")}

    def _voltages(self) -> Iterable[float | None]:
        """Of the supply, one after the other; a battery needs none until it is empty."""
        return repeat(None) if self._stand.supply is None else VOLTAGES


def join_discharges(folder: Path, steps: dict[str, Json]) -> Path:
    """One table of a run's discharges, one after the other.

    Raises:
        ThrustTableError: none was recorded.
    """
    kept = [step["table"]["file"] for step in steps.values() if "table" in step]
    if not kept:
        raise ThrustTableError("no discharge was recorded: run the wizard to its end")
    parts = [read_discharge(folder / name) for name in kept]
    begins = np.cumsum([0.0, *(float(part.time[-1]) + _PAUSE_S for part in parts[:-1])])
    shifted = [replace(part, time=part.time + begin) for part, begin in zip(parts, begins, strict=True)]
    joined = Discharge(
        **{
            column.name: np.concatenate([getattr(part, column.name) for part in shifted])
            for column in fields(Discharge)
        }
    )
    write_discharge(folder / TABLE_FILE, joined, MOTORS)
    return folder / TABLE_FILE
