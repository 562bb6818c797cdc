"""Units of a raw table, and the questions to ask when its numbers look like another unit's.

A table says its units in its header, and people mistake them. Numbers are never converted on a guess: a
finding asks, and the table is read again with what the operator answers.
"""

from dataclasses import dataclass

import numpy as np

from calibration.bench.thrust.errors import ThrustTableError
from calibration.measurement import Finding, Severity
from onboard.arrays import FloatArray
from onboard.gravity import GRAM_FORCE

FORCE_UNITS = {"g": GRAM_FORCE, "N": 1.0, "oz": 28.349523125 * GRAM_FORCE, "kg": 1e3 * GRAM_FORCE}
"""N of one unit of a scale's reading."""
VOLTAGE_UNITS = {"V": 1.0, "mV": 1e-3}
LARGEST_READING = 1e6
"""Of a scale or a voltmeter in any of these units."""
FULL_SCALES = (65535, 255, 100, 1)
"""Commands at full power that tables use."""

_USUAL_FACTOR = 2.0
"""Small motors give within this factor of `usual_thrust` (gf): published ones from 0.7 to 1.4 times."""
_HIGHEST_VOLTAGE = 20.0
_LOWEST_VOLTAGE = 0.3


@dataclass(frozen=True, slots=True)
class Units:
    """What the numbers of a raw table are.

    Attributes:
        force: of the scale's reading, one of `FORCE_UNITS`.
        voltage: one of `VOLTAGE_UNITS`.
        full_scale: command at full power, one of `FULL_SCALES`.
        motors: that turn while the scale is read; None to take the table's own column.
    """

    force: str = "g"
    voltage: str = "V"
    full_scale: int = 65535
    motors: int | None = None

    def __post_init__(self) -> None:
        for what, value, known in (
            ("force", self.force, tuple(FORCE_UNITS)),
            ("voltage", self.voltage, tuple(VOLTAGE_UNITS)),
            ("full scale", self.full_scale, FULL_SCALES),
        ):
            if value not in known:
                raise ThrustTableError(f"{what} {value!r} is not known: choose one of {known}")

    def command16(self, command: FloatArray) -> FloatArray:
        """Commands as the 16-bit ones that the firmware takes."""
        if self.full_scale == 65535:
            return command
        if self.full_scale == 255:
            return np.rint(command) * 256.0
        return np.rint(command / self.full_scale * 65535.0)


def usual_thrust(voltage: float) -> float:
    """Thrust (gf) that small drones' motors give at `voltage` (V).

    Geometric mean of Bitcraze's curves of 2025 (L250, P250, T350, B500), which lie within 1.4 times of it.
    """
    return float(7.2 * (voltage / 2.0) ** 1.75)


def unit_questions(name: str, voltage: FloatArray, thrust: FloatArray, units: Units) -> list[Finding]:
    """What to ask about a table's units.

    Args:
        name: of the table.
        voltage: (n,) V at the motor, by `units`.
        thrust: (n,) N of one motor, by `units`.
        units: as the table or the operator says.
    """
    highest = float(np.max(voltage))
    if highest > _HIGHEST_VOLTAGE or highest < _LOWEST_VOLTAGE:
        other = "mV" if highest > _HIGHEST_VOLTAGE else "V"
        text = (
            f"{name}: the highest motor voltage would be {highest:.4g} V: are the voltages in {other}? "
            "Say so and read the table again"
        )
        return [Finding("unit_voltage", Severity.REJECT, text)]
    at = int(np.argmax(voltage))
    measured = float(np.median(thrust[np.argsort(voltage)[-3:]])) / GRAM_FORCE
    expected = usual_thrust(float(voltage[at]))
    if measured <= 0.0 or 1.0 / _USUAL_FACTOR < measured / expected < _USUAL_FACTOR:
        return []
    guess = _likeliest(measured / expected, units)
    text = (
        f"{name}: {measured:.3g} gf a motor at {highest:.2f} V, where small motors give about "
        f"{expected:.1f}: "
        f"{guess} Say so and read the table again"
    )
    return [Finding("unit_thrust", Severity.REJECT, text)]


def _likeliest(ratio: float, units: Units) -> str:
    """The question whose answer would bring the ratio closest to one."""
    questions = {1.0 / 4.0: "is it the total of four motors?", 4.0: "was the total divided by four twice?"}
    for unit, size in FORCE_UNITS.items():
        if unit != units.force:
            questions[size / FORCE_UNITS[units.force]] = f"is the scale's reading in {unit}?"
    factor = min(questions, key=lambda one: abs(np.log(one * ratio)))
    return questions[factor]


def command_questions(name: str, command: FloatArray, units: Units) -> list[Finding]:
    """What to ask about a table's commands (in the table's own numbers)."""
    highest = float(np.max(command, initial=0.0))
    if highest > units.full_scale:
        text = (
            f"{name}: commands reach {highest:.0f}, more than the {units.full_scale} of full power: "
            "are they 0..65535? Say so and read the table again"
        )
        return [Finding("unit_command", Severity.REJECT, text)]
    if 0.0 < highest <= units.full_scale / 100.0 or (units.full_scale == 65535 and 0.0 < highest <= 255.0):
        likely = next(scale for scale in sorted(FULL_SCALES) if highest <= scale)
        text = (
            f"{name}: commands reach only {highest:g} of {units.full_scale}: are they 0..{likely}? "
            "Say so and read the table again"
        )
        return [Finding("unit_command", Severity.REJECT, text)]
    if units.full_scale == 65535 and np.any(np.mod(command, 256.0) != 0.0):
        text = (
            f"{name}: commands are not multiples of 256: the timer drops their low byte; what it "
            "really applies is used, but set points of 256 k would leave no doubt"
        )
        return [Finding("coarse_command", Severity.NOTE, text)]
    return []
