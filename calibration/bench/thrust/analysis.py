"""From a table to the result, in one call: the same for a run just made and for public tables."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from calibration.bench.thrust.checks import check_curve, check_points, check_run
from calibration.bench.thrust.choose import choose, report_forms, thrust_range
from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.paper_table import CUBIC_COLUMNS, PAPER_COLUMNS, bitcraze_maps, paper_maps
from calibration.bench.thrust.public_tables import (
    BITCRAZE_2015,
    FOERSTER,
    bitcraze_2015,
    foerster,
    interleaved,
)
from calibration.bench.thrust.raw_table import RAW_HEADER, RawTable, read_raw, to_data
from calibration.bench.thrust.thrust_result import ThrustResult
from calibration.bench.thrust.units import (
    FORCE_UNITS,
    LARGEST_READING,
    VOLTAGE_UNITS,
    Units,
    command_questions,
    unit_questions,
)
from calibration.measurement import Estimate, Finding, rejected
from onboard.csv_file import CsvFile, read_csv
from onboard.vehicle.model import ThrustMapDescription

POINT_HEADER = ("voltage", "thrust")
"""Header of a plain table of points: motor voltage and thrust of one motor, by the units that are stated."""


def read_table(
    path: Path, units: Units | None = None
) -> ThrustData | RawTable | dict[str, ThrustMapDescription]:
    """Whatever a thrust table holds: points, a raw run, or published maps by name.

    Args:
        path: CSV file; lines that begin with # are skipped.
        units: of a raw run or of plain points; None for g, V and 16-bit commands.

    Raises:
        ThrustTableError: not readable, a header that is not known, or a cell that is no number.
    """
    table = read_csv(path, ThrustTableError, comment="#")
    names = frozenset(table.header)
    if names >= BITCRAZE_2015:
        return bitcraze_2015(table)
    if names >= FOERSTER:
        return foerster(table)
    if names >= PAPER_COLUMNS:
        return paper_maps(table)
    if names >= CUBIC_COLUMNS:
        return bitcraze_maps(table)
    if table.header == RAW_HEADER:
        return read_raw(table, units or Units())
    if table.header == POINT_HEADER:
        return _points(table, units or Units())
    known = (
        f"{','.join(RAW_HEADER)!r} (a raw run), {','.join(POINT_HEADER)!r} (points), or one of "
        "the public tables"
    )
    raise ThrustTableError(
        f"{path}: header {','.join(table.header)!r} is not of a thrust table; expected {known}"
    )


def _points(table: CsvFile, units: Units) -> ThrustData:
    voltage = table.finite("voltage", largest=LARGEST_READING) * VOLTAGE_UNITS[units.voltage]
    for index in np.flatnonzero(voltage < 0.0)[:1]:
        raise table.problem(table.rows[index], "voltage", f"{voltage[index]:g} V is below 0")
    total = table.finite("thrust", largest=LARGEST_READING) * FORCE_UNITS[units.force]
    thrust = total / float(units.motors or 1)
    name = table.path.name
    return ThrustData(name, f"table {name}", voltage, thrust, interleaved(voltage.size))


def questions(table: ThrustData | RawTable) -> list[Finding]:
    """What to ask the operator about the units of a table before anything is fitted; mostly nothing."""
    if isinstance(table, ThrustData):
        return unit_questions(table.name, table.voltage, table.thrust, Units())
    asked = command_questions(table.name, table.command[table.pointing], table.units)
    if rejected(asked):
        return asked
    data = to_data(table)
    return asked + unit_questions(table.name, data.voltage, data.thrust, table.units)


def analyse(table: ThrustData | RawTable, expected: Callable[[float], float] | None = None) -> ThrustResult:
    """Fit all forms to a table and choose one.

    Args:
        table: points, or a raw run (its drift is removed by the tares).
        expected: thrust (N) at a motor voltage (V) by the map so far; finds missing propellers.

    Raises:
        ThrustTableError: too few points, no form that may fly, or units that must be asked about first.
    """
    findings = questions(table)
    if rejected(findings):
        raise ThrustTableError("; ".join(finding.text for finding in findings))
    if isinstance(table, RawTable):
        data = to_data(table)
        findings += check_run(table)
    else:
        data = table
    findings += check_points(data, expected)
    forms = report_forms(data)
    chosen = choose(forms)
    findings += check_curve(data.name, chosen.fit)
    low, high = thrust_range(data)
    at = np.array([data.voltage[data.thrust == low][0], data.voltage[data.thrust == high][0]])
    sigma = chosen.fit.curve_sigma(at) * FORCE_UNITS["g"]
    return ThrustResult(
        data=data,
        forms=forms,
        chosen=chosen.name,
        thrust_min=Estimate(low, "N", float(sigma[0])),
        thrust_max=Estimate(high, "N", float(sigma[1])),
        findings=tuple(findings),
    )
