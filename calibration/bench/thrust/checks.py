"""What can be wrong with a thrust run: each finding names its figure, its limit and what to do."""

from collections.abc import Callable

import numpy as np

from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.raw_table import RawTable, drift_weights, to_data
from calibration.measurement import Finding, Severity
from onboard.arrays import BoolArray, FloatArray
from onboard.gravity import GRAM_FORCE

SAG_LIMIT = 0.3
"""V."""
DRIFT_LIMIT = 0.3 * GRAM_FORCE
DISAGREEMENT = 0.03
_DISAGREEMENT_FLOOR = 0.15 * GRAM_FORCE
LOW_LIMIT = 0.75
_LOW_GF, _HIGH_GF = 1.0, 12.0
_FEWEST_AT_ENDS = 2
_BATTERY_FALL = 0.1


def check_run(table: RawTable) -> list[Finding]:
    """Findings about a raw run, whatever form is fitted."""
    findings: list[Finding] = []
    for check in (_check_time, _check_scale, _check_supply, _check_drift, _check_repeats):
        findings += check(table)
    for code, groups, what in (
        ("hysteresis", (table.rows("up"), table.rows("down")), "the sweeps up and down"),
        (
            "raised",
            (table.pointing, table.rows("raised")),
            "readings with the drone raised (ground or ceiling)",
        ),
    ):
        findings += _check_pair(table, code, groups, what)
    findings += _check_blocks(table)
    return findings


def check_points(data: ThrustData, expected: Callable[[float], float] | None = None) -> list[Finding]:
    """Findings about the points of a map.

    Args:
        data: the points.
        expected: thrust (N) at a voltage (V) by the map so far, if there is one.
    """
    findings: list[Finding] = []
    thrust = data.thrust / GRAM_FORCE
    low, high = int(np.sum(thrust < _LOW_GF)), int(np.sum(thrust > _HIGH_GF))
    for code, count, where in (("few_low", low, "below 1 gf"), ("few_high", high, "above 12 gf")):
        if count < _FEWEST_AT_ENDS:
            text = f"{data.name}: {count} points {where} (2 are asked for): the map is not tied down there"
            findings.append(Finding(code, Severity.NOTE, text))
    if float(np.median(data.thrust)) <= 0.0:
        text = (
            f"{data.name}: thrusts are negative: the scale is pushed the other way; turn the rig or the sign"
        )
        findings.append(Finding("negative_sign", Severity.REJECT, text))
    if expected is not None:
        usual = np.array([expected(float(v)) for v in data.voltage])
        strong = usual > 2.0 * GRAM_FORCE
        if np.any(strong):
            ratio = float(np.median(data.thrust[strong] / usual[strong]))
            if ratio < LOW_LIMIT:
                text = (
                    f"{data.name}: thrust is {ratio:.0%} of what the map so far gives (limit "
                    f"{LOW_LIMIT:.0%}): a "
                    "propeller is missing, upside down, or on the wrong motor"
                )
                findings.append(Finding("low_thrust", Severity.WARNING, text))
    return findings


def _check_time(table: RawTable) -> list[Finding]:
    back = np.flatnonzero(np.diff(table.time) < 0.0)
    if back.size == 0:
        return []
    text = (
        f"{table.name}: time goes back at row {back[0] + 2}: the drone restarted (brown-out); "
        "repeat from there"
    )
    return [Finding("brown_out", Severity.REJECT, text)]


def _check_scale(table: RawTable) -> list[Finding]:
    running = table.scale[table.pointing]
    if running.size > 3 and np.unique(table.scale).size == 1:
        text = f"{table.name}: all readings of the scale are the same: it is stuck; check its wires"
        return [Finding("scale_stuck", Severity.REJECT, text)]
    commands = table.commands16[table.pointing]
    top = np.isclose(running, np.max(running, initial=0.0), rtol=0.0, atol=1e-9)
    if top.sum() >= 3 and np.unique(commands[top]).size >= 3:
        text = f"{table.name}: {top.sum()} different commands read the same highest weight: the scale is full"
        return [Finding("scale_saturated", Severity.REJECT, text)]
    return []


def _check_supply(table: RawTable) -> list[Finding]:
    findings: list[Finding] = []
    running, rest = table.pointing, table.rows("tare")
    above = table.board > table.supply + 0.05
    if np.any(above):
        excess = float(np.max((table.board - table.supply)[above]))
        text = (
            f"{table.name}: the board says {excess:.2f} V more than the supply: check one of "
            "them with a multimeter"
        )
        findings.append(Finding("board_above_supply", Severity.WARNING, text))
    for label in np.unique(table.block):
        own = table.block == label
        if not np.any(own & rest) or not np.any(own & running):
            continue
        supply = float(np.median(table.supply[own & rest])) - table.supply[own & running]
        if float(np.max(supply)) > SAG_LIMIT:
            text = (
                f"{table.name}, block {label:.0f}: the supply falls by {np.max(supply):.2f} V "
                f"(limit {SAG_LIMIT} V): "
                "it is at its current limit; raise it, shorten the leads"
            )
            findings.append(Finding("supply_limit", Severity.WARNING, text))
        findings += _check_battery(table, own & rest, label)
    return findings


def _check_battery(table: RawTable, tares: BoolArray, label: float) -> list[Finding]:
    """A supply has the same voltage at rest before and after; a battery has not."""
    supply = table.supply[tares]
    if supply.size < 2 or supply[0] - supply[-1] < _BATTERY_FALL:
        return []
    text = (
        f"{table.name}, block {label:.0f}: the voltage at rest fell by "
        f"{supply[0] - supply[-1]:.2f} V: a battery, not a "
        "supply; the map holds, but use a supply to reach all voltages"
    )
    return [Finding("battery", Severity.NOTE, text)]


def _check_drift(table: RawTable) -> list[Finding]:
    tares = table.rows("tare")
    findings: list[Finding] = []
    for label in np.unique(table.block):
        zero = table.scale[tares & (table.block == label)]
        if zero.size == 1:
            text = f"{table.name}, block {label:.0f}: one tare only: read the scale at rest before and after"
            findings.append(Finding("one_tare", Severity.WARNING, text))
        elif zero.size and float(np.ptp(zero)) > DRIFT_LIMIT:
            text = (
                f"{table.name}, block {label:.0f}: the scale drifts by "
                f"{np.ptp(zero) / GRAM_FORCE:.2f} g (limit 0.3 g): "
                "let it warm up for 15 minutes, keep draughts away"
            )
            findings.append(Finding("tare_drift", Severity.WARNING, text))
    return findings


def _without_drift(table: RawTable) -> FloatArray:
    weights, tares = drift_weights(table)
    return np.asarray((table.scale - weights @ table.scale[tares]) / table.motors)


def _check_repeats(table: RawTable) -> list[Finding]:
    thrust, repeats = _without_drift(table), table.rows("repeat")
    for block in np.unique(table.block[repeats]):
        own = repeats & (table.block == block)
        for command in np.unique(table.command[own]):
            values = thrust[own & (table.command == command)]
            if values.size < 2:
                continue
            limit = max(DISAGREEMENT * abs(float(values.mean())), _DISAGREEMENT_FLOOR)
            if float(np.max(np.abs(values - np.median(values)))) > limit:
                text = (
                    f"{table.name}: repeats of command {command:.0f} differ by "
                    f"{np.ptp(values) / GRAM_FORCE:.2f} gf "
                    f"(limit {limit / GRAM_FORCE:.2f} gf): motors warm up, or the rig moves"
                )
                return [Finding("repeats_differ", Severity.WARNING, text)]
    return []


def _curve_difference(
    voltage: FloatArray, thrust: FloatArray, other_voltage: FloatArray, other_thrust: FloatArray
) -> float:
    """Median relative difference of two sets of points on one curve, where they overlap; 0 with too few."""
    if voltage.size < 4 or other_voltage.size < 3:
        return 0.0
    inside = (other_voltage > voltage.min()) & (other_voltage < voltage.max())
    powers = np.arange(min(4, voltage.size - 1))
    curve = np.linalg.lstsq(voltage[:, None] ** powers, thrust, rcond=None)[0]
    there = other_voltage[inside][:, None] ** powers @ curve
    strong = there > 1.5 * GRAM_FORCE
    if strong.sum() < 2:
        return 0.0
    return float(np.median(other_thrust[inside][strong] / there[strong] - 1.0))


def _check_pair(table: RawTable, code: str, groups: tuple[BoolArray, BoolArray], what: str) -> list[Finding]:
    thrust, voltage = _without_drift(table), table.motor_voltage
    first, second = groups
    difference = _curve_difference(voltage[first], thrust[first], voltage[second], thrust[second])
    if abs(difference) <= DISAGREEMENT:
        return []
    text = f"{table.name}: {what} differ by {difference:+.1%} (limit 3 %): find out why before using the map"
    return [Finding(code, Severity.WARNING, text)]


def _check_blocks(table: RawTable) -> list[Finding]:
    data = to_data(table)
    labels = np.unique(data.block)
    findings: list[Finding] = []
    for label in labels[1:]:
        first, own = data.block == labels[0], data.block == label
        difference = _curve_difference(
            data.voltage[first], data.thrust[first], data.voltage[own], data.thrust[own]
        )
        if abs(difference) > DISAGREEMENT:
            text = (
                f"{table.name}: blocks {labels[0]:.0f} and {label:.0f} (two supply voltages) "
                "give curves that differ by "
                f"{difference:+.1%} (limit 3 %): the motor voltage is not what it seems; measure "
                "it at the board"
            )
            findings.append(Finding("supplies_differ", Severity.WARNING, text))
    return findings
