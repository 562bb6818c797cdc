"""The raw table of a thrust run: what each instrument said, one row a reading, before any arithmetic.

    t_s,block,kind,command,supply_v,board_v,scale,motors

`kind` is ``tare`` (motors off), ``point``, ``up`` and ``down`` (the two directions of a sweep), ``repeat`` (a
point that comes again and again) or ``raised`` (as a point, but with more air below). `supply_v` is what the
supply says, `board_v` what the drone says, `scale` the scale's reading; `motors` is how many turn. Units are
`calibration.bench.thrust.units.Units`: the header is the same for all.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.pwm import applied_duty
from calibration.bench.thrust.units import FORCE_UNITS, LARGEST_READING, VOLTAGE_UNITS, Units
from onboard.arrays import BoolArray, FloatArray
from onboard.csv_file import CsvFile, write_csv

IntArray = NDArray[np.int64]


RAW_HEADER = ("t_s", "block", "kind", "command", "supply_v", "board_v", "scale", "motors")
KINDS = ("tare", "point", "up", "down", "repeat", "raised")

SIGMA_VOLTAGE = 5e-3
"""V: of one averaged reading of the board's voltage (bench notes 1.3)."""
SIGMA_SCALE = 0.05
"""gf: of one averaged reading of the scale."""


@dataclass(frozen=True, slots=True)
class RawTable:
    """A run as it was recorded; columns as in the file, in SI units where they have one.

    Attributes:
        name: of the file.
        units: that it was read with.
        time: (n,) s.
        block: (n,) label of a stretch between two pairs of tares (a supply voltage, a sweep).
        kind: (n,) one of `KINDS`.
        command: (n,) in the table's own numbers.
        supply, board: (n,) V.
        scale: (n,) N, with drift.
        motors: (n,) that turn.
    """

    name: str
    units: Units
    time: FloatArray
    block: FloatArray
    kind: tuple[str, ...]
    command: FloatArray
    supply: FloatArray
    board: FloatArray
    scale: FloatArray
    motors: FloatArray

    def rows(self, *kinds: str) -> BoolArray:
        """Which rows are of these kinds."""
        return np.array([kind in kinds for kind in self.kind], dtype=np.bool_)

    @property
    def pointing(self) -> BoolArray:
        """Rows that a map is fitted to."""
        return self.rows("point", "up", "down", "repeat")

    @property
    def motor_voltage(self) -> FloatArray:
        """(n,) V at the motor: duty really applied times the board's voltage."""
        return applied_duty(self.units.command16(self.command)) * self.board

    @property
    def commands16(self) -> FloatArray:
        """(n,) commands 0..65535."""
        return self.units.command16(self.command)


def read_raw(table: CsvFile, units: Units) -> RawTable:
    """A raw table from its columns.

    Raises:
        ThrustTableError: an unknown kind, a cell that is no number, a command or a voltage below 0.
    """
    kinds = table.text("kind")
    values = {name: table.finite(name) for name in ("t_s", "block", "command", "motors")}
    values |= {name: table.finite(name, largest=LARGEST_READING) for name in ("supply_v", "board_v", "scale")}
    for row, kind, command, turning in zip(
        table.rows, kinds, values["command"], values["motors"], strict=True
    ):
        if kind not in KINDS:
            raise table.problem(row, "kind", f"{kind!r}; choose one of {', '.join(KINDS)}")
        if command < 0.0:
            raise table.problem(row, "command", f"{command:g} is below 0")
        if turning < 1.0:
            raise table.problem(row, "motors", "at least one motor turns")
    for name in ("supply_v", "board_v"):
        for index in np.flatnonzero(values[name] < 0.0)[:1]:
            raise table.problem(table.rows[index], name, f"{values[name][index]:g} is below 0")
    volts = VOLTAGE_UNITS[units.voltage]
    motors = values["motors"] if units.motors is None else np.full(len(kinds), float(units.motors))
    return RawTable(
        name=table.path.name,
        units=units,
        time=values["t_s"],
        block=values["block"],
        kind=tuple(kinds),
        command=values["command"],
        supply=values["supply_v"] * volts,
        board=values["board_v"] * volts,
        scale=values["scale"] * FORCE_UNITS[units.force],
        motors=motors,
    )


def write_raw(path: Path, table: RawTable) -> None:
    """Write a table, in g, V and 16-bit commands."""
    rows = (
        (
            f"{table.time[index]:.3f}",
            f"{table.block[index]:.0f}",
            kind,
            f"{table.commands16[index]:.0f}",
            f"{table.supply[index]:.4f}",
            f"{table.board[index]:.4f}",
            f"{table.scale[index] / FORCE_UNITS['g']:.4f}",
            f"{table.motors[index]:.0f}",
        )
        for index, kind in enumerate(table.kind)
    )
    write_csv(path, RAW_HEADER, rows)


def drift_weights(table: RawTable) -> tuple[FloatArray, IntArray]:
    """How each row's zero comes from the tares of its block.

    Returns:
        (n, k) weights of the k tares in each row, linear in time between them and constant beyond; and the k
        rows that are tares.

    Raises:
        ThrustTableError: a block without a tare.
    """
    tares = np.flatnonzero(table.rows("tare"))
    weights = np.zeros((table.time.size, tares.size))
    for label in np.unique(table.block):
        own = np.flatnonzero(table.block[tares] == label)
        if own.size == 0:
            raise ThrustTableError(
                f"{table.name}: block {label:.0f} has no tare: read the scale with motors off"
            )
        rows = np.flatnonzero(table.block == label)
        at = table.time[tares[own]]
        order = np.argsort(at)
        for column in range(own.size):
            unit = np.zeros(own.size)
            unit[column] = 1.0
            weights[rows, own[order][column]] = np.interp(table.time[rows], at[order], unit)
    return weights, tares.astype(np.int64)


def to_data(table: RawTable) -> ThrustData:
    """Points of one motor with the scale's drift removed; tare errors are kept as shared ones."""
    if not np.any(table.pointing):
        raise ThrustTableError(f"{table.name}: no row with the motors on; a map needs at least 8, better 20")
    weights, tares = drift_weights(table)
    zero = weights @ table.scale[tares]
    pointing = table.pointing
    thrust = (table.scale - zero)[pointing] / table.motors[pointing]
    sigma = SIGMA_SCALE * FORCE_UNITS["g"]
    return ThrustData(
        name=table.name,
        source=f"thrust run {table.name}",
        voltage=table.motor_voltage[pointing],
        thrust=thrust,
        block=table.block[pointing],
        sigma_voltage=SIGMA_VOLTAGE,
        sigma_thrust=sigma / float(np.max(table.motors)),
        shared=weights[pointing] * sigma / table.motors[pointing][:, None],
    )
