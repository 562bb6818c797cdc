"""What can be wrong with a thrust run, and with the points of a map."""

from collections.abc import Callable, Iterator

import numpy as np

from calibration.bench.check_table import REJECTED, WARNED, Check, above, below, findings_of
from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.fit import FormFit
from calibration.bench.thrust.raw_table import RawTable, drift_weights, to_data
from calibration.measurement import Finding
from onboard.arrays import BoolArray, FloatArray
from onboard.gravity import GRAM_FORCE

DISAGREEMENT = 0.03
_DISAGREEMENT_FLOOR = 0.15 * GRAM_FORCE
_LOW_GF, _HIGH_GF = 1.0, 12.0
_STRAY_SIGMAS = 8.0
"""Of the other points' scatter: also tables whose curve bends otherwise than the form stay below."""
_ENDS = below(note=2)
_DIFFER = above(warning=DISAGREEMENT)


def check_run(table: RawTable) -> list[Finding]:
    """Findings about a raw run, whatever form is fitted."""
    blocks = np.unique(table.block)
    return [
        *findings_of(table.name, [_time(table), _scale(table), _board(table)]),
        *(one for label in blocks for one in _check_block(table, label)),
        *findings_of(table.name, [*_repeats(table), *_pairs(table), *_supplies(table)]),
    ]


def check_points(data: ThrustData, expected: Callable[[float], float] | None = None) -> list[Finding]:
    """Findings about the points of a map.

    Args:
        data: the points.
        expected: thrust (N) at a voltage (V) by the map so far, if there is one.
    """
    thrust = data.thrust / GRAM_FORCE
    table = (
        Check(
            "few_low",
            int(np.sum(thrust < _LOW_GF)),
            _ENDS,
            f"{{}} points below {_LOW_GF:g} gf ({{}} are asked for)",
            "the map is not tied down there",
        ),
        Check(
            "few_high",
            int(np.sum(thrust > _HIGH_GF)),
            _ENDS,
            f"{{}} points above {_HIGH_GF:g} gf ({{}} are asked for)",
            "the map is not tied down there",
        ),
        Check(
            "negative_sign",
            float(np.median(data.thrust)) <= 0.0,
            REJECTED,
            "thrusts are negative: the scale is pushed the other way",
            "turn the rig or the sign",
        ),
        Check(
            "low_thrust",
            _share_of(expected, data),
            below(warning=0.75),
            "thrust is {:.0%} of what the map so far gives (limit {:.0%})",
            "a propeller is missing, upside down, or on the wrong motor",
        ),
    )
    return findings_of(data.name, table)


def check_curve(name: str, fit: FormFit) -> list[Finding]:
    """Whether one point lies far off the curve that the others make: a slip in its row, not scatter.

    Args:
        name: of the table.
        fit: of the chosen form.
    """
    off = np.abs(fit.residuals)
    at = int(np.argmax(off))
    limit = max(_STRAY_SIGMAS * 1.4826 * float(np.median(off)), _DISAGREEMENT_FLOOR / GRAM_FORCE)
    stray = Check(
        "stray_point",
        float(off[at]),
        above(warning=limit),
        f"the point at {fit.voltage[at]:.3f} V, {fit.thrust[at]:.2f} gf is {{:.2f}} gf off the curve of the "
        "others (limit {:.2f} gf)",
        "it bends the whole map: look at its row, measure it again or take it out",
    )
    return findings_of(name, [stray])


def _share_of(expected: Callable[[float], float] | None, data: ThrustData) -> float | None:
    """Median ratio to the map so far where that gives more than 2 gf; None without a map or such points."""
    if expected is None:
        return None
    usual = np.array([expected(float(v)) for v in data.voltage])
    strong = usual > 2.0 * GRAM_FORCE
    return float(np.median(data.thrust[strong] / usual[strong])) if np.any(strong) else None


def _time(table: RawTable) -> Check:
    back = np.flatnonzero(np.diff(table.time) < 0.0)
    return Check(
        "brown_out",
        int(back[0]) + 2 if back.size else None,
        REJECTED,
        "time goes back at row {}: the drone restarted (brown-out)",
        "repeat from there",
    )


def _scale(table: RawTable) -> Check:
    """One reading for all, or one highest reading for several commands."""
    running = table.scale[table.pointing]
    stuck = running.size > 3 and np.unique(table.scale).size == 1
    if stuck:
        return Check(
            "scale_stuck",
            True,
            REJECTED,
            "all readings of the scale are the same: it is stuck",
            "check its wires",
        )
    commands = table.commands16[table.pointing]
    top = np.isclose(running, np.max(running, initial=0.0), rtol=0.0, atol=1e-9)
    return Check(
        "scale_saturated",
        int(np.unique(commands[top]).size),
        above(reject=2),
        "{} different commands read the same highest weight: the scale is full",
        "use a larger scale, or less of its range",
    )


def _board(table: RawTable) -> Check:
    return Check(
        "board_above_supply",
        float(np.max(table.board - table.supply, initial=0.0)),
        above(warning=0.05),
        "the board says {:.2f} V more than the supply (limit {:g} V)",
        "check one of them with a multimeter",
    )


def _check_block(table: RawTable, label: float) -> list[Finding]:
    """What one supply voltage of a run shows between its tares."""
    own, tares = table.block == label, table.rows("tare")
    rest, running = own & tares, own & table.pointing
    sag = fall = None
    if np.any(rest) and np.any(running):
        at_rest = table.supply[rest]
        sag = float(np.median(at_rest) - np.min(table.supply[running]))
        fall = float(at_rest[0] - at_rest[-1])
    zero = table.scale[rest]
    rows = (
        Check(
            "supply_limit",
            sag,
            above(warning=0.3),
            "the supply falls by {:.2f} V (limit {} V): it is at its current limit",
            "raise it, shorten the leads",
        ),
        Check(
            "battery",
            fall,
            above(note=0.1),
            "the voltage at rest fell by {:.2f} V (limit {} V): a battery, not a supply",
            "the map holds, but use a supply to reach all voltages",
        ),
        Check("one_tare", zero.size == 1, WARNED, "one tare only", "read the scale at rest before and after"),
        Check(
            "tare_drift",
            float(np.ptp(zero)) / GRAM_FORCE if zero.size else None,
            above(warning=0.3),
            "the scale drifts by {:.2f} g (limit {} g)",
            "let it warm up for 15 minutes, keep draughts away",
        ),
    )
    return findings_of(f"{table.name}, block {label:.0f}", rows)


def _without_drift(table: RawTable) -> FloatArray:
    weights, tares = drift_weights(table)
    return np.asarray((table.scale - weights @ table.scale[tares]) / table.motors)


def _repeats(table: RawTable) -> Iterator[Check]:
    """The first command whose repeats within a block differ by more than noise."""
    thrust, repeats = _without_drift(table), table.rows("repeat")
    for block in np.unique(table.block[repeats]):
        own = repeats & (table.block == block)
        for command in np.unique(table.command[own]):
            values = thrust[own & (table.command == command)]
            limit = max(DISAGREEMENT * abs(float(values.mean())), _DISAGREEMENT_FLOOR) / GRAM_FORCE
            apart = float(np.max(np.abs(values - np.median(values)))) / GRAM_FORCE
            if apart > limit:
                yield Check(
                    "repeats_differ",
                    apart,
                    above(warning=limit),
                    f"repeats of command {command:.0f} are {{:.2f}} gf off their median (limit {{:.2f}} gf)",
                    "motors warm up, or the rig moves: let them cool, fasten it",
                )
                return


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


def _pairs(table: RawTable) -> Iterator[Check]:
    """Two kinds of readings that belong on one curve."""
    thrust, voltage = _without_drift(table), table.motor_voltage

    def pair(code: str, first: BoolArray, second: BoolArray, kinds: str) -> Check:
        difference = _curve_difference(voltage[first], thrust[first], voltage[second], thrust[second])
        meaning = f"{kinds} differ by {{:.1%}} (limit {{:.0%}})"
        return Check(code, abs(difference), _DIFFER, meaning, "find out why before using the map")

    yield pair("hysteresis", table.rows("up"), table.rows("down"), "the sweeps up and down")
    raised = "readings with the drone raised (ground or ceiling)"
    yield pair("raised", table.pointing, table.rows("raised"), raised)


def _supplies(table: RawTable) -> Iterator[Check]:
    """Each further supply voltage against the first: they give one curve if the motor voltage is right."""
    data = to_data(table)
    labels = np.unique(data.block)
    first = data.block == labels[0]
    for label in labels[1:]:
        own = data.block == label
        difference = _curve_difference(
            data.voltage[first], data.thrust[first], data.voltage[own], data.thrust[own]
        )
        yield Check(
            "supplies_differ",
            abs(difference),
            _DIFFER,
            f"blocks {labels[0]:.0f} and {label:.0f} (two supply voltages) give curves that differ by "
            "{:.1%} (limit {:.0%}): the motor voltage is not what it seems",
            "measure it at the board",
        )
