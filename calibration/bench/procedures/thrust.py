"""The thrust wizard: weights, tares, commands in random order, and thrust against voltage comes out."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE
from calibration.bench.procedures.operator import Gauge, Light, Operator, Question
from calibration.bench.procedures.run_book import Json, RunBook
from calibration.bench.procedures.stand_wizard import StandStep, StandWizard, kept_calibration, unit_shown
from calibration.bench.procedures.thrust_recording import (
    COAST_S,
    FALL_S,
    SETTLE_S,
    ThrustStand,
    ThrustTable,
)
from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.pwm import exact_set_points
from calibration.bench.thrust.raw_table import RawTable, write_raw
from calibration.errors import CalibrationError
from calibration.measurement import Estimate, Finding, Severity
from onboard.arrays import FloatArray
from onboard.battery import thrust_from_voltage
from onboard.errors import InputError
from onboard.gravity import GRAM_FORCE, GRAVITY
from onboard.vehicle import Vehicle

if TYPE_CHECKING:
    from calibration.bench.thrust.thrust_result import ThrustResult

Show = Callable[[Sequence[Gauge]], None]

KIND = "thrust"
MULTIMETER = Question(
    "supply_voltage", "multimeter at the drone's battery plug, motors off", "V", "V", (2.5, 4.6), 5e-3
)
CURRENT_LIMIT_A = 10.0
_REPEAT_EVERY = 10
"""A low point comes again after so many, to show drift and warming (bench notes 1.3)."""
_REPEAT_STEP = 1
_HOT_SHARE = 0.8
_GAUGE_SIGMA = 5e-3 / 3.0**0.5 / 3.7
"""Relative, of the ratio: a multimeter that is right within 5 mV."""


class NoSupply(CalibrationError, InputError):
    """No supply whose voltage can be set."""


@dataclass(frozen=True)
class ThrustPlan:
    """What is to be measured.

    Attributes:
        vehicle: as it is believed to be.
        voltages: V of the supply; two show whether the motor voltage is what the wizard thinks.
        levels: commands of each voltage.
        seed: of their order.
    """

    vehicle: Vehicle
    voltages: tuple[float, ...] = (3.4, 3.9)
    levels: int = 20
    seed: int = 0

    def settings(self) -> Json:
        """What must stay the same when a run goes on."""
        return {
            "vehicle": self.vehicle.name,
            "voltages": list(self.voltages),
            "levels": self.levels,
            "seed": self.seed,
        }

    def order(self, block: int) -> list[tuple[str, int]]:
        """Kinds and commands of a block: all levels in random order, a low one between; then up and down."""
        rng = np.random.default_rng([self.seed, block])
        levels = exact_set_points(self.levels, 0.08, 1.0)
        low = levels[_REPEAT_STEP]
        rows: list[tuple[str, int]] = []
        for number, index in enumerate(rng.permutation(len(levels))):
            if number % _REPEAT_EVERY == 0:
                rows.append(("repeat", low))
            rows.append(("point", levels[int(index)]))
        rows.append(("repeat", low))
        if block == 0:
            some = levels[2 :: max(1, self.levels // 5)]
            rows += [("up", level) for level in some] + [("down", level) for level in reversed(some)]
        return rows


class ThrustWizard(StandWizard):
    """Leads through scale, stand and sweeps.

    Args:
        plan: what is measured.
        stand: with a supply, which must be there.
    """

    def __init__(self, plan: ThrustPlan, stand: ThrustStand) -> None:
        super().__init__(stand)
        self._plan = plan

    def _steps(self, book: RunBook) -> Iterator[StandStep]:
        for block, voltage in enumerate(self._plan.voltages):
            work = partial(self._sweep, book, block, voltage)
            yield StandStep(f"sweep-{voltage:g}", f"Thrust at {voltage:g} V", work)

    def _sweep(self, book: RunBook, block: int, voltage: float) -> Json:
        operator, stand = book.operator, self._stand
        motors, supply = stand.motors, stand.supply
        assert supply is not None
        calibration = kept_calibration(book, stand)
        supply.set(voltage, CURRENT_LIMIT_A)
        supply.switch(on=True)
        motors.unlock(UNLOCK_PHRASE)
        table = ThrustTable(calibration)
        limited = 0
        idle = stand.read()
        table.add(block, "tare", 0, idle)
        multimeter = operator.measure(MULTIMETER)
        rows, before = self._plan.order(block), 0
        seen: dict[Finding, None] = {}
        with self._display(operator, voltage) as show:
            for number, (kind, command) in enumerate(rows):
                motors.spin_all(command)
                reading = stand.read(SETTLE_S if command > before else FALL_S)
                before = 0 if stand.scale.typed else command
                seen |= dict.fromkeys(reading.findings)
                if reading.limited:
                    limited += 1
                else:
                    table.add(block, kind, command, reading)
                mass = calibration.mass(reading.indication) - calibration.mass(idle.indication)
                show(self._gauges(number, len(rows), mass, reading.limited))
                if command >= _HOT_SHARE * 65536 or number == len(rows) // 2:
                    motors.stop("cool down")
                    motors.unlock(UNLOCK_PHRASE)
                    table.add(block, "tare", 0, stand.read(COAST_S))
                    before = 0
        motors.stop("the sweep has ended")
        table.add(block, "tare", 0, stand.read(COAST_S))
        raw = table.finished(f"sweep-{voltage:g}")
        for finding in (*seen, *sweep_findings(raw, limited)):
            operator.warn(finding.text)
        return {
            "table": book.keep_raw(f"sweep-{voltage:g}", partial(write_raw, table=raw), ".csv"),
            "gauge": float(np.mean(multimeter)) / idle.board,
            "limited": limited,
        }

    def _display(self, operator: Operator, voltage: float) -> AbstractContextManager[Show]:
        """Live numbers, where nobody types between them."""
        if self._stand.scale.typed:
            return nullcontext(lambda gauges: None)
        return operator.live(f"Thrust at {voltage:g} V")

    def _gauges(self, number: int, count: int, mass: float, limited: bool) -> list[Gauge]:
        thrust = mass * GRAVITY / GRAM_FORCE
        rows = [Gauge("point", f"{number + 1} of {count}"), Gauge("thrust", f"{thrust:6.2f} gf in all")]
        if limited:
            rows.append(Gauge("supply", "limits its current: raise the limit", Light.RED))
        return rows


def sweep_findings(table: RawTable, limited: int) -> list[Finding]:
    """What is wrong with one sweep at once; the fit looks deeper."""
    findings = []
    if limited:
        text = (
            f"{table.name}: the supply limited its current at {limited} point(s): allow 8 A, use short leads"
        )
        findings.append(Finding("current_limit", Severity.REJECT, text))
    thrust = table.scale[table.pointing]
    if thrust.size and float(np.median(thrust) - np.median(table.scale[table.rows("tare")])) < 0.0:
        text = f"{table.name}: the scale gets lighter with thrust: turn the drone over, it must push it"
        findings.append(Finding("inverted", Severity.REJECT, text))
    return findings


def fit_thrust(folder: Path, steps: Mapping[str, Any], plan: ThrustPlan) -> "ThrustResult":
    """The thrust map of a run, from its folder.

    Raises:
        ThrustTableError: no sweep, too few points, or no form that may fly.
    """
    from calibration.bench.thrust.analysis import analyse, read_table

    sweeps: list[RawTable] = []
    for voltage in plan.voltages:
        kept = steps.get(f"sweep-{voltage:g}")
        if kept:
            table = read_table(folder / kept["table"]["file"])
            if not isinstance(table, RawTable):
                raise ThrustTableError(f"{kept['table']['file']}: is not the raw table of a sweep")
            sweeps.append(replace(table, board=table.board * kept["gauge"]))
    if not sweeps:
        raise ThrustTableError("no sweep was recorded: run the wizard to its end")
    map_so_far = plan.vehicle.motors.thrust_map_compiled()
    return analyse(_joined(sweeps), lambda volts: thrust_from_voltage(map_so_far, volts))


def thrust_inputs(steps: Mapping[str, Any]) -> dict[str, Estimate]:
    """What the multimeter and the weights said, by name."""
    inputs = {
        f"board voltage, true over read ({key})": Estimate(step["gauge"], "1", _GAUGE_SIGMA)
        for key, step in steps.items()
        if "gauge" in step
    }
    scale = steps.get("scale")
    if scale:
        inputs[f"scale, {unit_shown(scale)} shown for a kg"] = Estimate(abs(scale["counts_per_kg"]), "1", 0.0)
    return inputs


def _joined(sweeps: list[RawTable]) -> RawTable:
    """One table of several sweeps."""

    def column(name: str) -> FloatArray:
        return np.concatenate([getattr(sweep, name) for sweep in sweeps])

    numbers: dict[str, Any] = {name: column(name) for name in _COLUMNS}
    kinds = tuple(kind for sweep in sweeps for kind in sweep.kind)
    return replace(sweeps[0], name="thrust run", kind=kinds, **numbers)


_COLUMNS = ("time", "block", "command", "supply", "board", "scale", "motors")
